"""Complex indices of refraction of metals.

At 630, 532 and 465 nm, wavelengths of monochromatic primaries near those of Rec.709, linearly interpolated in tables of
measurements, as refractiveindex.info gives them (in the public domain, CC0):

- copper, gold, silver: Johnson and Christy 1972, "Optical constants of the noble metals", Phys. Rev. B 6;
- chromium, iron, nickel, titanium: Johnson and Christy 1974, "Optical constants of transition metals", Phys. Rev. B 9;
- aluminium: Rakic 1995, "Algorithm for the determination of intrinsic optical constants of metal films", Appl. Opt. 34;
- platinum, tungsten: Rakic et al. 1998, "Optical properties of metallic films for vertical-cavity optoelectronic
  devices", Appl. Opt. 37; a model fitted to measurements from several sources;
- brass of 70 % copper: Querry 1985, "Optical constants", report CRDC-CR-85034.
"""

from __future__ import annotations

Index = tuple[tuple[float, float, float], tuple[float, float, float]]

METALS: dict[str, Index] = {
    "aluminium": ((1.43, 0.939, 0.686), (7.508, 6.42, 5.635)),
    "brass": ((0.445, 0.568, 0.947), (3.522, 2.588, 1.92)),
    "chromium": ((3.145, 3.034, 2.456), (3.312, 3.33, 3.21)),
    "copper": ((0.275, 1.116, 1.247), (3.373, 2.596, 2.456)),
    "gold": ((0.188, 0.544, 1.332), (3.403, 2.231, 1.869)),
    "iron": ((2.892, 2.895, 2.646), (3.065, 2.918, 2.805)),
    "nickel": ((1.99, 1.878, 1.765), (4.094, 3.495, 3.048)),
    "platinum": ((2.314, 2.038, 1.879), (4.16, 3.612, 3.223)),
    "silver": ((0.057, 0.054, 0.047), (4.254, 3.429, 2.803)),
    "titanium": ((2.698, 2.479, 2.305), (3.757, 3.351, 3.082)),
    "tungsten": ((3.635, 3.469, 3.337), (2.796, 2.738, 2.631)),
}
