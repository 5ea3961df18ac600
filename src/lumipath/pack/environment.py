"""The environment as texels with densities, and the alias tables that draw from them."""

from __future__ import annotations

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from ..scene import Environment
from .alias import alias_table


@frozen(eq=False)
class EnvironmentTable:
    """texels (H * W, 4), rows (H, 2), cells (H * W, 2), frame (12,) float32; width; height; mean luminance."""

    texels: NDArray[np.float32]
    rows: NDArray[np.float32]
    cells: NDArray[np.float32]
    frame: NDArray[np.float32]
    width: int
    height: int
    mean: float


def no_environment() -> EnvironmentTable:
    """Empty tables."""
    return EnvironmentTable(
        np.zeros((0, 4), np.float32),
        np.zeros((0, 2), np.float32),
        np.zeros((0, 2), np.float32),
        np.zeros(12, np.float32),
        1,
        1,
        0.0,
    )


def _tent(values: NDArray[np.float64], axis: int, wraps: bool) -> NDArray[np.float64]:
    """Mean over each texel of the values interpolated between texel centres, along one axis."""
    if wraps:
        before, after = np.roll(values, 1, axis), np.roll(values, -1, axis)
    else:
        before = np.concatenate([values[:1], values[:-1]]) if axis == 0 else values
        after = np.concatenate([values[1:], values[-1:]]) if axis == 0 else values
    return 0.125 * before + 0.75 * values + 0.125 * after


def _pack_alias(weights: NDArray[np.float64]) -> NDArray[np.float32]:
    threshold, other = alias_table(weights)
    table = np.empty((len(weights), 2), np.float32)
    table[:, 0] = threshold
    table.view(np.int32)[:, 1] = other
    return table


def pack_environment(environment: Environment) -> EnvironmentTable:
    """Texels of an environment with the density, per solid angle, of drawing directions in proportion to radiance."""
    image = environment.image.astype(np.float64) * environment.scale
    height, width, _ = image.shape
    luminance = np.maximum(image @ np.array([0.2126, 0.7152, 0.0722]), image.max(axis=2) * 0.01)
    # Radiance is interpolated, so a dark texel beside a bright one is not dark all over.
    luminance = _tent(_tent(luminance, 1, wraps=True), 0, wraps=False)
    theta = (np.arange(height) + 0.5) * np.pi / height
    weights = luminance * np.sin(theta)[:, None]
    total = weights.sum()
    if total <= 0:
        return no_environment()
    texels = np.empty((height * width, 4), np.float32)
    texels[:, :3] = image.reshape(-1, 3)
    # Probability of the texel over its part of the square, over the Jacobian 2 pi^2 sin(theta); the sine comes later.
    texels[:, 3] = (weights / total).reshape(-1) * (width * height) / (2 * np.pi**2)
    cells = np.concatenate([_pack_alias(row) for row in weights])
    rotation = environment.rotation[:3, :3]
    frame = np.zeros((3, 4), np.float32)
    # World to environment; an orthonormal matrix is inverted by its transpose, any other is made orthonormal first.
    u, _, v = np.linalg.svd(rotation)
    frame[:, :3] = (u @ v).T
    solid_angles = np.broadcast_to(np.sin(theta)[:, None], luminance.shape)
    mean = float((luminance * solid_angles).sum() / solid_angles.sum())
    return EnvironmentTable(texels, _pack_alias(weights.sum(axis=1)), cells, frame.reshape(-1), width, height, mean)
