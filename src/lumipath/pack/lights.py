"""Everything that shines as one table, and how one of them is chosen: alike, by power, or by a tree."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from ..scene import AmbientLight, Cone, Light, Scene, Sphere
from . import layout
from .alias import alias_table
from .geometry import Geometry, is_round, quadric_box
from .light_tree import BOUNDS, build_light_tree
from .materials import MaterialTable, mean_colour
from .punctual import luminance, punctual_lights

# More lights than this are chosen by a random number of their own: what is left of a shared one gets too coarse. It is
# also what `auto` takes for many, from where on a tree is worth its walk.
_FEW_LIGHTS = 64

# Shares of the lights that are near, where there are others too: neither kind is starved.
_TREE_SHARE = (0.1, 0.9)


@frozen(eq=False)
class LightTable:
    """rows (L, 24) float32; emitter_density (P,) float32; environment_probability; features: bits of `layout`.

    Point, spot and directional lights and suns are the rows first_delta .. first_delta + delta_count - 1, and suns the
    sun_count rows from first_sun. Rows from first_infinite on are infinitely far away. The tree is nodes (K, 12)
    float32, parents (K,) int32, emitter_node (P,) int32 and tree_probability.
    """

    rows: NDArray[np.float32]
    emitter_density: NDArray[np.float32]
    environment_probability: float
    features: int
    first_delta: int
    delta_count: int
    first_sun: int
    sun_count: int
    first_infinite: int
    nodes: NDArray[np.float32]
    parents: NDArray[np.int32]
    emitter_node: NDArray[np.int32]
    tree_probability: float


@frozen(eq=False)
class _Surfaces:
    """Emissive triangles or quadrics.

    rows: records without densities; weights, proportional to power; areas, which densities refer to; bounds, for the
    tree.
    """

    rows: NDArray[np.float32]
    weights: NDArray[np.float64]
    areas: NDArray[np.float64]
    bounds: NDArray[np.float64]


def _emission_weights(table: MaterialTable) -> NDArray[np.float64]:
    """Mean luminance of each material's emission; never 0 for one that emits, however blue."""
    means = np.array([mean_colour(material.emission) for material in table.materials], np.float64).reshape(-1, 3)
    return np.maximum(luminance(means), means.max(axis=1, initial=0.0) * 0.01)


def _triangles(geometry: Geometry, emission: NDArray[np.float64]) -> _Surfaces:
    """Emissive triangles."""
    normals, areas = geometry.face_normals()
    corner_materials = geometry.vertex_materials[geometry.faces]
    weights = areas * emission[corner_materials].mean(axis=1) if len(emission) else areas * 0
    # What instances place emits nothing there, whatever its own material: see `arrange`.
    chosen = np.nonzero(weights[: geometry.lone_faces] > 0)[0]
    rows = np.zeros((len(chosen), int(layout.LIGHT_SIZE)), np.float32)
    numbers = rows.view(np.int32)
    corners = geometry.vertices[geometry.faces[chosen]]
    rows[:, 4:7] = corners[:, 0]
    rows[:, 8:11] = corners[:, 1] - corners[:, 0]
    numbers[:, 11] = chosen
    rows[:, 12:15] = corners[:, 2] - corners[:, 0]
    rows[:, 15] = geometry.two_sided[chosen]
    rows[:, 16:19] = normals[chosen]
    numbers[:, 19] = geometry.face_materials[chosen]
    numbers[:, 3] = layout.TRIANGLE_LIGHT
    sides = geometry.two_sided[chosen]
    bounds = np.empty((len(chosen), BOUNDS))
    bounds[:, :3], bounds[:, 3:6], bounds[:, 6:9] = corners.min(axis=1), corners.max(axis=1), normals[chosen]
    bounds[:, 9], bounds[:, 10], bounds[:, 11], bounds[:, 12] = 0, np.pi / 2, weights[chosen], sides
    return _Surfaces(rows, weights[chosen] * (1 + sides), areas[chosen], bounds)


def object_area(shape: Sphere | Cone) -> float:
    """Surface area before the transform."""
    if isinstance(shape, Sphere):
        return 4 * np.pi
    slant = np.hypot(shape.height, shape.bottom_radius - shape.top_radius)
    caps = shape.bottom_radius**2 + shape.top_radius**2 if shape.capped else 0.0
    return float(np.pi * ((shape.bottom_radius + shape.top_radius) * slant + caps))


def _emissive(geometry: Geometry, emission: NDArray[np.float64]) -> list[int]:
    """Numbers of the quadrics that shine."""
    # As for triangles: not those of targets.
    return [k for k, number in enumerate(geometry.quadric_materials[: geometry.lone_quadrics]) if emission[number] > 0]


def _quadrics(geometry: Geometry, emission: NDArray[np.float64]) -> _Surfaces:
    """Emissive quadrics; areas are those before the transform."""
    chosen = _emissive(geometry, emission)
    rows = np.zeros((len(chosen), int(layout.LIGHT_SIZE)), np.float32)
    numbers = rows.view(np.int32)
    weights, areas = np.zeros(len(chosen)), np.zeros(len(chosen))
    bounds = np.empty((len(chosen), BOUNDS))
    for row, k in enumerate(chosen):
        shape = geometry.quadrics[k]
        areas[row] = object_area(shape)
        # Any weight is right; this one is the area where the transform is a similarity.
        scale = abs(np.linalg.det(shape.transform[:3, :3])) ** (2 / 3)
        weights[row] = areas[row] * scale * emission[geometry.quadric_materials[k]]
        rows[row, 4:16] = shape.transform[:3].reshape(-1)
        numbers[row, 16:19] = k, len(geometry.faces) + k, geometry.quadric_materials[k]
        numbers[row, 3] = layout.QUADRIC_LIGHT
        # Light leaves in all directions; seen from anywhere, a convex shape shows about a quarter of its area.
        bounds[row, :6] = quadric_box(shape).reshape(-1)
        bounds[row, 6:] = 0, 0, 1, np.pi, np.pi / 2, weights[row] / 4, 0
    return _Surfaces(rows, weights, areas, bounds)


def _probabilities(weights: NDArray[np.float64], alike: bool) -> NDArray[np.float64]:
    """Of choosing each light: every one keeps a share, so that none is starved by a huge one far away."""
    share = np.full(len(weights), 1.0 / max(len(weights), 1))
    return share if alike else 0.95 * weights / weights.sum() + 0.05 * share


_KINDS = (
    (layout.TRIANGLE_LIGHT, layout.TRIANGLE_LIGHTS),
    (layout.QUADRIC_LIGHT, layout.QUADRIC_LIGHTS),
    (layout.POINT_LIGHT, layout.POINT_LIGHTS),
    (layout.SPOT_LIGHT, layout.SPOT_LIGHTS),
    (layout.DIRECTIONAL_LIGHT, layout.DIRECTIONAL_LIGHTS),
    (layout.SUN_LIGHT, layout.SUNS),
    (layout.ENVIRONMENT_LIGHT, layout.ENVIRONMENT),
)


def collect_lights(
    scene: Scene,
    lights: Sequence[Light],
    geometry: Geometry,
    table: MaterialTable,
    radius: float,
    environment_mean: float,
    sampling: str = "auto",
) -> LightTable:
    """The table of all lights.

    Args:
        scene: for its light groups.
        lights: those without a surface, the sun of a sky among them.
        geometry: with the emissive triangles and quadrics.
        table: materials, for their emission.
        radius: of the scene's bounding sphere, metres.
        environment_mean: mean luminance of the environment over all directions; 0 without one.
        sampling: how one of many is chosen, as in `RenderSettings.light_sampling`.
    """
    emission = _emission_weights(table)
    triangles, quadrics = _triangles(geometry, emission), _quadrics(geometry, emission)
    punctual = punctual_lights(lights, radius, _group_numbers(scene))
    environment = np.zeros((1 if environment_mean > 0 else 0, int(layout.LIGHT_SIZE)), np.float32)
    environment.view(np.int32)[:, 3] = layout.ENVIRONMENT_LIGHT
    groups = light_groups(scene, table)
    for numbers, material in ((triangles.rows.view(np.int32), 19), (quadrics.rows.view(np.int32), 18)):
        numbers[:, layout.LIGHT_GROUP] = groups[1 + numbers[:, material]]
    environment.view(np.int32)[:, layout.LIGHT_GROUP] = groups[0]
    environment_weights = np.full(len(environment), environment_mean * np.pi * max(radius, 1e-9) ** 2)
    rows = np.concatenate([triangles.rows, quadrics.rows, punctual.rows, environment])
    weights = np.concatenate([triangles.weights, quadrics.weights, punctual.weights, environment_weights])
    t, q, primitives = len(triangles.rows), len(quadrics.rows), len(geometry.faces) + len(geometry.quadrics)
    near = t + q + punctual.near
    has_tree = near > 0 and (sampling == "tree" or (sampling == "auto" and near > _FEW_LIGHTS))
    tree_probability = 0.0
    if has_tree:
        share = np.clip(weights[:near].sum() / weights.sum(), *_TREE_SHARE)
        tree_probability = float(share) if len(rows) > near else 1.0
    # Of those in the tree the probability follows from the point that is lit, and is multiplied later.
    first = near if has_tree else 0
    rows[:first, 2] = 1
    if len(rows) > first:
        probabilities = _probabilities(weights[first:], sampling == "uniform")
        rows[first:, 0], other = alias_table(probabilities)
        rows.view(np.int32)[first:, 1] = first + other
        rows[first:, 2] = probabilities * (1 - tree_probability)
    rows[:t, 7] = rows[:t, 2] / triangles.areas
    rows[t : t + q, 19] = rows[t : t + q, 2] / quadrics.areas
    first_sun = len(rows) - len(environment) - punctual.suns
    rows[first_sun : first_sun + punctual.suns, 12] *= rows[first_sun : first_sun + punctual.suns, 2]
    emitters = np.concatenate([rows.view(np.int32)[:t, 11], rows.view(np.int32)[t : t + q, 17]])
    density = np.zeros(primitives, np.float32)
    density[emitters] = np.concatenate([rows[:t, 7], rows[t : t + q, 19]])
    nodes = np.zeros((0, int(layout.LIGHT_NODE_SIZE)), np.float32)
    parents, emitter_node = np.zeros(0, np.int32), np.zeros(0, np.int32)
    if has_tree:
        nodes, parents, leaves = build_light_tree(np.concatenate([triangles.bounds, quadrics.bounds, punctual.bounds]))
        emitter_node = np.full(primitives, -1, np.int32)
        emitter_node[emitters] = leaves[: t + q]
    kinds = rows.view(np.int32)[:, 3]
    features = layout.ROUND_LIGHTS if any(is_round(geometry.quadrics[k]) for k in _emissive(geometry, emission)) else 0
    features |= layout.LIGHT_TREE if has_tree else layout.MANY_LIGHTS if len(rows) > _FEW_LIGHTS else 0
    for kind, bit in _KINDS:
        features |= bit if (kinds == kind).any() else 0
    return LightTable(
        rows,
        density,
        float(rows[-1, 2]) if len(environment) else 0.0,
        features,
        t + q,
        len(punctual.rows),
        first_sun,
        punctual.suns,
        near,
        nodes,
        parents,
        emitter_node,
        tree_probability,
    )


def _group_numbers(scene: Scene) -> dict[str, int]:
    """Numbers of the light groups by name; a group whose lights are all dark has none."""
    return {name: number for number, name in enumerate(scene.light_groups)}


def light_groups(scene: Scene, table: MaterialTable) -> NDArray[np.int32]:
    """(1 + M,) int32: numbers of the groups of the environment and of what each material emits."""
    names = [scene.environment.group if scene.environment else "", *(material.group for material in table.materials)]
    numbers = _group_numbers(scene)
    return np.array([numbers.get(name, 0) for name in names], np.int32)


def ambient_light(scene: Scene) -> NDArray[np.float32]:
    """(4,) float32: the sum of a scene's ambient lights, and a 0."""
    total = np.zeros(4, np.float32)
    for light in scene.lights:
        if isinstance(light, AmbientLight):
            total[:3] += light.colour
    return total


def scene_radius(geometry: Geometry) -> float:
    """Half the diagonal of the box around all shapes, metres; 1 for an empty scene."""
    lower, upper = geometry.world_bounds()
    if not len(lower):
        return 1.0
    diagonal = float(np.linalg.norm(upper.max(axis=0).astype(np.float64) - lower.min(axis=0)))
    return max(diagonal / 2, 1e-12)
