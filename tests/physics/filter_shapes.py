"""Pixel filters as formulas, for tests: functions of the distance x from the middle along one axis, in pixels."""

from __future__ import annotations

import numpy as np
from scipy import integrate


def gaussian(x, radius=1.5):
    """A standard deviation of a third of the radius, lowered to 0 at the radius."""
    sigma = radius / 3
    return np.exp(-((x / sigma) ** 2) / 2) - np.exp(-((radius / sigma) ** 2) / 2)


def blackman_harris(x, radius=1.5):
    """The window of four terms over -radius to radius; in its usual form it begins at 0."""
    t = 2 * np.pi * (x / radius + 1) / 2
    return 0.35875 - 0.48829 * np.cos(t) + 0.14128 * np.cos(2 * t) - 0.01168 * np.cos(3 * t)


def mitchell(x, radius=2.0, b=1 / 3, c=1 / 3):
    """Equation 8 of Mitchell and Netravali 1988."""
    x = np.abs(x) * 2 / radius
    near = (12 - 9 * b - 6 * c) * x**3 + (-18 + 12 * b + 6 * c) * x**2 + (6 - 2 * b)
    far = (-b - 6 * c) * x**3 + (6 * b + 30 * c) * x**2 + (-12 * b - 48 * c) * x + (8 * b + 24 * c)
    return np.where(x < 1, near, far) / 6


def box(x, radius=0.5):
    """Even."""
    return np.ones_like(x)


SHAPES = {"box": box, "gaussian": gaussian, "blackman-harris": blackman_harris, "mitchell": mitchell}
RADII = {"box": 0.5, "gaussian": 1.5, "blackman-harris": 1.5, "mitchell": 2.0}


def cumulated(name, radius=None, steps=20_001):
    """Distances from -radius to radius, and the integral of the filter up to there, 1 at the end."""
    radius = RADII[name] if radius is None else radius
    x = np.linspace(-radius, radius, steps)
    total = integrate.cumulative_simpson(SHAPES[name](x, radius), x=x, initial=0)
    return x, total / total[-1]
