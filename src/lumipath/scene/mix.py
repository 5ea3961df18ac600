"""Two materials on one surface."""

from __future__ import annotations

from attrs import field, frozen

from ..errors import SceneError
from .bsdfs import Appearance, Inside, Number, checked_share
from .material import Material
from .textures import Texture

MAX_DEPTH = 8
"""Mixes within mixes."""


@frozen(eq=False, kw_only=True)
class Mix(Appearance):
    """Of each point a share `weight` is of the material `second`, the rest of `first`.

    Emission, opacity and `two_sided` are those of the mix; normals are those of its parts.

    Args:
        first: a material, or another mix.
        second: a material, or another mix.
        weight: of the second, from 0 to 1; a number or a texture.

    Raises:
        SceneError: a part emits, has an opacity or is one-sided; both enclose different media; mixes within mixes more
            than 8 deep.
    """

    first: Appearance = field()
    second: Appearance = field()
    weight: Number = field(default=0.5, validator=checked_share)

    def __attrs_post_init__(self) -> None:
        super().__attrs_post_init__()
        where = f"Mix {self.name!r}" if self.name else "Mix"
        for name, part in self.parts().items():
            if not isinstance(part, Appearance):
                raise SceneError(f"{where}: {name} is a {type(part).__name__}: it must be one of the surfaces")
            if part.is_emissive:
                raise SceneError(f"{where}: {name} emits; give the emission to the mix")
            if part.has_holes:
                raise SceneError(f"{where}: {name} has an opacity; give it to the mix")
            if not part.two_sided:
                raise SceneError(f"{where}: {name} is one-sided; give two_sided to the mix")
        if self.has_normals:
            raise SceneError(f"{where}: normals are those of its parts; give normal_map or bump_map to them")
        insides = {part.inside for part in self.parts().values() if part.inside}
        if len(insides) > 1:
            raise SceneError(f"{where}: first and second enclose different media; give both the same inside")
        if self.depth > MAX_DEPTH:
            raise SceneError(f"{where}: mixes lie {self.depth} deep in each other; {MAX_DEPTH} are possible")

    @property
    def inside(self) -> Inside | None:
        """That of its parts, whichever of them have one."""
        return self.first.inside or self.second.inside

    def parts(self) -> dict[str, Appearance]:
        """Both materials by the names of their fields."""
        return {"first": self.first, "second": self.second}

    @property
    def depth(self) -> int:
        """How many mixes lie in each other."""
        return 1 + max(part.depth if isinstance(part, Mix) else 0 for part in self.parts().values())

    def as_lobes(self) -> Material:
        """Those of the part of the greater mean weight."""
        share = self.weight.mean()[0] if isinstance(self.weight, Texture) else self.weight
        return (self.second if share >= 0.5 else self.first).as_lobes()
