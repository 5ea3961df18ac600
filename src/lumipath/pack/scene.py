"""A scene and its settings as flat arrays."""

from __future__ import annotations

import math
import warnings

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from ..errors import LumipathWarning, SceneError
from ..kernels.whitted import MAX_LEVELS
from ..lang import Features, aligned, f32, i32, u32
from ..scene import Camera, Scene
from ..settings import RenderSettings
from . import layout
from .environment import no_environment, pack_environment
from .geometry import Geometry, flatten, vertex_rows
from .layout import PackedScene, View
from .lights import ambient_light, collect_lights, scene_radius
from .materials import MaterialTable
from .sky import far_light

# Primitive numbers share a 32-bit word with a flag.
_MAX_PRIMITIVES = 1 << 29


@frozen(eq=False)
class Packed:
    """A packed scene without its tree, and what a tree is built from."""

    scene: PackedScene
    geometry: Geometry
    material_names: tuple[str, ...]


def pack_scene(scene: Scene, light_sampling: str = "auto") -> Packed:
    """Flatten a scene. The tree is left out: each kind of device has its own.

    Args:
        scene: to flatten.
        light_sampling: as in `RenderSettings`; the tree of lights, unlike that of rays, is made here.

    Raises:
        SceneError: more primitives or materials than can be numbered.
    """
    table = MaterialTable()
    geometry = flatten(scene, table)
    primitives = len(geometry.faces) + len(geometry.quadrics)
    if primitives >= _MAX_PRIMITIVES:
        raise SceneError(f"{scene.name} has {primitives} primitives; at most {_MAX_PRIMITIVES} are possible")
    if primitives == 0:
        warnings.warn(f"{scene.name} has no shapes: only its background is rendered", LumipathWarning, stacklevel=2)
    far, sun = far_light(scene.environment)
    environment = pack_environment(far) if far else no_environment()
    radius = scene_radius(geometry)
    lights = collect_lights([*scene.lights, *sun], geometry, table, radius, environment.mean, light_sampling)
    features = geometry.features | table.features() | lights.features
    if len(table.materials) > int(layout.MATERIAL_MASK):
        raise SceneError(
            f"{scene.name} has {len(table.materials)} materials; at most {layout.MATERIAL_MASK} are possible"
        )
    rows = table.rows()
    phong = table.phong_rows()
    textures, texels = table.textures()
    has_vertex_data = bool(features & layout.VERTEX_DATA)
    corners = np.zeros((len(geometry.faces) if has_vertex_data else 0, 4), np.int32)
    if has_vertex_data:
        corners[:, :3] = geometry.faces
    packed = PackedScene(
        features=Features(features),
        accel=None,
        primitives=aligned(_primitive_rows(geometry)),
        corners=aligned(corners),
        vertices=aligned(vertex_rows(geometry) if has_vertex_data else np.zeros((0, 8), np.float32)),
        vertex_materials=aligned(
            geometry.vertex_materials if features & layout.BLENDED_MATERIALS else np.zeros(0, np.int32)
        ),
        emitter_density=aligned(
            lights.emitter_density if features & layout.SURFACE_LIGHTS else np.zeros(0, np.float32)
        ),
        quadrics=aligned(geometry.quadric_rows),
        materials=aligned(rows),
        phong=aligned(phong),
        textures=aligned(textures),
        texels=aligned(texels),
        lights=aligned(lights.rows),
        light_count=i32(len(lights.rows)),
        first_delta=i32(lights.first_delta),
        delta_count=i32(lights.delta_count),
        first_sun=i32(lights.first_sun),
        sun_count=i32(lights.sun_count),
        light_nodes=aligned(lights.nodes),
        light_parents=aligned(lights.parents),
        emitter_node=aligned(lights.emitter_node),
        tree_probability=f32(lights.tree_probability),
        first_infinite=i32(lights.first_infinite),
        ambient=aligned(ambient_light(scene)),
        extent=f32(2 * radius),
        triangle_count=i32(len(geometry.faces)),
        environment=aligned(environment.texels),
        environment_rows=aligned(environment.rows),
        environment_cells=aligned(environment.cells),
        environment_frame=aligned(environment.frame),
        environment_width=i32(environment.width),
        environment_height=i32(environment.height),
        environment_probability=f32(lights.environment_probability),
    )
    return Packed(packed, geometry, tuple(material.name for material in table.materials))


def _primitive_rows(geometry: Geometry) -> NDArray[np.float32]:
    """(P, 4) float32: the records of all primitives."""
    triangles = len(geometry.faces)
    rows = np.zeros((triangles + len(geometry.quadrics), int(layout.PRIMITIVE_SIZE)), np.float32)
    rows[:triangles, :3] = geometry.face_normals()[0]
    materials = np.concatenate([geometry.face_materials, geometry.quadric_materials]).astype(np.uint32)
    exponents = np.frexp(np.maximum(geometry.reach(), 1e-37))[1].astype(np.uint32) + np.uint32(127)
    rows.view(np.uint32)[:, 3] = exponents << np.uint32(layout.REACH_SHIFT) | materials
    return rows


_INTEGRATORS = {
    "path": 0,
    "whitted": layout.WHITTED,
    "albedo": layout.ALBEDO,
    "normal": layout.NORMAL,
    "depth": layout.DEPTH,
    "ao": layout.OCCLUSION,
}


def _camera_features(settings: RenderSettings, camera: Camera) -> int:
    """Feature bits of camera rays."""
    mask = layout.INDEPENDENT_SAMPLER if settings.sampler == "independent" else 0
    aperture = camera.aperture if settings.aperture is None else settings.aperture
    blades = camera.blades if settings.blades is None else settings.blades
    mask |= layout.LENS if aperture > 0 else 0
    mask |= layout.BLADES if aperture > 0 and blades > 0 else 0
    return mask


# What chooses a light and a point on it.
_ONLY_FOR_LIGHT = layout.ANY_LIGHT | layout.MANY_LIGHTS | layout.LIGHT_TREE | layout.ROUND_LIGHTS


def layer_features(scene: int, settings: RenderSettings, camera: Camera) -> int:
    """Feature bits of the pass that fills layers, for a scene whose own bits are `scene`; it looks at no lights."""
    mask = scene & ~_ONLY_FOR_LIGHT | layout.LAYERS | _camera_features(settings, camera)
    return mask | (layout.SCHLICK_FRESNEL if settings.fresnel == "schlick" else 0)


def settings_features(settings: RenderSettings, camera: Camera) -> int:
    """Feature bits of the settings."""
    mask = _INTEGRATORS[settings.integrator] | _camera_features(settings, camera)
    mask |= layout.ADAPTIVE if settings.noise is not None else 0
    if mask & layout.PIXEL_INTEGRATORS:
        return mask
    mask |= layout.UNIFORM_HEMISPHERE if settings.hemisphere == "uniform" else 0
    mask |= layout.SCHLICK_FRESNEL if settings.fresnel == "schlick" else 0
    mask |= layout.ROULETTE if settings.rr_depth is not None and settings.rr_depth < settings.max_depth else 0
    return mask


def pack_view(camera: Camera, settings: RenderSettings) -> View:
    """Camera, film and limits.

    Raises:
        UsageError: the crop or the pixel to focus on lies outside the image, or the image is too large.
    """
    width, height = settings.size(camera.aspect)
    left, top, right, bottom = settings.crop_of(width, height)
    settings.check_focus_on(width, height)
    axes = camera.axes()
    max_depth = settings.max_depth
    if settings.integrator == "whitted" and max_depth > MAX_LEVELS:
        max_depth = int(MAX_LEVELS)
        message = f"max_depth is {settings.max_depth}: the integrator whitted stops at {MAX_LEVELS}"
        warnings.warn(message, LumipathWarning, stacklevel=2)
    half_height = math.tan(math.radians(camera.fov) / 2)
    lens = np.zeros((5, 4), np.float32)
    lens[0, :3] = camera.position
    lens[1:4, :3] = axes
    lens[0, 3] = camera.aperture if settings.aperture is None else settings.aperture
    lens[1, 3] = camera.focus if settings.focus is None else settings.focus
    lens[2, 3] = half_height
    # The shape of the pixels follows the image, so that nothing is distorted.
    lens[3, 3] = half_height * width / height
    lens[4, 0] = camera.blades if settings.blades is None else settings.blades
    rotation = camera.blade_rotation if settings.blade_rotation is None else settings.blade_rotation
    # The first corner points up, a quarter turn from the right.
    lens[4, 1] = (rotation / 360 + 0.25) % 1.0
    return View(
        lens=aligned(lens.reshape(-1)),
        width=i32(width),
        height=i32(height),
        left=i32(left),
        top=i32(top),
        film_width=i32(right - left),
        film_height=i32(bottom - top),
        seed=u32(settings.seed),
        first_sample=u32(settings.first_sample),
        max_depth=i32(max_depth),
        rr_depth=i32(settings.rr_depth if settings.rr_depth is not None else 1 << 30),
        ao_distance=f32(settings.ao_distance or 0.0),
    )
