import numpy as np
import pytest

from lumipath.errors import UsageError
from lumipath.formats.srgb import decode_srgb, encode_srgb
from lumipath.rendering.tonemap import DATA_INTEGRATORS, data_to_display, to_display
from lumipath.settings import TONEMAPS

GREYS = np.repeat(np.geomspace(1e-6, 1e6, 5000, dtype=np.float32)[:, None], 3, axis=1)


@pytest.mark.parametrize("tonemap", TONEMAPS)
class TestEveryTonemap:
    def test_is_monotone_on_greys(self, tonemap):
        assert (np.diff(to_display(GREYS, tonemap=tonemap)[:, 1]) >= 0).all()

    def test_grey_stays_grey(self, tonemap):
        shown = to_display(GREYS, tonemap=tonemap)
        np.testing.assert_allclose(shown, shown[:, :1].repeat(3, axis=1), atol=2e-6)

    def test_black_is_black(self, tonemap):
        assert (to_display(np.zeros((4, 3)), tonemap=tonemap) == 0).all()

    def test_range_is_0_to_1(self, tonemap):
        colours = np.random.default_rng(1).lognormal(0, 4, (2000, 3)).astype(np.float32)
        colours[0] = np.finfo(np.float32).max
        colours[1] = (3e38, 0, 0)
        with np.errstate(all="raise", under="ignore"):
            shown = to_display(colours, exposure=3, tonemap=tonemap)
        assert shown.min() >= 0
        assert shown.max() <= 1

    def test_not_finite_and_negative_pixels_are_black(self, tonemap):
        bad = np.array([[np.nan, 1, 1], [np.inf, 1, 1], [1, -np.inf, 1], [-1, -1, -1]], np.float32)
        assert (to_display(bad, tonemap=tonemap) == 0).all()

    def test_keeps_the_shape(self, tonemap):
        assert to_display(np.ones((2, 5, 3)), tonemap=tonemap).shape == (2, 5, 3)

    def test_exposure_is_in_stops(self, tonemap):
        colour = np.array([[0.05, 0.1, 0.02]], np.float32)
        np.testing.assert_allclose(
            to_display(colour, exposure=2, tonemap=tonemap), to_display(4 * colour, tonemap=tonemap), atol=1e-6
        )


def test_srgb_curve_at_known_points():
    np.testing.assert_allclose(encode_srgb([0, 0.0031308, 0.5, 1]), [0, 0.04045, 0.735357, 1], atol=1e-6)


def test_srgb_curve_inverts():
    values = np.linspace(0, 1, 1001, dtype=np.float32)
    np.testing.assert_allclose(encode_srgb(decode_srgb(values)), values, atol=1e-6)


def test_agx_maps_middle_grey_to_the_middle_of_its_curve():
    # The curve's pivot: 0.5 on a display of power 2.2.
    shown = decode_srgb(to_display([[0.18, 0.18, 0.18]], tonemap="agx"))
    np.testing.assert_allclose(shown, 0.5**2.2, atol=1e-5)


def test_agx_bleaches_bright_saturated_light():
    shown = to_display([[1000.0, 0.0, 0.0]], tonemap="agx")[0]
    assert shown[1] > 0.5


def test_aces_matches_the_published_fit_for_white():
    # RRTAndODTFit(1) by hand.
    expected = (1 * (1 + 0.0245786) - 0.000090537) / (1 * (0.983729 + 0.4329510) + 0.238081)
    np.testing.assert_allclose(decode_srgb(to_display([[1.0, 1.0, 1.0]], tonemap="aces")), expected, atol=1e-4)


def test_reinhard_is_l_over_1_plus_l():
    greys = np.array([[0.18] * 3, [1.0] * 3, [9.0] * 3])
    np.testing.assert_allclose(decode_srgb(to_display(greys, tonemap="reinhard"))[:, 0], [0.18 / 1.18, 0.5, 0.9], 1e-5)


def test_reinhard_keeps_the_ratios_of_a_colour():
    shown = decode_srgb(to_display([[0.8, 0.4, 0.2]], tonemap="reinhard"))[0]
    np.testing.assert_allclose(shown / shown[0], [1, 0.5, 0.25], rtol=1e-4)


def test_unknown_tonemap_suggests_one():
    with pytest.raises(UsageError, match="did you mean agx"):
        to_display([[1.0, 1.0, 1.0]], tonemap="agxx")


class TestDataThatIsNoLight:
    def test_normals_are_halved_and_moved_without_a_curve(self):
        normals = np.array([[[-1, 0, 1], [0.5, -0.5, 0]]], np.float32)
        shown = data_to_display(normals, "normal")
        np.testing.assert_allclose(shown, [[[0, 0.5, 1], [0.75, 0.25, 0.5]]])

    def test_depths_are_shares_of_the_greatest(self):
        depths = np.repeat(np.array([[[0.0], [2], [8]]], np.float32), 3, axis=2)
        np.testing.assert_allclose(data_to_display(depths, "depth")[..., 0], [[0, 0.25, 1]])
        assert (data_to_display(np.zeros((2, 2, 3)), "depth") == 0).all()

    @pytest.mark.parametrize("integrator", DATA_INTEGRATORS)
    def test_what_is_not_finite_is_black(self, integrator):
        bad = np.array([[[np.nan, 1, 1], [np.inf, 1, 1], [1, 1, 1]]], np.float32)
        shown = data_to_display(bad, integrator)
        assert (shown[0, :2] == 0).all()
        assert (shown[0, 2] == 1).all()
