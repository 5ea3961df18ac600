"""Sorting what a step of a path emits into layers. Where the path has escaped, that is the light of several groups."""

from __future__ import annotations

from ..lang import i32, kernel
from ..pack.layout import GROUPS, PARTS, SUNS
from .far_light import environment_light, far_light, sun_light
from .light_layers import emitter_group, light_group, to_group, to_part
from .path import strength


@kernel
def emitted_to_no_group(scene, put, sums, place, escaped, step, light):
    """Nobody asks for groups."""


@kernel
def to_group_of_emitter(scene, put, sums, place, escaped, step, light):
    """A scene in which all that is emitted by one step is of one group."""
    to_group(scene, put, sums, place, i32(0), step.emitter, light)


@kernel(needs=SUNS, otherwise=to_group_of_emitter)
def to_groups_of_emitters(scene, put, sums, place, escaped, step, light):
    """The light of an emitter, or that of the environment and each sun."""
    if not escaped:
        to_group_of_emitter(scene, put, sums, place, escaped, step, light)
        return
    # What a limit has left of them together.
    share = strength(scene, light) / strength(scene, far_light(scene, step.path))
    to_group(
        scene, put, sums, place, i32(0), emitter_group(scene, i32(-1)), environment_light(scene, step.path) * share
    )
    for k in range(scene.sun_count):
        sun = i32(scene.first_sun + k)
        to_group(scene, put, sums, place, i32(0), light_group(scene, sun), sun_light(scene, step.path, sun) * share)


@kernel(needs=GROUPS, otherwise=emitted_to_no_group)
def emitted_to_groups(scene, put, sums, place, escaped, step, light):
    """Add what a step emits to the groups of its lights."""
    to_groups_of_emitters(scene, put, sums, place, escaped, step, light)


@kernel
def emitted_to_no_layer(scene, put, sums, place, events, escaped, step, light):
    """Nobody asks for these layers."""


@kernel(needs=PARTS | GROUPS, otherwise=emitted_to_no_layer)
def emitted_to_layers(scene, put, sums, place, events, escaped, step, light):
    """Add what a step emits to the layers that it belongs to.

    Args:
        scene: PackedScene.
        put: as for `to_layers`.
        sums: what it adds to.
        place: of the sample or pixel in the sums.
        events: scattering events before the step.
        escaped: whether the path has hit nothing.
        step: what `shade` returned.
        light: its `emitted`, or black where that is not finite.
    """
    if light.x + light.y + light.z != 0.0:
        to_part(scene, put, sums, place, events, step.emitter, light)
        emitted_to_groups(scene, put, sums, place, escaped, step, light)
