"""Choosing a light by what it may do for a point, from a tree of all that are near, and the probability of it.

Conty Estevez and Kulla 2018, Importance Sampling of Many Lights with Adaptive Tree Splitting; pbrt, 4th edition,
section 12.6.3. A light below the horizon of the surface is not chosen. What multiple importance sampling weighs by is
the probability without regard to the surface, since a ray that hits a light later does not know where it left from: any
weights that add up to 1 are right.
"""

from __future__ import annotations

from ..lang import as_int, f32, i32, inverse, kernel, load, load4, sqrt, struct
from ..pack.layout import LIGHT_NODE_SIZE
from .alias import resolve_alias
from .vectors import black, dot, xyz

_LEAST_DISTANCE2 = f32(1e-20)


@struct
class Importance:
    """Bounds of the light that a node may send to a point; only their ratios mean anything."""

    facing: f32  # to a surface with its normal
    any: f32  # whatever the surface


@struct
class Chosen:
    """A leaf, and the probability of having chosen it; light = -1: nothing lights this point."""

    light: i32
    pdf: f32
    rival: f32  # the same without regard to the surface's normal


@kernel
def sine_of(cosine):
    """Of an angle from 0 to pi."""
    return sqrt(max(0.0, 1.0 - cosine * cosine))


@kernel
def reduced_cosine(sine, cosine, other_sine, other_cosine):
    """Cosine of the angle less another one, but of 0 where that is greater."""
    return f32(1.0) if cosine > other_cosine else cosine * other_cosine + sine * other_sine


@kernel
def reduced_sine(sine, cosine, other_sine, other_cosine):
    """Sine of the angle less another one, but of 0 where that is greater."""
    return f32(0.0) if cosine > other_cosine else sine * other_cosine - cosine * other_sine


@kernel
def importance(scene, node, o, n):
    """How much light a node may send to a point o of a surface with the normal n; n = (0, 0, 0): to either side."""
    row = node * LIGHT_NODE_SIZE
    ball = load4(scene.light_nodes, row)
    cone = load4(scene.light_nodes, row + 4)
    angles = load4(scene.light_nodes, row + 8)
    to_light = xyz(ball) - o
    distance2 = dot(to_light, to_light)
    radius2 = ball[3] * ball[3]
    towards = to_light * inverse(sqrt(max(distance2, _LEAST_DISTANCE2)))
    # The angle under which the node is seen; all around from inside.
    inside = not distance2 > radius2
    sine = f32(0.0) if inside else sqrt(radius2 / distance2)
    cosine = f32(-1.0) if inside else sine_of(sine)

    light = abs(cone[3]) * inverse(max(max(distance2, radius2), _LEAST_DISTANCE2))
    if angles[0] > -1.0:
        # The least angle between any of the normals and any direction to the point.
        along = -dot(xyz(cone), towards)
        along = min(max(abs(along) if cone[3] < 0.0 else along, -1.0), 1.0)
        across = sine_of(along)
        beyond = reduced_cosine(across, along, angles[1], angles[0])
        leaving = reduced_cosine(reduced_sine(across, along, angles[1], angles[0]), beyond, sine, cosine)
        light = light * max(leaving, 0.0) if leaving > angles[2] else f32(0.0)

    # The least angle between the surface's normal and any direction to the node.
    height = min(max(dot(n, towards), -1.0), 1.0)
    arriving = max(reduced_cosine(sine_of(height), height, sine, cosine), 0.0)
    facing = light * arriving if dot(n, n) > 0.0 else light
    return Importance(facing, light)


@kernel
def link_of(scene, node):
    """The first child of a node, or -1 - light."""
    return as_int(load4(scene.light_nodes, node * LIGHT_NODE_SIZE + 8)[3])


@kernel
def descend(scene, o, n, u):
    """Walk from the root to a leaf, at each node by chance, with one random number for all of them."""
    pdf = f32(1.0)
    rival = f32(1.0)
    link = link_of(scene, i32(0))
    while link >= 0:
        a = importance(scene, link, o, n)
        b = importance(scene, i32(link + 1), o, n)
        total = a.facing + b.facing
        if not total > 0.0:
            return Chosen(i32(-1), 0.0, 0.0)
        share = a.facing / total
        pick = resolve_alias(link, i32(link + 1), share, u)
        first = pick.index == link
        pdf = pdf * (share if first else 1.0 - share)
        rival = rival * ((a.any if first else b.any) / (a.any + b.any))
        u = pick.rest
        link = link_of(scene, pick.index)
    return Chosen(i32(-1 - link), pdf, rival)


@kernel
def rival_of(scene, primitive, o):
    """Probability, without regard to the surface, that `descend` chooses a primitive for the point o."""
    node = load(scene.emitter_node, primitive)
    if node < 0:
        return f32(0.0)
    rival = f32(1.0)
    anywhere = black()
    while node > 0:
        here = importance(scene, node, o, anywhere).any
        total = here + importance(scene, i32(node ^ 1), o, anywhere).any
        rival = rival * (here / total if total > 0.0 else f32(0.0))
        node = load(scene.light_parents, node)
    return rival
