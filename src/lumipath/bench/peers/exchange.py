"""A scene as plain arrays in a file, which any renderer's script can read without lumipath."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import UsageError
from ...scene import Material, Mesh, Scene
from ...scene.bsdfs import Diffuse
from ...scene.material import is_positive
from ...settings import RenderSettings


def write_exchange(path: Path, scene: Scene, settings: RenderSettings) -> None:
    """Write a scene of matt meshes and lamps, its camera and the limits of the render, as an NPZ file.

    Of mesh number k: `vertices_k` (V, 3) float32, `faces_k` (F, 3) int32, `albedo_k` and `emission_k` (3,).
    `camera` (4, 3): position, right, up, backward; `fov` vertical in degrees; `size`: width, height; `max_depth`;
    `threads`, 0 for all.

    Raises:
        UsageError: the scene has something that not every renderer is told in the same way.
    """
    camera = scene.camera(settings.camera)
    _require(scene.environment is None and not scene.lights, scene, "lights that are not surfaces")
    _require(camera.aperture == 0 and not settings.aperture, scene, "a lens")
    width, height = settings.size(camera.aspect)
    arrays: dict[str, object] = {}
    for k, shape in enumerate(scene.shapes):
        _require(isinstance(shape, Mesh), scene, "shapes that are not meshes")
        assert isinstance(shape, Mesh)
        material = shape.material
        _require(shape.normals is None and shape.vertex_materials is None, scene, "smooth or blended meshes")
        if isinstance(material, Material):
            others = (material.specular, material.reflective, material.transmissive)
            _require(not any(is_positive(value) for value in others), scene, "mirrors or glass")
            albedo = material.diffuse
        else:
            _require(isinstance(material, Diffuse) and material.is_plain, scene, "materials that are not matt")
            assert isinstance(material, Diffuse)
            albedo = material.reflectance
        emission = material.emission
        _require(isinstance(albedo, tuple) and isinstance(emission, tuple), scene, "textures")
        arrays |= {f"vertices_{k}": shape.vertices, f"faces_{k}": shape.faces}
        arrays |= {f"albedo_{k}": np.array(albedo), f"emission_{k}": np.array(emission)}
    np.savez(
        path,
        camera=np.array([camera.position, *camera.axes()]),
        fov=camera.fov,
        size=np.array([width, height]),
        max_depth=settings.max_depth,
        threads=settings.threads or 0,
        **arrays,  # type: ignore[arg-type]
    )


def _require(held: bool, scene: Scene, what: str) -> None:
    if not held:
        raise UsageError(f"{scene.name} has {what}; only scenes of matt meshes and lamps can be compared")
