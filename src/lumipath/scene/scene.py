"""A scene: shapes, lights and cameras."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from attrs import define, field

from ..errors import SceneError
from .bsdfs import AnyMaterial
from .camera import Camera
from .instances import Instance, materials_of
from .lights import AmbientLight, DirectionalLight, Environment, Light, PointLight, SpotLight
from .shapes import Cone, Mesh, Shape, Sphere
from .sky import Sky

DEFAULT_GROUP = "default"
"""The group of lights that name none."""


def _checked(items: Any, classes: tuple[type, ...], wanted: str) -> list[Any]:
    """A list of the items, which must all be of these classes."""
    for index, item in enumerate(items):
        if not isinstance(item, classes):
            raise SceneError(f"item {index} is a {type(item).__name__}; it must be {wanted}")
    return list(items)


def _shapes(value: Any) -> list[Any]:
    return _checked(value, (Mesh, Sphere, Cone, Instance), "a Mesh, Box, Square, Sphere, Cone, Cylinder or an Instance")


def _lights(value: Any) -> list[Any]:
    classes = (PointLight, SpotLight, DirectionalLight, AmbientLight)
    return _checked(value, classes, "a PointLight, SpotLight, DirectionalLight or AmbientLight")


def _environment(_: object, attribute: object, value: Any) -> None:
    if not isinstance(value, (Environment, Sky, type(None))):
        raise SceneError(f"environment is a {type(value).__name__}; it must be an Environment, a Sky or None")


def _cameras(value: Any) -> list[Any]:
    return _checked(value, (Camera,), "a Camera")


@define(eq=False, kw_only=True)
class Scene:
    """Everything that can be rendered.

    Args:
        shapes: meshes, spheres, cones, and instances of them.
        lights: point, spot, directional and ambient lights; emissive shapes need not be listed.
        cameras: the first renders unless another is asked for; `Camera()` where the list is empty.
        environment: light from far away, an image or a sky, or None for black.
        name: for messages and output file names.
    """

    shapes: list[Shape | Instance] = field(factory=list, converter=_shapes)
    lights: list[Light] = field(factory=list, converter=_lights)
    cameras: list[Camera] = field(factory=list, converter=_cameras)
    environment: Environment | Sky | None = field(default=None, validator=_environment)
    name: str = "scene"

    def camera(self, which: str | int | None = None) -> Camera:
        """The camera of that name or index; None: the first, or the default camera where there is none.

        Raises:
            SceneError: no such camera; the message lists those there are.
        """
        if which is None:
            return self.cameras[0] if self.cameras else Camera()
        names = [camera.name or str(index) for index, camera in enumerate(self.cameras)]
        for index, camera in enumerate(self.cameras):
            if camera.name == which:
                return camera
            if str(index) == str(which):
                return camera
        raise SceneError(f"no camera {which!r} in {self.name}; there is {', '.join(names) or 'only the default one'}")

    def parts(self) -> Iterator[Shape]:
        """All meshes, spheres and cones; those of instances once for each instance."""
        for shape in self.shapes:
            yield from shape.parts if isinstance(shape, Instance) else (shape,)

    def materials(self) -> list[AnyMaterial]:
        """The materials of all shapes, as instances have them, each once; two with equal values are still two."""
        return list({id(material): material for shape in self.shapes for material in materials_of(shape)}.values())

    @property
    def light_groups(self) -> tuple[str, ...]:
        """Names of the groups of all lights: first `default`, for those without a group, then by the alphabet."""
        groups = {getattr(light, "group", "") for light in self.lights}
        groups |= {self.environment.group} if self.environment else set()
        groups |= {material.group for material in self.materials() if material.is_emissive}
        return (DEFAULT_GROUP, *sorted(groups - {"", DEFAULT_GROUP}))

    @property
    def triangle_count(self) -> int:
        """Number of triangles in all meshes; those of instances count once for each instance."""
        return sum(len(part.faces) for part in self.parts() if isinstance(part, Mesh))

    @property
    def stored_triangle_count(self) -> int:
        """Number of triangles in all meshes, each mesh counted once."""
        return sum(
            len(part.faces) for part in {id(part): part for part in self.parts()}.values() if isinstance(part, Mesh)
        )

    @property
    def has_sun(self) -> bool:
        """Whether the environment is a sky with a sun."""
        return isinstance(self.environment, Sky) and self.environment.sun
