"""A scene and its settings as flat arrays."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from ..errors import LumipathWarning, SceneError
from ..kernels.whitted import MAX_LEVELS
from ..lang import Features, aligned, f32, i32, u32
from ..scene import Camera, Light, Scene
from ..settings import RenderSettings
from . import layout
from .camera import camera_features, lens_numbers, overridden
from .environment import no_environment, pack_environment
from .geometry import Geometry, flatten, vertex_rows
from .layout import PackedScene, View
from .lights import ambient_light, collect_lights, light_groups, scene_radius
from .materials import MaterialTable
from .sky import far_light

# Primitive numbers share a 32-bit word with a flag.
_MAX_PRIMITIVES = 1 << 29
# Links of the GPU's trees have so many bits for them.
_MAX_INSTANCES = 1 << 26
# What blue noise takes for the number of samples where the clock or the noise ends a render, and its longest runs.
_SOME_SAMPLES = 64
_MOST_SAMPLE_BITS = 16


@frozen(eq=False)
class Unmoved:
    """What stays as it is when vertices move, beside the arrays of the packed scene: what it takes to pack it anew.

    table: all materials; features: bits of `layout` of these; lights: those without a surface, the sun of a sky among
    them; environment_mean: luminance; light_sampling: as in `RenderSettings`.
    """

    table: MaterialTable
    features: int
    lights: tuple[Light, ...]
    environment_mean: float
    light_sampling: str


@frozen(eq=False)
class Packed:
    """A packed scene without its tree, and what a tree is built from."""

    scene: PackedScene
    geometry: Geometry
    unmoved: Unmoved

    @property
    def material_names(self) -> tuple[str, ...]:
        """Names of the materials, in the order of their numbers."""
        return tuple(material.name for material in self.unmoved.table.materials)

    @property
    def roots(self) -> NDArray[np.int32]:
        """(I,) int32: where the tree begins that each instance places, in a scene that has had a tree."""
        if self.geometry.instancing is None:
            return np.zeros(0, np.int32)
        return self.scene.instances.view(np.int32)[:, layout.INSTANCE_LINK]

    def with_tree(self, accel: Any, roots: list[int]) -> PackedScene:
        """The scene with a tree that a device walks, in which the trees of targets begin at the nodes `roots`."""
        instancing = self.geometry.instancing
        if instancing is None:
            return self.scene._replace(accel=accel)
        instances = aligned(self.scene.instances)
        instances.view(np.int32)[:, layout.INSTANCE_LINK] = np.array(roots, np.int32)[instancing.targets]
        return self.scene._replace(accel=accel, instances=instances)


def pack_scene(scene: Scene, *, light_sampling: str = "auto", regularize: bool = False) -> Packed:
    """Flatten a scene. The tree is left out: each kind of device has its own.

    Args:
        scene: what to render.
        light_sampling: as in `RenderSettings`; the tree of lights, unlike that of rays, is made here.
        regularize: whether clear glass may grow rough, as the setting of that name wants.

    Raises:
        SceneError: more primitives or materials than can be numbered.
    """
    table = MaterialTable(regularize)
    geometry = flatten(scene, table)
    primitives = len(geometry.faces) + len(geometry.quadrics)
    if primitives >= _MAX_PRIMITIVES:
        raise SceneError(f"{scene.name} has {primitives} primitives; at most {_MAX_PRIMITIVES} are possible")
    if geometry.instancing is not None and len(geometry.instancing.rows) >= _MAX_INSTANCES:
        raise SceneError(
            f"{scene.name} has {len(geometry.instancing.rows)} instances; at most {_MAX_INSTANCES} are possible"
        )
    if primitives == 0:
        warnings.warn(f"{scene.name} has no shapes: only its background is rendered", LumipathWarning, stacklevel=2)
    far, sun = far_light(scene.environment)
    environment = pack_environment(far) if far else no_environment()
    lights = (*scene.lights, *sun)
    table.add_parts()
    bsdfs, bsdf_features = table.bsdf_rows()
    maps, map_features = table.map_rows()
    rows = table.rows()
    phong = table.phong_rows()
    features = table.features() | bsdf_features | map_features
    features |= layout.OPACITY if geometry.holes().any() else 0
    if len(table.materials) > int(layout.MATERIAL_MASK):
        raise SceneError(
            f"{scene.name} has {len(table.materials)} materials; at most {layout.MATERIAL_MASK} are possible"
        )
    media = table.media(rows)
    features |= layout.NESTED if len(media) else 0
    textures, texels, texel_words = table.textures.arrays()
    unmoved = Unmoved(table, features, lights, environment.mean, light_sampling)
    moving = _moving(scene, geometry, unmoved)
    features = moving["features"].mask
    packed = PackedScene(
        **moving,
        accel=None,
        vertex_materials=aligned(
            geometry.vertex_materials if features & layout.BLENDED_MATERIALS else np.zeros(0, np.int32)
        ),
        quadrics=aligned(geometry.quadric_rows),
        instances=aligned(_instance_rows(geometry)),
        materials=aligned(rows),
        phong=aligned(phong),
        bsdfs=aligned(bsdfs),
        maps=aligned(maps if features & layout.MAPS else maps[:0]),
        vertex_colours=aligned(
            geometry.vertex_colours if features & layout.VERTEX_COLOURS else np.zeros((0, 4), np.float32)
        ),
        media=aligned(media),
        energy=aligned(table.energy.rows(features)),
        textures=aligned(textures),
        texels=aligned(texels),
        texel_words=aligned(texel_words),
        ambient=aligned(ambient_light(scene)),
        light_groups=aligned(light_groups(scene, table)),
        group_count=i32(len(scene.light_groups)),
        triangle_count=i32(len(geometry.faces)),
        environment=aligned(environment.texels),
        environment_rows=aligned(environment.rows),
        environment_cells=aligned(environment.cells),
        environment_frame=aligned(environment.frame),
        environment_width=i32(environment.width),
        environment_height=i32(environment.height),
    )
    return Packed(packed, geometry, unmoved)


def repack_scene(scene: Scene, before: PackedScene, unmoved: Unmoved) -> Packed:
    """Flatten a scene again of which only vertices and their normals have moved; the tree of `before` is left in place.

    Args:
        scene: with the same shapes, faces, materials, lights and environment as before.
        before: what it was packed as, perhaps with a tree.
        unmoved: of the same.
    """
    geometry = flatten(scene, unmoved.table)
    return Packed(before._replace(**_moving(scene, geometry, unmoved)), geometry, unmoved)


def _moving(scene: Scene, geometry: Geometry, unmoved: Unmoved) -> dict[str, Any]:
    """The fields of a packed scene that depend on vertices."""
    radius = scene_radius(geometry)
    lights = collect_lights(
        scene, unmoved.lights, geometry, unmoved.table, radius, unmoved.environment_mean, unmoved.light_sampling
    )
    features = geometry.features | unmoved.features | lights.features
    has_vertex_data = bool(features & layout.VERTEX_DATA)
    corners = np.zeros((len(geometry.faces) if has_vertex_data else 0, 4), np.int32)
    if has_vertex_data:
        corners[:, :3] = geometry.faces
    return {
        "features": Features(features),
        "primitives": aligned(_primitive_rows(geometry)),
        "corners": aligned(corners),
        "vertices": aligned(vertex_rows(geometry) if has_vertex_data else np.zeros((0, 8), np.float32)),
        "emitter_density": aligned(
            lights.emitter_density if features & layout.SURFACE_LIGHTS else np.zeros(0, np.float32)
        ),
        "lights": aligned(lights.rows),
        "light_count": i32(len(lights.rows)),
        "first_delta": i32(lights.first_delta),
        "delta_count": i32(lights.delta_count),
        "first_sun": i32(lights.first_sun),
        "sun_count": i32(lights.sun_count),
        "light_nodes": aligned(lights.nodes),
        "light_parents": aligned(lights.parents),
        "emitter_node": aligned(lights.emitter_node),
        "tree_probability": f32(lights.tree_probability),
        "first_infinite": i32(lights.first_infinite),
        "extent": f32(2 * radius),
        "environment_probability": f32(lights.environment_probability),
    }


def _primitive_rows(geometry: Geometry) -> NDArray[np.float32]:
    """(P, 4) float32: the records of all primitives."""
    triangles = len(geometry.faces)
    rows = np.zeros((triangles + len(geometry.quadrics), int(layout.PRIMITIVE_SIZE)), np.float32)
    rows[:triangles, :3] = geometry.face_normals()[0]
    materials = np.concatenate([geometry.face_materials, geometry.quadric_materials]).astype(np.uint32)
    exponents = np.frexp(np.maximum(geometry.reach(), 1e-37))[1].astype(np.uint32) + np.uint32(127)
    holes = geometry.holes().astype(np.uint32) * np.uint32(layout.HAS_HOLES)
    rows.view(np.uint32)[:, 3] = exponents << np.uint32(layout.REACH_SHIFT) | holes | materials
    return rows


def _instance_rows(geometry: Geometry) -> NDArray[np.float32]:
    """(I, 20) float32: the records of all instances."""
    instancing = geometry.instancing
    return np.zeros((0, int(layout.INSTANCE_SIZE)), np.float32) if instancing is None else instancing.rows


_INTEGRATORS = {
    "path": 0,
    "whitted": layout.WHITTED,
    "albedo": layout.ALBEDO,
    "normal": layout.NORMAL,
    "depth": layout.DEPTH,
    "ao": layout.OCCLUSION,
}


# What chooses a light and a point on it.
_ONLY_FOR_LIGHT = layout.ANY_LIGHT | layout.MANY_LIGHTS | layout.LIGHT_TREE | layout.ROUND_LIGHTS
# Only paths carry several media and ask BSDFs; all else sees sums of lobes.
_OF_PATHS = layout.NESTED | layout.BSDFS | layout.PRINCIPLED_PARTS | layout.SCATTERING_DETAILS


def layer_features(scene: int, settings: RenderSettings, camera: Camera) -> int:
    """Feature bits of the pass that fills layers, for a scene whose own bits are `scene`; it samples no lights."""
    surfaces_only = scene & ~_ONLY_FOR_LIGHT | scene & (layout.ENVIRONMENT | layout.SUNS)
    # Means over the positive part of a filter only: no albedo beyond 1, no depth by a division by almost 0.
    mask = surfaces_only | layout.LAYERS | camera_features(settings, camera, signed=False)
    # What is rough is not looked through; whatever kind it is of.
    mask = mask & ~_OF_PATHS | (layout.CONDUCTORS if mask & layout.MICROFACETS else 0)
    return mask | (layout.SCHLICK_FRESNEL if settings.fresnel == "schlick" else 0)


# Parts of the light of a pixel, each of which is rendered with the others.
_PARTS = ("emission", "direct", "indirect")


def _film_layer_features(settings: RenderSettings) -> int:
    """Feature bits of the layers that every sample adds to."""
    mask = layout.VARIANCE if "variance" in settings.aov else 0
    if settings.integrator == "path":
        mask |= layout.PARTS if any(name in settings.aov for name in _PARTS) else 0
        mask |= layout.GROUPS if "light_groups" in settings.aov else 0
    return mask


def film_layers(settings: RenderSettings, scene: Scene) -> tuple[str, ...]:
    """Names of the layers in `FilmArrays.parts`, in their order."""
    mask = _film_layer_features(settings)
    names: tuple[str, ...] = _PARTS if mask & layout.PARTS else ()
    names += tuple(f"light_{group}" for group in scene.light_groups) if mask & layout.GROUPS else ()
    return (*names, "variance") if mask & layout.VARIANCE else names


def image_features(scene: int, settings: RenderSettings, camera: Camera) -> int:
    """Feature bits of a render of a scene whose own bits are `scene`."""
    mask = scene | settings_features(settings, camera)
    return mask & ~_OF_PATHS if mask & layout.PIXEL_INTEGRATORS else mask


def settings_features(settings: RenderSettings, camera: Camera) -> int:
    """Feature bits of the settings."""
    shows_light = settings.integrator in ("path", "whitted")
    mask = _INTEGRATORS[settings.integrator] | camera_features(settings, camera, signed=shows_light)
    mask |= layout.ADAPTIVE if settings.noise is not None else 0
    mask |= _film_layer_features(settings)
    if mask & layout.PIXEL_INTEGRATORS:
        return mask
    mask |= layout.UNIFORM_HEMISPHERE if settings.hemisphere == "uniform" else 0
    mask |= layout.SCHLICK_FRESNEL if settings.fresnel == "schlick" else 0
    mask |= layout.CLAMP_INDIRECT if settings.clamp_indirect is not None else 0
    mask |= layout.REGULARIZE if settings.regularize else 0
    mask |= layout.ROULETTE if settings.rr_depth is not None and settings.rr_depth < settings.max_depth else 0
    return mask


def _sample_bits(settings: RenderSettings) -> int:
    """How many samples of a pixel belong together, as a power of two: all that are wanted; many if nobody knows."""
    return min(((settings.total_samples or _SOME_SAMPLES) - 1).bit_length(), _MOST_SAMPLE_BITS)


def pack_view(camera: Camera, settings: RenderSettings) -> View:
    """Camera, film and limits.

    Raises:
        UsageError: the crop or the pixel to focus on lies outside the image, or the image is too large.
    """
    camera = overridden(camera, settings)
    width, height = settings.size(camera.image_aspect)
    left, top, right, bottom = settings.crop_of(width, height)
    settings.check_focus_on(width, height)
    max_depth = settings.max_depth
    if settings.integrator == "whitted" and max_depth > MAX_LEVELS:
        max_depth = int(MAX_LEVELS)
        message = f"max_depth is {settings.max_depth}: the integrator whitted stops at {MAX_LEVELS}"
        warnings.warn(message, LumipathWarning, stacklevel=2)
    return View(
        lens=aligned(lens_numbers(camera, settings, width, height)),
        width=i32(width),
        height=i32(height),
        left=i32(left),
        top=i32(top),
        film_width=i32(right - left),
        film_height=i32(bottom - top),
        seed=u32(settings.seed),
        first_sample=u32(settings.first_sample),
        sample_bits=u32(_sample_bits(settings)),
        max_depth=i32(max_depth),
        rr_depth=i32(settings.rr_depth if settings.rr_depth is not None else 1 << 30),
        ao_distance=f32(settings.ao_distance or 0.0),
        clamp_indirect=f32(settings.clamp_indirect or 0.0),
    )
