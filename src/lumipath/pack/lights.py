"""Everything that shines as one table, drawn from in proportion to power."""

from __future__ import annotations

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from ..scene import AmbientLight, Cone, DirectionalLight, PointLight, Scene, Sphere
from ..scene.material import is_positive
from . import layout
from .alias import alias_table
from .geometry import Geometry
from .materials import MaterialTable, mean_colour

# More lights than this are chosen by a random number of their own: what is left of a shared one gets too coarse.
_FEW_LIGHTS = 64


@frozen(eq=False)
class LightTable:
    """rows (L, 24) float32; emitter_density (P,) float32; environment_probability; features: bits of `layout`.

    Point and directional lights are the rows first_delta .. first_delta + delta_count - 1.
    """

    rows: NDArray[np.float32]
    emitter_density: NDArray[np.float32]
    environment_probability: float
    features: int
    first_delta: int
    delta_count: int


def _luminance(colours: NDArray[np.float64]) -> NDArray[np.float64]:
    return colours @ np.array([0.2126, 0.7152, 0.0722])


def _emission_weights(table: MaterialTable) -> NDArray[np.float64]:
    """Mean luminance of each material's emission; never 0 for one that emits, however blue."""
    means = np.array([mean_colour(material.emission) for material in table.materials], np.float64).reshape(-1, 3)
    return np.maximum(_luminance(means), means.max(axis=1, initial=0.0) * 0.01)


def _triangle_rows(geometry: Geometry, emission: NDArray[np.float64]) -> tuple[NDArray, NDArray, NDArray]:
    """Emissive triangles: records without their densities, weights, areas."""
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
    return rows, weights[chosen] * (1 + geometry.two_sided[chosen]), areas[chosen]


def object_area(shape: Sphere | Cone) -> float:
    """Surface area before the transform."""
    if isinstance(shape, Sphere):
        return 4 * np.pi
    slant = np.hypot(shape.height, shape.bottom_radius - shape.top_radius)
    caps = shape.bottom_radius**2 + shape.top_radius**2 if shape.capped else 0.0
    return float(np.pi * ((shape.bottom_radius + shape.top_radius) * slant + caps))


def _quadric_rows(geometry: Geometry, emission: NDArray[np.float64]) -> tuple[NDArray, NDArray, NDArray]:
    """Emissive quadrics: records without their densities, weights, object areas."""
    lone = geometry.quadric_materials[: geometry.lone_quadrics]
    chosen = [k for k, number in enumerate(lone) if emission[number] > 0]
    rows = np.zeros((len(chosen), int(layout.LIGHT_SIZE)), np.float32)
    numbers = rows.view(np.int32)
    weights, areas = np.zeros(len(chosen)), np.zeros(len(chosen))
    for row, k in enumerate(chosen):
        shape = geometry.quadrics[k]
        areas[row] = object_area(shape)
        # Any weight is right; this one is the area where the transform is a similarity.
        scale = abs(np.linalg.det(shape.transform[:3, :3])) ** (2 / 3)
        weights[row] = areas[row] * scale * emission[geometry.quadric_materials[k]]
        rows[row, 4:16] = shape.transform[:3].reshape(-1)
        numbers[row, 16:19] = k, len(geometry.faces) + k, geometry.quadric_materials[k]
        numbers[row, 3] = layout.QUADRIC_LIGHT
    return rows, weights, areas


def _delta_rows(scene: Scene, radius: float) -> tuple[NDArray, NDArray]:
    """Point and directional lights: records and weights."""
    rows, weights, groups = [], [], _group_numbers(scene)
    for light in scene.lights:
        row = np.zeros(int(layout.LIGHT_SIZE), np.float32)
        if isinstance(light, PointLight) and is_positive(light.colour):
            row.view(np.int32)[3] = layout.POINT_LIGHT
            row[4:7], row[8:11], row[12:15] = light.position, light.colour, light.attenuation
            a, b, c = light.attenuation
            falloff = min(1.0, 1.0 / max(a + b * radius + c * radius * radius, 1e-30))
            weights.append(_luminance(np.array(light.colour)) * falloff * np.pi * radius**2)
        elif isinstance(light, DirectionalLight) and is_positive(light.colour):
            row.view(np.int32)[3] = layout.DIRECTIONAL_LIGHT
            row[4:7], row[8:11] = -np.array(light.direction), light.colour
            weights.append(_luminance(np.array(light.colour)) * np.pi * radius**2)
        else:
            continue
        row.view(np.int32)[layout.LIGHT_GROUP] = groups.get(light.group, 0)
        rows.append(row)
    return np.array(rows, np.float32).reshape(-1, int(layout.LIGHT_SIZE)), np.maximum(np.array(weights), 1e-30)


def collect_lights(
    scene: Scene, geometry: Geometry, table: MaterialTable, radius: float, environment_mean: float
) -> LightTable:
    """The table of all lights.

    Args:
        scene: for its point and directional lights.
        geometry: with the emissive triangles and quadrics.
        table: materials, for their emission.
        radius: of the scene's bounding sphere, metres.
        environment_mean: mean luminance of the environment over all directions; 0 without one.
    """
    emission = _emission_weights(table)
    triangles, triangle_weights, areas = _triangle_rows(geometry, emission)
    quadrics, quadric_weights, object_areas = _quadric_rows(geometry, emission)
    deltas, delta_weights = _delta_rows(scene, radius)
    environment = np.zeros((1 if environment_mean > 0 else 0, int(layout.LIGHT_SIZE)), np.float32)
    environment.view(np.int32)[:, 3] = layout.ENVIRONMENT_LIGHT
    groups = light_groups(scene, table)
    for numbers, material in ((triangles.view(np.int32), 19), (quadrics.view(np.int32), 18)):
        numbers[:, layout.LIGHT_GROUP] = groups[1 + numbers[:, material]]
    environment.view(np.int32)[:, layout.LIGHT_GROUP] = groups[0]
    environment_weights = np.full(len(environment), environment_mean * np.pi * max(radius, 1e-9) ** 2)
    rows = np.concatenate([triangles, quadrics, deltas, environment])
    weights = np.concatenate([triangle_weights, quadric_weights, delta_weights, environment_weights])
    density = np.zeros(len(geometry.faces) + len(geometry.quadrics), np.float32)
    probabilities = np.zeros(0)
    if len(rows):
        # Every light keeps a share, so that none is starved by a huge one far away.
        probabilities = 0.95 * weights / weights.sum() + 0.05 / len(weights)
        rows[:, 0], rows.view(np.int32)[:, 1] = alias_table(probabilities)
        rows[:, 2] = probabilities
        t, q = len(triangles), len(quadrics)
        rows[:t, 7] = probabilities[:t] / areas
        rows[t : t + q, 19] = probabilities[t : t + q] / object_areas
        density[triangles.view(np.int32)[:, 11]] = rows[:t, 7]
        density[quadrics.view(np.int32)[:, 17]] = rows[t : t + q, 19]
    kinds = rows.view(np.int32)[:, 3]
    features = layout.MANY_LIGHTS if len(rows) > _FEW_LIGHTS else 0
    for kind, bit in (
        (layout.TRIANGLE_LIGHT, layout.TRIANGLE_LIGHTS),
        (layout.QUADRIC_LIGHT, layout.QUADRIC_LIGHTS),
        (layout.POINT_LIGHT, layout.POINT_LIGHTS),
        (layout.DIRECTIONAL_LIGHT, layout.DIRECTIONAL_LIGHTS),
        (layout.ENVIRONMENT_LIGHT, layout.ENVIRONMENT),
    ):
        if (kinds == kind).any():
            features |= bit
    probability = float(probabilities[-1]) if len(environment) else 0.0
    return LightTable(rows, density, probability, features, len(triangles) + len(quadrics), len(deltas))


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
