"""Materials of physically based surfaces, as renderers and glTF name them today."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Any, ClassVar

from attrs import field, frozen
from attrs.validators import optional

from ..errors import SceneError
from .material import Colour, Material, is_positive
from .metals import METALS
from .textures import Texture
from .values import colour, group_name

Number = float | Texture

WHITE = (1.0, 1.0, 1.0)
BLACK = (0.0, 0.0, 0.0)


def _where(owner: Any) -> str:
    kind = type(owner).__name__
    return f"{kind} {owner.name!r}" if owner.name else kind


def checked_number(low: float, high: float) -> Any:
    """A validator of attrs: a number from `low` to `high`."""

    def check(owner: Any, attribute: Any, value: Any) -> None:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
            raise SceneError(
                f"{_where(owner)}: {attribute.name} is {value!r}: it must be a number from {low:g} to {high:g}"
            )

    return check


def checked_share(owner: Any, attribute: Any, value: Any) -> None:
    """A validator of attrs: a number from 0 to 1, or a texture."""
    if not isinstance(value, Texture):
        checked_number(0.0, 1.0)(owner, attribute, value)


def checked_map(owner: Any, attribute: Any, value: Any) -> None:
    """A validator of attrs: a texture of linear data, or None."""
    if value is None:
        return
    if not isinstance(value, Texture):
        raise SceneError(f"{_where(owner)}: {attribute.name} is {value!r}: it must be a Texture")
    if value.image.dtype == "uint8" and value.srgb:
        raise SceneError(f"{_where(owner)}: {attribute.name} holds data, not colours: give its Texture srgb=False")


def checked_flag(owner: Any, attribute: Any, value: Any) -> None:
    """A validator of attrs: True or False."""
    if not isinstance(value, bool):
        raise SceneError(f"{_where(owner)}: {attribute.name} is {value!r}: it must be True or False")


def _checked_priority(owner: Any, attribute: Any, value: Any) -> None:
    if value is not None and (type(value) is not int or not -1000 <= value <= 1000):
        raise SceneError(f"{_where(owner)}: priority is {value!r}: it must be a whole number from -1000 to 1000")


@frozen
class Inside:
    """The medium that a surface encloses: index of refraction, absorption (1/m), and priority where bodies overlap."""

    ior: float
    extinction: Colour
    priority: int | None = None


@frozen(eq=False, kw_only=True)
class Appearance(ABC):
    """What all materials of this page have in common.

    Args:
        emission: radiance that leaves the surface, W/(m^2 sr), linear Rec.709: one number, three, or a `Texture`.
        group: name of the light group that the emission belongs to, for the layers of `light_groups`.
        opacity: from 0, not there, to 1: the fraction of rays that the surface stops; often `texture.view("a")`.
        alpha_cutoff: None, or a number from 0 to 1: where opacity is less the surface is not there, elsewhere it is
            opaque.
        normal_map: a texture of tangent-space normals as glTF has them: red along u, green along v, blue outwards, each
            from -1 to 1 as 0 to 1; read with srgb=False.
        normal_scale: what the red and green parts of the normal map are multiplied by.
        bump_map: a texture of heights.
        bump_height: metres that a height of 1 stands out.
        two_sided: False: triangles are not there for rays from behind, as with `Mesh(two_sided=False)`.
        name: for messages and look-ups.
    """

    emission: Colour | Texture = BLACK
    group: str = ""
    opacity: Number = field(default=1.0, validator=checked_share)
    alpha_cutoff: float | None = field(default=None, validator=optional(checked_number(0.0, 1.0)))
    normal_map: Texture | None = field(default=None, validator=checked_map)
    normal_scale: float = field(default=1.0, validator=checked_number(-100.0, 100.0))
    bump_map: Texture | None = field(default=None, validator=checked_map)
    bump_height: float = field(default=0.01, validator=checked_number(-1e6, 1e6))
    two_sided: bool = field(default=True, validator=checked_flag)
    name: str = ""

    # The greatest value of each colour; emission has no bound.
    _limits: ClassVar[dict[str, float]] = {"emission": 1e12}

    def __attrs_post_init__(self) -> None:
        group_name(self.group, f"{_where(self)}: group")
        for name, high in self._limits.items():
            value = getattr(self, name)
            if value is not None and not isinstance(value, Texture):
                object.__setattr__(self, name, colour(value, f"{_where(self)}: {name}", high))

    @property
    def is_emissive(self) -> bool:
        """Whether the surface emits anywhere."""
        return is_positive(self.emission)

    @property
    def has_holes(self) -> bool:
        """Whether rays may go through as if there were nothing."""
        return isinstance(self.opacity, Texture) or self.opacity < 1

    @property
    def has_normals(self) -> bool:
        """Whether a map bends its normals."""
        return self.normal_map is not None or self.bump_map is not None

    @property
    def is_dielectric(self) -> bool:
        """Whether light goes through to an inside that absorbs or refracts."""
        return False

    @property
    def is_plain(self) -> bool:
        """Whether `as_lobes` is this very material, rather than what stands for it where lobes are all there is."""
        return False

    @property
    def inside(self) -> Inside | None:
        """What light that goes through comes into; None for surfaces that enclose no other medium."""
        return None

    @abstractmethod
    def as_lobes(self) -> Material:
        """The sum-of-lobes material nearest to this one: what Whitted ray tracing and looks at albedo see."""


@frozen(eq=False, kw_only=True)
class Diffuse(Appearance):
    """A matt surface: Lambert's, or a rough one after Oren and Nayar that loses no energy.

    Args:
        reflectance: albedo, from 0 to 1.
        roughness: 0 is Lambert's; 1 is as rough as can be (clay, the moon). After Portsmouth, Kutz and Hill 2025,
            "EON: A practical energy-preserving rough diffuse BRDF".
    """

    reflectance: Colour | Texture = (0.5, 0.5, 0.5)
    roughness: Number = field(default=0.0, validator=checked_share)

    _limits: ClassVar[dict[str, float]] = Appearance._limits | {"reflectance": 1.0}

    @property
    def is_plain(self) -> bool:
        """Whether it is Lambert's."""
        return self.roughness == 0

    def as_lobes(self) -> Material:
        """A Lambert lobe of the same albedo."""
        return Material(diffuse=self.reflectance, emission=self.emission, name=self.name)


@frozen(eq=False, kw_only=True)
class Conductor(Appearance):
    """A metal with the microfacets of Trowbridge and Reitz (GGX).

    Its colour comes from `metal`, or from `eta` and `k`, or else from `reflectance` and `edge_tint`.

    Args:
        metal: name of a metal whose complex index of refraction was measured; one of `scene.metals.METALS`.
        eta: real part of the index of refraction, for red, green and blue.
        k: imaginary part of it.
        reflectance: seen face to face, from 0 to 1; a colour or a texture.
        edge_tint: what the reflectance is multiplied by at 82 degrees, just before all metals turn white
            (Kutz, Hasan and Edmondson 2021, "Novel aspects of the Adobe Standard Material").
        roughness: from 0, a mirror, to 1; its square is the alpha of GGX.
        anisotropy: from 0 to 1: how far highlights are drawn out along the u direction of the texture coordinates.
        rotation: of that direction, degrees counter-clockwise.
    """

    metal: str | None = None
    eta: Colour | None = None
    k: Colour | None = None
    reflectance: Colour | Texture = (0.9, 0.9, 0.9)
    edge_tint: Colour = WHITE
    roughness: Number = field(default=0.1, validator=checked_share)
    anisotropy: float = field(default=0.0, validator=checked_number(0.0, 1.0))
    rotation: float = field(default=0.0, validator=checked_number(-360.0, 360.0))

    _limits: ClassVar[dict[str, float]] = Appearance._limits | {
        "reflectance": 1.0,
        "edge_tint": 1.0,
        "eta": 100.0,
        "k": 100.0,
    }

    def __attrs_post_init__(self) -> None:
        super().__attrs_post_init__()
        if self.metal is not None and self.metal not in METALS:
            raise SceneError(f"{_where(self)}: no metal {self.metal!r}; there is {', '.join(METALS)}")
        if self.metal is not None and (self.eta is not None or self.k is not None):
            raise SceneError(f"{_where(self)}: give either metal, or eta and k")
        if (self.eta is None) != (self.k is None):
            raise SceneError(f"{_where(self)}: eta and k belong together; give both or neither")

    @property
    def index(self) -> tuple[Colour, Colour] | None:
        """Eta and k, where they are known."""
        if self.metal is not None:
            return METALS[self.metal]
        return (self.eta, self.k) if self.eta is not None and self.k is not None else None

    def face_on(self) -> Colour | Texture:
        """The reflectance seen face to face."""
        if self.index is None:
            return self.reflectance
        r, g, b = (((n - 1) ** 2 + k * k) / ((n + 1) ** 2 + k * k) for n, k in zip(*self.index))
        return (r, g, b)

    def as_lobes(self) -> Material:
        """A mirror of its colour."""
        return Material(specular=self.face_on(), emission=self.emission, name=self.name)


AnyMaterial = Material | Appearance


def checked_material(value: Any) -> AnyMaterial:
    """The value, which must be a material.

    Raises:
        SceneError: it is something else.
    """
    if not isinstance(value, (Material, Appearance)):
        raise SceneError(f"a material is {value!r}; it must be a Material, Diffuse, Conductor or the like")
    return value


@frozen(eq=False, kw_only=True)
class Dielectric(Appearance):
    """Glass, water, plastic without pigment: a surface that reflects and refracts, around a medium that absorbs.

    Args:
        ior: index of refraction of the inside relative to the outside.
        roughness: 0 is clear glass, 1 ground as coarsely as can be; its square is the alpha of GGX.
        anisotropy: from 0 to 1: how far highlights are drawn out along the u direction of the texture coordinates.
        rotation: of that direction, degrees counter-clockwise.
        reflection_tint: what reflected light is multiplied by; white in nature.
        transmission_tint: what light is multiplied by each time it passes the surface.
        attenuation_color: what is left of white light after `attenuation_distance` inside.
        attenuation_distance: metres; infinite for a medium that absorbs nothing.
        priority: where dielectrics overlap, the one with the highest priority is there, and surfaces of others are not
            (Schmidt and Budge 2002); `ior` is then relative to vacuum. None: above all others, and `ior` is relative to
            whatever is around.
    """

    ior: float = field(default=1.5, validator=checked_number(0.1, 10.0))
    roughness: Number = field(default=0.0, validator=checked_share)
    anisotropy: float = field(default=0.0, validator=checked_number(0.0, 1.0))
    rotation: float = field(default=0.0, validator=checked_number(-360.0, 360.0))
    reflection_tint: Colour | Texture = WHITE
    transmission_tint: Colour | Texture = WHITE
    attenuation_color: Colour = WHITE
    attenuation_distance: float = field(default=math.inf, validator=checked_number(1e-9, math.inf))
    priority: int | None = field(default=None, validator=_checked_priority)

    _limits: ClassVar[dict[str, float]] = Appearance._limits | {
        "reflection_tint": 1.0,
        "transmission_tint": 1.0,
        "attenuation_color": 1.0,
    }

    @property
    def is_dielectric(self) -> bool:
        """Whether light goes through to an inside that absorbs or refracts."""
        return True

    @property
    def is_plain(self) -> bool:
        """Whether it is clear, without a tint of its surface, and refracts as it does alone."""
        is_white = self.reflection_tint == WHITE and self.transmission_tint == WHITE
        return self.roughness == 0 and is_white and self.priority is None

    @property
    def inside(self) -> Inside:
        """What it is made of."""
        return Inside(self.ior, absorption_of(self.attenuation_color, self.attenuation_distance), self.priority)

    def as_lobes(self) -> Material:
        """Clear glass of the same index and medium."""
        left = left_after_a_metre(self.inside)
        return Material(transmissive=left, index=self.ior, emission=self.emission, name=self.name)


@frozen(eq=False, kw_only=True)
class ThinDielectric(Appearance):
    """A sheet of glass with no inside to speak of: a window pane, a soap bubble. Light goes straight through.

    Args:
        ior: index of refraction of the sheet.
        tint: what light that goes through is multiplied by.
        roughness: 0 is clear; both reflected and transmitted light are spread by GGX of its square.
    """

    ior: float = field(default=1.5, validator=checked_number(1.0, 10.0))
    tint: Colour | Texture = WHITE
    roughness: Number = field(default=0.0, validator=checked_share)

    _limits: ClassVar[dict[str, float]] = Appearance._limits | {"tint": 1.0}

    def as_lobes(self) -> Material:
        """A surface that is hardly there."""
        return Material(transmissive=WHITE, index=1.0, emission=self.emission, name=self.name)


def left_after_a_metre(inside: Inside) -> Colour:
    """Transmissive colour of a medium: above 0 even where nothing is left, which `Inside.extinction` tells exactly."""
    r, g, b = (max(math.exp(-part), 1e-30) for part in inside.extinction)
    return (r, g, b)


def absorption_of(tint: Colour, distance: float) -> Colour:
    """Extinction, 1/m, of a medium that leaves `tint` of white light after `distance` metres."""
    if math.isinf(distance):
        return BLACK
    r, g, b = (-math.log(max(part, 1e-20)) / distance for part in tint)
    return (r, g, b)
