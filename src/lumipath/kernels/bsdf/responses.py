"""One link for each kind of BSDF; those that a scene lacks are left out of its kernels.

A link reads the parameters once, and uses them for the light that arrives and for the direction that the path takes.
"""

from __future__ import annotations

from ...lang import Vec3, f32, kernel, struct
from ...pack.layout import (
    CONDUCTORS,
    MEASURED_METAL_KIND,
    PRINCIPLED,
    PRINCIPLED_KIND,
    ROUGH_DIELECTRIC_KIND,
    ROUGH_DIELECTRICS,
    ROUGH_DIFFUSE,
    ROUGH_DIFFUSE_KIND,
    THIN_DIELECTRIC_KIND,
    THIN_DIELECTRICS,
    TINTED_METAL_KIND,
)
from .conductor import eval_metal, metal_at, sample_metal
from .principled import eval_principled, principled_at, sample_principled
from .rough_dielectric import eval_rough_dielectric, rough_dielectric_at, sample_rough_dielectric
from .rough_diffuse import eval_rough_diffuse, rough_diffuse_at, sample_rough_diffuse
from .thin_dielectric import eval_thin_dielectric, sample_thin_dielectric, thin_dielectric_at
from .values import BsdfSample, BsdfValue, no_sample, no_value


@struct
class Question:
    """What a BSDF is asked: local directions, and random numbers.

    wo: to the viewer, wo.z > 0. wi: to the light. u, v: place of the new direction. choice: of the lobe.
    eta: index of refraction beyond the surface relative to the viewer's side; 1 where nothing is refracted.
    blurred: whether the path came here by chance, from a surface that scatters in many directions.
    """

    wo: Vec3
    wi: Vec3
    u: f32
    v: f32
    choice: f32
    eta: f32
    blurred: bool


@struct
class Response:
    """The value towards the light, and the direction drawn."""

    value: BsdfValue
    drawn: BsdfSample


@kernel
def no_response(scene, s, kind, q):
    """The end of the chain."""
    return Response(no_value(), no_sample())


@kernel(needs=ROUGH_DIFFUSE, otherwise=no_response)
def from_rough_diffuse(scene, s, kind, q):
    """A rough diffuse surface, or else."""
    if kind == ROUGH_DIFFUSE_KIND:
        m = rough_diffuse_at(scene, s)
        return Response(eval_rough_diffuse(m, q.wo, q.wi), sample_rough_diffuse(m, q.wo, q.u, q.v))
    return no_response(scene, s, kind, q)


@kernel(needs=ROUGH_DIELECTRICS, otherwise=from_rough_diffuse)
def from_rough_dielectric(scene, s, kind, q):
    """Rough glass, or else."""
    if kind == ROUGH_DIELECTRIC_KIND:
        m = rough_dielectric_at(scene, s, q)
        value = eval_rough_dielectric(scene, m, q.wo, q.wi)
        return Response(value, sample_rough_dielectric(scene, m, q.wo, q.u, q.v, q.choice))
    return from_rough_diffuse(scene, s, kind, q)


@kernel(needs=THIN_DIELECTRICS, otherwise=from_rough_dielectric)
def from_thin_dielectric(scene, s, kind, q):
    """A sheet of glass, or else."""
    if kind == THIN_DIELECTRIC_KIND:
        m = thin_dielectric_at(scene, s, q)
        return Response(eval_thin_dielectric(m, q.wo, q.wi), sample_thin_dielectric(m, q.wo, q.u, q.v, q.choice))
    return from_rough_dielectric(scene, s, kind, q)


@kernel(needs=PRINCIPLED, otherwise=from_thin_dielectric)
def from_principled(scene, s, kind, q):
    """The material of glTF, or else."""
    if kind == PRINCIPLED_KIND:
        m = principled_at(scene, s, q)
        value = eval_principled(scene, m, q.wo, q.wi)
        return Response(value, sample_principled(scene, m, q.wo, q.u, q.v, q.choice))
    return from_thin_dielectric(scene, s, kind, q)


@kernel(needs=CONDUCTORS, otherwise=from_principled)
def response(scene, s, kind, q):
    """A metal, or else."""
    if (kind == MEASURED_METAL_KIND) | (kind == TINTED_METAL_KIND):
        m = metal_at(scene, s, kind, q)
        return Response(eval_metal(scene, m, q.wo, q.wi), sample_metal(scene, m, q.wo, q.u, q.v))
    return from_principled(scene, s, kind, q)
