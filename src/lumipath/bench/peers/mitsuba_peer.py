"""Mitsuba 3 renders the scene: a script for `serve`; its option is the variant."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from serve import meshes, serve

# As many samples at once as a wavefront of some 16 million paths has room for.
_PATHS_AT_ONCE = 1 << 24


def make(arrays: Any, options: list[str]) -> tuple[str, Any]:
    """The renderer of one scene."""
    import mitsuba as mi
    import numpy as np

    variant = options[0]
    mi.set_variant(variant)
    if int(arrays["threads"]):
        import drjit

        drjit.set_thread_count(int(arrays["threads"]))
    width, height = (int(side) for side in arrays["size"])
    scene = mi.load_dict(_scene(mi, np, arrays, width, height))

    def render(spp: int, seed: int) -> tuple[Any, float]:
        most = max(1, _PATHS_AT_ONCE // (width * height))
        parts = [min(most, spp - first) for first in range(0, spp, most)]
        start = time.perf_counter()
        pixels = sum(
            np.array(mi.render(scene, spp=part, seed=(seed << 10) + k)) * (part / spp) for k, part in enumerate(parts)
        )
        return pixels, time.perf_counter() - start

    return f"Mitsuba {mi.__version__} {variant}", render


def _scene(mi: Any, np: Any, arrays: Any, width: int, height: int) -> dict[str, Any]:
    position, _right, up, backward = arrays["camera"]
    to_world = mi.ScalarTransform4f().look_at(list(position), list(position - backward), list(up))
    made: dict[str, Any] = {
        "type": "scene",
        # Mitsuba counts one more, and ends no path by chance here.
        "integrator": {"type": "path", "max_depth": int(arrays["max_depth"]) + 1, "rr_depth": 1 << 20},
        "sensor": {
            "type": "perspective",
            "fov": float(arrays["fov"]),
            "fov_axis": "y",
            "to_world": to_world,
            "film": {
                "type": "hdrfilm",
                "width": width,
                "height": height,
                "rfilter": {"type": "box"},
                "pixel_format": "rgb",
            },
            "sampler": {"type": "independent"},
        },
    }
    for k, (vertices, faces, albedo, emission) in enumerate(meshes(arrays)):
        path = Path(arrays.fid.name).with_name(f"mesh-{k}.ply")
        _write_ply(np, path, vertices, faces)
        matt = {"type": "diffuse", "reflectance": {"type": "rgb", "value": albedo.tolist()}}
        shape = {"type": "ply", "filename": str(path), "face_normals": True, "bsdf": {"type": "twosided", "bsdf": matt}}
        if emission.max() > 0:
            shape["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": emission.tolist()}}
        made[f"mesh_{k}"] = shape
    return made


def _write_ply(np: Any, path: Path, vertices: Any, faces: Any) -> None:
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    path.write_bytes(header.encode() + vertices.astype("<f4").tobytes() + rows.tobytes())


if __name__ == "__main__":
    serve(make)
