"""Slow intersection in float64, written for clearness; what the engine is held against."""

from __future__ import annotations

from typing import Any

import numpy as np

from lumipath.scene import Sphere


def rotation(rng: np.random.Generator) -> np.ndarray:
    """A random rotation, (4, 4)."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    if np.linalg.det(q) < 0:
        q[:, 0] *= -1
    matrix = np.eye(4)
    matrix[:3, :3] = q
    return matrix


def brute_force(mesh: Any, o: Any, d: Any, culled: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nearest triangle of each ray: distances (N,), faces (N,) or -1, and how clear it is.

    The third result is about how far, across the ray, it passes from the edge of any triangle: rays for which that is
    near the rounding of their coordinates may be decided either way.
    """
    o, d = np.asarray(o, np.float64), np.asarray(d, np.float64)
    a, b, c = (mesh.vertices.astype(np.float64)[mesh.faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    best, face, margin = np.full(len(o), np.inf), np.full(len(o), -1), np.full(len(o), np.inf)
    for k in np.flatnonzero((normal != 0).any(1)):
        slope = d @ normal[k]
        with np.errstate(divide="ignore", invalid="ignore"):
            t = ((a[k] - o) @ normal[k]) / slope
            p = o + t[:, None] * d
            area = normal[k] @ normal[k]
            w = np.cross(c[k] - b[k], p - b[k]) @ normal[k] / area
            v = np.cross(b[k] - a[k], p - a[k]) @ normal[k] / area
            inner = np.minimum(np.minimum(w, v), 1 - w - v)
        hit = (inner >= 0) & (t > 0) & (t < best)
        hit &= slope < 0 if culled else slope != 0
        # Grazing rays amplify their rounding.
        sine = np.abs(slope) / max(np.sqrt(area), 1e-300)
        width = np.sqrt(area) / max(np.linalg.norm(edge) for edge in (b[k] - a[k], c[k] - b[k], a[k] - c[k]))
        margin = np.minimum(margin, np.where(t > 0, np.abs(inner) * width * sine, np.inf))
        best, face = np.where(hit, t, best), np.where(hit, k, face)
    return best, face, margin


def quadric_distances(shape: Any, o: Any, d: Any) -> tuple[np.ndarray, np.ndarray]:
    """Nearest hit of each ray with a quadric, infinity for none, and how clear it is (in object units)."""
    t, _, slack = quadric_hits(shape, o, d)
    return t, slack


def quadric_hits(shape: Any, o: Any, d: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As `quadric_distances`, with the part that is hit: 0 mantle, 1 bottom, 2 top, -1 nothing."""
    inverse = np.linalg.inv(shape.transform)
    o = np.asarray(o, np.float64) @ inverse[:3, :3].T + inverse[:3, 3]
    d = np.asarray(d, np.float64) @ inverse[:3, :3].T
    best, part, slack = np.full(len(o), np.inf), np.full(len(o), -1), np.full(len(o), np.inf)

    def offer(t: np.ndarray, valid: np.ndarray, number: int) -> None:
        nonlocal best, part, slack
        nearer = valid & (t > 0) & (t < best)
        best, part = np.where(nearer, t, best), np.where(nearer, number, part)
        slack = np.minimum(slack, np.where(valid, np.abs(t), np.inf))

    if isinstance(shape, Sphere):
        height = None
        a, b, c = (d * d).sum(1), (o * d).sum(1), (o * o).sum(1) - 1
    else:
        height = shape.height
        slope, intercept = (shape.top_radius - shape.bottom_radius) / height, shape.bottom_radius
        r, s = intercept + slope * o[:, 2], slope * d[:, 2]
        a = d[:, 0] ** 2 + d[:, 1] ** 2 - s * s
        b = o[:, 0] * d[:, 0] + o[:, 1] * d[:, 1] - r * s
        c = o[:, 0] ** 2 + o[:, 1] ** 2 - r * r
    discriminant = b * b - a * c
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(discriminant)
        # Of the two roots the one without cancellation, and the other from their product.
        q = -(b + np.where(b < 0, -root, root))
        for t in (q / a, c / q):
            z = o[:, 2] + t * d[:, 2]
            between = np.isfinite(t) if height is None else (z >= 0) & (z <= height)
            if height is not None:
                slack = np.minimum(slack, np.where(np.isfinite(z), np.minimum(np.abs(z), np.abs(z - height)), np.inf))
            offer(t, (discriminant >= 0) & between, 0)
        # How far the ray passes from grazing.
        slack = np.minimum(slack, np.abs(discriminant) / np.maximum((d * d).sum(1), 1e-300))
        if height is not None and shape.capped:
            for number, z, radius in ((1, 0.0, shape.bottom_radius), (2, height, shape.top_radius)):
                t = (z - o[:, 2]) / d[:, 2]
                rho = np.hypot(o[:, 0] + t * d[:, 0], o[:, 1] + t * d[:, 1])
                slack = np.minimum(slack, np.where(np.isfinite(rho), np.abs(rho - radius), np.inf))
                offer(t, rho <= radius, number)
    return best, part, slack
