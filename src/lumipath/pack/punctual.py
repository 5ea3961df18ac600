"""Records of lights without a surface."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from ..scene import DirectionalLight, Light, PointLight, SpotLight
from ..scene.material import is_positive
from . import layout
from .light_tree import BOUNDS


@frozen(eq=False)
class PunctualTable:
    """Points, spots, directional lights and suns, in this order.

    rows (N, 24) float32; weights (N,), proportional to power; bounds (N, BOUNDS), for the tree, of those that are near;
    near: how many those are; suns: how many of the last are suns.
    """

    rows: NDArray[np.float32]
    weights: NDArray[np.float64]
    bounds: NDArray[np.float64]
    near: int
    suns: int


def luminance(colours: NDArray[np.float64]) -> NDArray[np.float64]:
    """Luminance of linear Rec.709 colours, (..., 3)."""
    return np.asarray(colours, np.float64) @ np.array([0.2126, 0.7152, 0.0722])


def _row(kind: np.int32) -> NDArray[np.float32]:
    row = np.zeros(int(layout.LIGHT_SIZE), np.float32)
    row.view(np.int32)[3] = kind
    return row


def _point_bounds(position: Sequence[float], intensity: float, axis: Sequence[float], normals: float, exit_: float):
    return np.array([*position, *position, *axis, normals, exit_, max(intensity, 1e-30), 0.0])


def _point(light: PointLight, radius: float) -> tuple[NDArray, float, NDArray]:
    """A point light by the formula of the .ray language: record, weight, bounds."""
    row = _row(layout.POINT_LIGHT)
    row[4:7], row[8:11], row[12:15] = light.position, light.colour, light.attenuation
    a, b, c = light.attenuation
    falloff = min(1.0, 1.0 / max(a + b * radius + c * radius * radius, 1e-30))
    # What its intensity would be, judged by its light at the far end of the scene.
    intensity = float(luminance(np.array(light.colour)) * falloff * np.pi * radius**2)
    return row, intensity, _point_bounds(light.position, intensity, (0, 0, 1), np.pi, np.pi / 2)


def _spot(light: SpotLight | PointLight) -> tuple[NDArray, float, NDArray]:
    """A spot light, or a point light of an intensity: record, weight, bounds."""
    row = _row(layout.SPOT_LIGHT)
    row[4:7], row[8:11] = light.position, light.intensity
    intensity = float(luminance(np.array(light.intensity)))
    if isinstance(light, PointLight):
        # An edge that no direction reaches.
        row[7], row[11], row[12:15] = 4, 1, (0, 0, 1)
        return row, intensity, _point_bounds(light.position, intensity, (0, 0, 1), np.pi, np.pi / 2)
    inner, outer = np.radians(light.inner_angle), np.radians(light.outer_angle)
    # 1 - cosine, by the half angle, since cosines of small angles have no digits left.
    inside, edge = 2 * np.sin(inner / 2) ** 2, 2 * np.sin(outer / 2) ** 2
    row[7], row[11], row[12:15] = edge, 1 / max(edge - inside, 1e-6 * edge), light.direction
    normals = max(inner, outer - np.pi / 2)
    bounds = _point_bounds(light.position, intensity, light.direction, normals, min(outer - normals, np.pi / 2))
    return row, intensity * (inside + edge) / 4, bounds


def _distant(light: DirectionalLight, radius: float) -> tuple[NDArray, float]:
    """A directional light or a sun, its density still without its probability: record, weight."""
    row = _row(layout.SUN_LIGHT if light.angle > 0 else layout.DIRECTIONAL_LIGHT)
    row[4:7], row[8:11] = -np.array(light.direction), light.colour
    if light.angle > 0:
        half = np.radians(light.angle) / 2
        row[7] = 4 * np.sin(half / 2) ** 2
        # The irradiance of a surface that faces a disc of radiance L is pi L sin^2; it is to be pi times the colour.
        row[11] = 1 / np.sin(half) ** 2
        row[12] = 1 / (np.pi * row[7])
    return row, float(luminance(np.array(light.colour)) * np.pi * radius**2)


def _shines(light: Light) -> bool:
    if isinstance(light, SpotLight):
        return is_positive(light.intensity)
    if isinstance(light, PointLight):
        return is_positive(light.colour if light.intensity is None else light.intensity)
    return isinstance(light, DirectionalLight) and is_positive(light.colour)


def punctual_lights(lights: Sequence[Light], radius: float, groups: Mapping[str, int]) -> PunctualTable:
    """Records of all lights without a surface that shine.

    Args:
        lights: of the scene; ambient ones are left out.
        radius: of the scene's bounding sphere, metres.
        groups: numbers of the light groups by name.
    """
    shining = [light for light in lights if _shines(light)]
    points = [light for light in shining if isinstance(light, PointLight) and light.intensity is None]
    spots = [
        light
        for light in shining
        if isinstance(light, SpotLight) or (isinstance(light, PointLight) and light.intensity is not None)
    ]
    distant = [light for light in shining if isinstance(light, DirectionalLight)]
    near = [_point(light, radius) for light in points] + [_spot(light) for light in spots]
    distant.sort(key=lambda light: light.angle > 0)
    far = [_distant(light, radius) for light in distant]
    rows = np.array([row for row, *_ in [*near, *far]], np.float32).reshape(-1, int(layout.LIGHT_SIZE))
    rows.view(np.int32)[:, layout.LIGHT_GROUP] = [groups.get(light.group, 0) for light in [*points, *spots, *distant]]
    weights = np.array([found[1] for found in [*near, *far]])
    return PunctualTable(
        rows,
        np.maximum(weights, 1e-30),
        np.array([bounds for *_, bounds in near]).reshape(-1, BOUNDS),
        len(near),
        sum(light.angle > 0 for light in distant),
    )
