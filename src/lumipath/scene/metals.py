"""Complex indices of refraction of metals.

At 630, 532 and 465 nm, the wavelengths of the primaries of Rec.709 to within a few nanometres, interpolated in the
measurements of Johnson and Christy 1972 ("Optical constants of the noble metals") and 1974 ("Optical constants of
transition metals"), and of Rakic 1998 ("Optical properties of metallic films") for aluminium, platinum and tungsten.
"""

from __future__ import annotations

Index = tuple[tuple[float, float, float], tuple[float, float, float]]

METALS: dict[str, Index] = {
    "aluminium": ((1.433, 0.939, 0.687), (7.511, 6.420, 5.639)),
    "copper": ((0.274, 1.079, 1.156), (3.380, 2.591, 2.470)),
    "gold": ((0.187, 0.542, 1.331), (3.409, 2.235, 1.869)),
    "silver": ((0.057, 0.054, 0.047), (4.259, 3.432, 2.805)),
}
