"""What a camera accepts."""

import pytest

from lumipath.errors import SceneError
from lumipath.scene import Camera


@pytest.mark.parametrize(
    ("field", "value", "wanted"),
    [
        ("blades", 2, "0 for a round aperture, or from 3 to 32"),
        ("blades", 33, "0 for a round aperture"),
        ("blades", -3, "0 for a round aperture"),
        ("blades", 6.0, "0 for a round aperture"),
        ("blades", True, "0 for a round aperture"),
        ("blade_rotation", 361, "a number from -360 to 360"),
        ("blade_rotation", float("nan"), "a number from -360 to 360"),
        ("aperture", -1, "a number from 0 to 1e+06"),
        ("focus", 0, "a number from 1e-06 to 1e+09"),
    ],
)
def test_wrong_values_name_the_field(field, value, wanted):
    with pytest.raises(SceneError) as caught:
        Camera(**{field: value})
    assert str(caught.value).startswith(f"camera: {field} is {value!r}: it must be {wanted}")


@pytest.mark.parametrize("blades", [0, 3, 32])
def test_blades(blades):
    assert Camera(blades=blades, blade_rotation=-12.5).blades == blades
