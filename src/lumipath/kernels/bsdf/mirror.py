"""Ideal specular reflection."""

from __future__ import annotations

from ...lang import Vec3, kernel


@kernel
def mirror_direction(wo):
    """The one direction that light comes from: wo turned by half a turn around the normal."""
    return Vec3(-wo.x, -wo.y, wo.z)
