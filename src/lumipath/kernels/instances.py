"""Instances: rays on their way into the coordinates of what is placed, and surfaces on their way out.

A direction that enters an instance keeps its length in world units, so that distances need no conversion.
"""

from __future__ import annotations

from ..lang import Vec3, as_int, i32, kernel, load4, struct
from ..pack.layout import INSTANCE_LINK, INSTANCE_SCALE, INSTANCE_SIZE, INSTANCES
from .quadrics import point_to_object, vector_to_object
from .rays import Ray
from .vectors import max_abs_component, xyz


@struct
class Placement:
    """From the world to the coordinates of what an instance places."""

    x: Vec3
    y: Vec3
    z: Vec3
    translation: Vec3


@kernel
def placement_of(scene, instance):
    """Where an instance stands."""
    row = instance * INSTANCE_SIZE
    x = load4(scene.instances, row)
    y = load4(scene.instances, row + 4)
    z = load4(scene.instances, row + 8)
    return Placement(xyz(x), xyz(y), xyz(z), Vec3(x[3], y[3], z[3]))


@kernel
def ray_within(scene, instance, ray):
    """A ray of the world in the coordinates of what an instance places; at the same bits wherever it is called."""
    placement = placement_of(scene, instance)
    return Ray(point_to_object(placement, ray.o), vector_to_object(placement, ray.d), ray.tmax)


@kernel
def root_of(scene, instance):
    """The link to the tree of what an instance places."""
    return i32(as_int(load4(scene.instances, instance * INSTANCE_SIZE + INSTANCE_LINK)[0]))


@kernel
def own_material(scene, instance):
    """The material of an instance in place of those of what it places, or -1."""
    return i32(as_int(load4(scene.instances, instance * INSTANCE_SIZE + INSTANCE_LINK)[1]))


@kernel
def material_alone(scene, instance, material):
    """A scene without instances."""
    return material


@kernel(needs=INSTANCES, otherwise=material_alone)
def placed_material(scene, instance, material):
    """The material of a primitive, or that of the instance which it is in, where that has one of its own."""
    if instance < 0:
        return material
    own = own_material(scene, instance)
    return material if own < 0 else own


@kernel
def placed_reach(scene, instance, reach, p, t):
    """What the reach of a primitive becomes in the world, for `offset_point`, at a point p found at the distance t.

    On the way to the instance and back the rounding of the ray grows by its `spread`.
    """
    row = load4(scene.instances, instance * INSTANCE_SIZE + INSTANCE_SCALE)
    return reach * row[0] + row[1] + (max_abs_component(p) + t) * row[2]
