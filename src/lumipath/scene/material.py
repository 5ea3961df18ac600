"""What surfaces are made of: the sum-of-lobes material."""

from __future__ import annotations

from attrs import frozen

from ..errors import SceneError
from .textures import Texture
from .values import colour, group_name

Colour = tuple[float, float, float]


@frozen(eq=False, kw_only=True)
class Material:
    """A sum of lobes, as the .ray language has it: Lambert, perfect mirror and smooth dielectric, plus emission.

    Each colour is linear Rec.709, given as one number, three numbers, or a `Texture`.

    Args:
        emission: radiance that leaves the surface, W/(m^2 sr).
        diffuse: albedo of the Lambert lobe.
        specular: weight of the mirror lobe; in a dielectric also the tint of its Fresnel reflection.
            None: not given, so the mirror lobe has the weight `reflective` and the Fresnel reflection is white.
        reflective: in a dielectric the tint of total internal reflection (None: white); elsewhere the weight of the
            mirror lobe where `specular` is None.
        transmissive: fraction of light left after one metre inside; greater than 0 makes the surface a dielectric.
        index: index of refraction of the inside relative to the outside.
        ambient: reflected fraction of ambient light; for Whitted ray tracing only.
        shininess: Phong exponent of a highlight of weight `specular`; for Whitted ray tracing only.
        name: for messages and look-ups.
        group: name of the light group that the emission belongs to, for the layers of `light_groups`.
    """

    emission: Colour | Texture = (0.0, 0.0, 0.0)
    diffuse: Colour | Texture = (0.0, 0.0, 0.0)
    specular: Colour | Texture | None = None
    reflective: Colour | Texture | None = None
    transmissive: Colour | Texture = (0.0, 0.0, 0.0)
    index: float = 1.0
    ambient: Colour | Texture = (0.0, 0.0, 0.0)
    shininess: float = 0.0
    name: str = ""
    group: str = ""

    def __attrs_post_init__(self) -> None:
        where = f"material {self.name!r}" if self.name else "material"
        for lobe in ("emission", "diffuse", "specular", "reflective", "transmissive", "ambient"):
            value = getattr(self, lobe)
            if value is not None and not isinstance(value, Texture):
                object.__setattr__(self, lobe, colour(value, f"{where}: {lobe}"))
        group_name(self.group, f"{where}: group")
        for number, low, high in (("index", 1e-3, 1e3), ("shininess", 0.0, 1e9)):
            value = getattr(self, number)
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
                raise SceneError(f"{where}: {number} is {value!r}: it must be a number from {low:g} to {high:g}")

    @property
    def is_dielectric(self) -> bool:
        """Whether light goes through."""
        return is_positive(self.transmissive)

    @property
    def is_one_sided(self) -> bool:
        """Whether a triangle of a `.ray` file with this material is invisible from behind."""
        return not (self.is_dielectric or is_positive(self.reflective))

    @property
    def is_emissive(self) -> bool:
        """Whether the surface emits anywhere."""
        return is_positive(self.emission)


def is_positive(value: Colour | Texture | None) -> bool:
    """Whether a lobe's colour is above 0 anywhere."""
    if value is None:
        return False
    return value.is_positive() if isinstance(value, Texture) else max(value) > 0
