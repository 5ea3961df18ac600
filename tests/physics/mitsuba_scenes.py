"""The same scenes for Mitsuba 3, as far as it has the same things, and renders of them.

Differences that are accounted for here:
- Mitsuba's max_depth is one more than ours.
- Its lamps shine, and its diffuse surfaces reflect, on one side only: `twosided` where ours have two.
- Its directional light is given by irradiance and its point light by intensity; ours by the radiance of a white
  surface, which is a pi-th of the irradiance. Intensities, of our points and spots too, are the same.
- Its spot falls off linearly in the angle, ours by cosines, so only sharp edges agree; and its beam width must be less
  than its cutoff.
- Its texture coordinates count from the top of an image, ours from the bottom.
- Its environment image begins at -z, where ours has its middle; and its rows of texels are spread so that the first and
  the last lie on the poles, where ours lie half a texel from them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mitsuba
import numpy as np

from lumipath.scene import (
    Appearance,
    Camera,
    Conductor,
    Diffuse,
    DirectionalLight,
    Material,
    Mesh,
    Mix,
    PointLight,
    Scene,
    Sphere,
    SpotLight,
    Texture,
    ThinDielectric,
)

mitsuba.set_variant("scalar_rgb")

Dictionary = dict[str, Any]


def _bitmap(texture: Texture, image: Any) -> Dictionary:
    """An image that is looked up as a texture of ours is; its coordinates count from the top."""
    assert texture.wrap[0] == texture.wrap[1]
    matrix = np.eye(4)
    matrix[:2, :2], matrix[:2, 3] = texture.matrix()[:, :2], texture.matrix()[:, 2]
    flip = np.diag([1.0, -1.0, 1.0, 1.0])
    flip[1, 3] = 1
    return {
        "type": "bitmap", "bitmap": mitsuba.Bitmap(np.array(image, np.float32)), "raw": True,
        "filter_type": texture.filter, "wrap_mode": texture.wrap[0],
        "to_uv": mitsuba.ScalarTransform4f(flip @ matrix @ flip),
    }  # fmt: skip


def _linear(texture: Texture) -> Any:
    """(H, W, C) float64: what the texels of a texture mean."""
    if texture.image.dtype != np.uint8:
        return texture.image.astype(np.float64)
    value = texture.image / 255
    curve = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return np.concatenate([(curve if texture.srgb else value)[:, :, :3], value[:, :, 3:]], axis=2)


def _colour(value: Any) -> Dictionary:
    if isinstance(value, Texture):
        return _bitmap(value, _linear(value)[:, :, :3] * value.factor)
    return {"type": "rgb", "value": [float(part) for part in value]}


def _number(value: Any) -> Any:
    if not isinstance(value, Texture):
        return value
    return _bitmap(value, _linear(value)[:, :, [max("rgba".find(value.channel), 0)]] * value.factor[0])


def surface_bsdf(material: Appearance) -> Dictionary:
    """A matt surface, a mix of such ones, and what may go with them."""
    if isinstance(material, Mix):
        parts = {name: surface_bsdf(part) for name, part in material.parts().items()}
        made = {"type": "blendbsdf", "weight": _number(material.weight), **parts}
    else:
        assert isinstance(material, Diffuse)
        assert material.roughness == 0
        made = {"type": "diffuse", "reflectance": _colour(material.reflectance)}
    if material.normal_map is not None:
        bitmap = _bitmap(material.normal_map, material.normal_map.image)
        made = {"type": "normalmap", "normalmap": bitmap, "bsdf": made, "use_shadowing_function": False}
    if material.two_sided and not isinstance(material, Mix):
        made = {"type": "twosided", "bsdf": made}
    if material.has_holes:
        made = {"type": "mask", "opacity": _number(material.opacity), "bsdf": made}
    return made


def bsdf(material: Material | Appearance) -> Dictionary:
    """A material of one lobe, or a surface."""
    if isinstance(material, ThinDielectric):
        return {"type": "thindielectric", "int_ior": material.ior, "specular_transmittance": _colour(material.tint)}
    if isinstance(material, Conductor):
        eta, k = (_colour(part) for part in material.index)
        return {"type": "twosided", "bsdf": {"type": "conductor", "eta": eta, "k": k}}
    if isinstance(material, Appearance):
        return surface_bsdf(material)
    if material.is_dielectric:
        return {"type": "dielectric", "int_ior": material.index, "ext_ior": 1.0}
    if material.specular is not None:
        mirror = {"type": "conductor", "material": "none", "specular_reflectance": _colour(material.specular)}
        return {"type": "twosided", "bsdf": mirror}
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": _colour(material.diffuse)}}


def _write_ply(path: Path, mesh: Mesh) -> None:
    columns, names = [mesh.vertices], ["x", "y", "z"]
    if mesh.normals is not None:
        columns, names = columns + [mesh.normals], names + ["nx", "ny", "nz"]
    if mesh.uvs is not None:
        columns, names = columns + [mesh.uvs * (1, -1) + (0, 1)], names + ["u", "v"]
    header = ["ply", "format ascii 1.0", f"element vertex {len(mesh.vertices)}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices", "end_header"]
    rows = [" ".join(f"{number:.9g}" for number in row) for row in np.concatenate(columns, axis=1)]
    rows += [f"3 {a} {b} {c}" for a, b, c in mesh.faces]
    path.write_text("\n".join(header + rows) + "\n")


def _shape(shape: Any, path: Path) -> Dictionary:
    if isinstance(shape, Sphere):
        made: Dictionary = {"type": "sphere", "to_world": mitsuba.ScalarTransform4f(shape.transform)}
    else:
        _write_ply(path, shape)
        made = {"type": "ply", "filename": str(path), "face_normals": shape.normals is None}
    made["bsdf"] = bsdf(shape.material)
    if shape.material.is_emissive:
        assert isinstance(shape, Sphere) or not shape.two_sided
        made["emitter"] = {"type": "area", "radiance": _colour(shape.material.emission)}
    return made


def _light(light: Any) -> Dictionary:
    if isinstance(light, DirectionalLight):
        irradiance = np.pi * np.array(light.colour)
        return {"type": "directional", "direction": list(light.direction), "irradiance": _colour(irradiance)}
    if isinstance(light, SpotLight):
        assert light.inner_angle == light.outer_angle
        target = np.add(light.position, light.direction).tolist()
        up = [1, 0, 0] if abs(light.direction[0]) < 0.9 else [0, 1, 0]
        to_world = mitsuba.ScalarTransform4f().look_at(list(light.position), target, up)
        angles = {"cutoff_angle": light.outer_angle, "beam_width": light.outer_angle * (1 - 1e-5)}
        return {"type": "spot", "to_world": to_world, "intensity": _colour(light.intensity), **angles}
    assert isinstance(light, PointLight)
    if light.intensity is not None:
        return {"type": "point", "position": list(light.position), "intensity": _colour(light.intensity)}
    # Only where no surface is nearer than 1, since ours is cut off there.
    assert tuple(light.attenuation) == (0.0, 0.0, 1.0)
    return {"type": "point", "position": list(light.position), "intensity": _colour(np.pi * np.array(light.colour))}


def _sensor(camera: Camera, width: int, height: int, rfilter: Dictionary) -> Dictionary:
    target = np.add(camera.position, camera.direction)
    to_world = mitsuba.ScalarTransform4f().look_at(list(camera.position), target.tolist(), list(camera.up))
    lens: Dictionary = {"type": "perspective", "fov": camera.fov, "fov_axis": "y"}
    if camera.aperture > 0:
        lens |= {"type": "thinlens", "aperture_radius": camera.aperture, "focus_distance": camera.focus}
    elif any(camera.shift):
        # In parts of the width and of the height, and y counts downwards.
        longer = max(width, height)
        lens["principal_point_offset_x"] = camera.shift[0] * longer / width
        lens["principal_point_offset_y"] = -camera.shift[1] * longer / height
    if camera.projection == "orthographic":
        assert width == height
        assert not any(camera.shift)
        half = camera.extent / 2
        lens, to_world = {"type": "orthographic"}, to_world @ mitsuba.ScalarTransform4f().scale([half, half, 1])
    film = {
        "type": "hdrfilm", "width": width, "height": height, "rfilter": rfilter,
        "pixel_format": "rgb", "component_format": "float32", "sample_border": True,
    }  # fmt: skip
    return lens | {"to_world": to_world, "film": film, "near_clip": 1e-4}


def mitsuba_renders(
    scene: Scene,
    folder: Path,
    *,
    width: int,
    height: int,
    max_depth: int,
    spp: int,
    seeds: int,
    environment: Any = None,
    rfilter: Dictionary | None = None,
) -> np.ndarray:
    """(seeds, H, W, 3): the scene by Mitsuba.

    Args:
        scene: of what Mitsuba has; its environment is left out.
        folder: for files.
        width: of the image.
        height: of the image.
        max_depth: as ours.
        spp: samples per pixel.
        seeds: number of renders.
        environment: a function of directions (..., 3) that gives radiance (..., 3), or None.
        rfilter: Mitsuba's reconstruction filter; the box where None.
    """
    whole: Dictionary = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": max_depth + 1, "rr_depth": 10_000},
    }
    whole["sensor"] = _sensor(scene.camera(), width, height, rfilter or {"type": "box"})
    for k, shape in enumerate(scene.shapes):
        whole[f"shape{k}"] = _shape(shape, folder / f"{k}.ply")
    for k, light in enumerate(scene.lights):
        whole[f"light{k}"] = _light(light)
    if environment is not None:
        rows = 512
        theta = np.pi * np.arange(rows)[:, None] / (rows - 1)
        phi = 2 * np.pi * (np.arange(2 * rows) + 0.5) / (2 * rows)
        image = environment(directions(theta, phi)).astype(np.float32)
        whole["sky"] = {"type": "envmap", "bitmap": mitsuba.Bitmap(image)}
    loaded = mitsuba.load_dict(whole)
    return np.stack([np.array(mitsuba.render(loaded, spp=spp, seed=seed), np.float64) for seed in range(seeds)])


def directions(theta: Any, phi: Any) -> np.ndarray:
    """Unit vectors (..., 3) at the angle theta from +y and phi about it, 0 in our middle column: -z, then +x."""
    theta, phi = np.broadcast_arrays(theta, phi)
    return np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)], -1)
