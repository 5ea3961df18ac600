"""Tables of what rough surfaces reflect of white light, integrated with the kernels when a scene needs them."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from ..kernels.energy import GREATEST_ROUGHNESS, LEAST_ALPHA, LEAST_SHEEN_ALPHA, table_cosine
from ..kernels.fresnel import exact_fresnel, refracted_cosine, schlick_weight
from ..kernels.microfacet import ggx_visible_normal, reflected, refracted, visible_weight
from ..kernels.vectors import dot
from ..lang import Vec3, compiled, f32
from . import layout

SIDE = int(layout.ENERGY_SIDE)
# Points on the sides of the square of random numbers; by symmetry one half of the azimuth is enough.
_POINTS, _TURNS = 48, 24
# The same for directions of light upon fibres.
_FIBRE_POINTS = 48


class EnergyTables:
    """Collects the tables that a scene needs."""

    def __init__(self) -> None:
        self._indices: list[float] = []

    def number(self, index: float) -> int:
        """Number of the table of facets of that index of refraction, seen from outside; the next is from inside."""
        if index not in self._indices:
            self._indices.append(index)
        return int(layout.ENERGY_INDICES) + 2 * self._indices.index(index)

    def rows(self, features: int) -> NDArray[np.float32]:
        """(E, 1056) float32, in the order of their numbers; none for a scene without `layout.MICROFACETS`."""
        if not features & layout.MICROFACETS:
            return np.zeros((0, int(layout.ENERGY_TABLE)), np.float32)
        refracting = (_refracting(eta) for index in self._indices for eta in (index, 1 / index))
        return np.stack([*_reflecting(), *refracting])


@cache
def _reflecting() -> list[NDArray[np.float32]]:
    """The tables of white facets, of those that reflect Schlick's weight beyond what smooth ones do, and of sheen."""
    cosines, alphas = _axes()
    found = np.zeros((2, SIDE, SIDE))
    _integrate_reflection(cosines, alphas, found)
    everything, edge = (_with_means(cosines, table) for table in found)
    edge[SIDE * SIDE :] = _edge_means(found, alphas)
    return [everything, edge, _sheen()]


def _edge_means(found: NDArray[np.float64], alphas: NDArray[np.float32]) -> NDArray[np.float64]:
    """(32,): means over the hemisphere of what facets reflect that reflect Schlick's weight."""
    mu = (np.arange(1024) + 0.5) / 1024
    # The inverse of `table_cosine`.
    columns = np.arange(SIDE) / (SIDE - 1)
    places = mu * (1 + alphas[:, None]) / (mu + alphas[:, None])
    everything, beyond = (
        np.stack([np.interp(place, columns, row) for place, row in zip(places, table)]) for table in found
    )
    weighted: NDArray[np.float64] = ((beyond + everything * (1 - mu) ** 5) * 2 * mu).mean(axis=1)
    return weighted


def _sheen() -> NDArray[np.float32]:
    """(1056,): what white fibres reflect (`kernels.bsdf.coats.fibres`), which for flat ones is more than arrives."""
    places = np.arange(SIDE) / (SIDE - 1)
    cosines = np.maximum(places, 2e-3) ** 2
    alphas = np.maximum(places**2, LEAST_SHEEN_ALPHA)
    # Directions of light: dense where they graze.
    side = np.arange(_FIBRE_POINTS) + 0.5
    cosine = ((side / _FIBRE_POINTS) ** 2)[:, None]
    area = (2 * side / _FIBRE_POINTS**2)[:, None] * (2 * np.pi / _FIBRE_POINTS)
    turn = np.pi * side / _FIBRE_POINTS
    table = np.zeros((SIDE, SIDE))
    for row, alpha in enumerate(alphas):
        for column, mu in enumerate(cosines):
            # Squared sine of the half vector, from the scalar product of both directions.
            product = np.sqrt((1 - cosine**2) * (1 - mu**2)) * np.cos(turn) + cosine * mu
            flat = np.clip(1 - (cosine + mu) ** 2 / (2 + 2 * product), 0, 1)
            density = (2 + 1 / alpha) / (2 * np.pi) * flat ** (0.5 / alpha)
            visible = 1 / (4 * (cosine + mu - cosine * mu))
            table[row, column] = (density * visible * cosine * area).sum()
    return _with_means(np.tile(cosines.astype(np.float32), (SIDE, 1)), table)


@cache
def _refracting(eta: float) -> NDArray[np.float32]:
    """The table of facets that reflect or refract into a medium of the relative index `eta`."""
    cosines, alphas = _axes()
    found = np.zeros((SIDE, SIDE))
    _integrate_refraction(f32(eta), cosines, alphas, found)
    return _with_means(cosines, found)


def _axes() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(32, 32) cosines and (32,) alphas of the cells."""
    alphas = np.maximum(np.linspace(0, GREATEST_ROUGHNESS, SIDE) ** 2, LEAST_ALPHA).astype(np.float32)
    # Exactly grazing there is nothing to integrate.
    places = np.maximum(np.linspace(0, 1, SIDE), 2e-3).astype(np.float32)
    cosines = np.zeros((SIDE, SIDE), np.float32)
    _cosines_of(places, alphas, cosines)
    return np.minimum(cosines, 1), alphas


def _with_means(cosines: NDArray[np.float32], table: NDArray[np.float64]) -> NDArray[np.float32]:
    """(1056,): a table, and the mean of each row over the hemisphere."""
    mu2 = cosines.astype(np.float64) ** 2
    means = ((table[:, 1:] + table[:, :-1]) / 2 * np.diff(mu2)).sum(axis=1) + table[:, 0] * mu2[:, 0]
    return np.concatenate([table.ravel(), means]).astype(np.float32)


@compiled
def _cosines_of(places, alphas, cosines):  # type: ignore[no-untyped-def]
    for row in range(SIDE):
        for column in range(SIDE):
            cosines[row, column] = table_cosine(places[column], alphas[row])


@compiled
def _integrate_reflection(cosines, alphas, found):  # type: ignore[no-untyped-def]
    for row in range(SIDE):
        for column in range(SIDE):
            mu, alpha = cosines[row, column], alphas[row]
            wo = Vec3(np.sqrt(max(f32(0), f32(1) - mu * mu)), f32(0), mu)  # type: ignore[call-arg]
            for i in range(_POINTS):
                rest, share = _strip(i)
                for j in range(_TURNS):
                    h = ggx_visible_normal(wo, alpha, alpha, f32(1 - rest), f32((j + 0.5) / (2 * _TURNS)))
                    wi = reflected(wo, h)
                    if wi.z > 0:
                        weight = visible_weight(wo, wi, alpha, alpha) * share
                        found[0, row, column] += weight
                        found[1, row, column] += weight * (schlick_weight(dot(wo, h)) - schlick_weight(mu))


@compiled
def _integrate_refraction(eta, cosines, alphas, found):  # type: ignore[no-untyped-def]
    for row in range(SIDE):
        for column in range(SIDE):
            mu, alpha = cosines[row, column], alphas[row]
            wo = Vec3(np.sqrt(max(f32(0), f32(1) - mu * mu)), f32(0), mu)  # type: ignore[call-arg]
            for i in range(_POINTS):
                rest, share = _strip(i)
                for j in range(_TURNS):
                    h = ggx_visible_normal(wo, alpha, alpha, f32(1 - rest), f32((j + 0.5) / (2 * _TURNS)))
                    cosine = dot(wo, h)
                    through = refracted_cosine(cosine, eta)
                    reflectance = exact_fresnel(None, cosine, through, eta) if through > 0 else f32(1)
                    up = reflected(wo, h)
                    if up.z > 0:
                        found[row, column] += reflectance * visible_weight(wo, up, alpha, alpha) * share
                    down = refracted(wo, h, through, eta)
                    if down.z < 0:
                        found[row, column] += (1 - reflectance) * visible_weight(wo, down, alpha, alpha) * share


@compiled
def _strip(i):  # type: ignore[no-untyped-def]
    """Where strip i of the unit square lies, as 1 - u, and the weight of a point in it."""
    # Strips are narrow towards u = 1, where facets lie steep and lose light.
    rest = 1 - (i + 0.5) / _POINTS
    return rest**3, ((1 - i / _POINTS) ** 3 - (1 - (i + 1) / _POINTS) ** 3) / _TURNS
