"""Comparison with other renderers: the sums on made-up figures, and Mitsuba in earnest on a few pixels."""

from __future__ import annotations

import importlib.util
import sys

import attrs
import numpy as np
import pytest

import lumipath as lp
from lumipath.bench.compare import (
    COMPARE_SETTINGS,
    ErrorPoint,
    Result,
    Standing,
    Step,
    chosen_peers,
    compare_renderers,
    report,
)
from lumipath.bench.peers.exchange import write_exchange
from lumipath.bench.peers.process import OtherProcess, is_installed
from lumipath.errors import RenderError, UsageError

TINY = attrs.evolve(COMPARE_SETTINGS, width=24, height=24, spp=64)
needs_mitsuba = pytest.mark.skipif(not importlib.util.find_spec("mitsuba"), reason="Mitsuba is not installed")


def standing(name, speeds, points):
    return Standing(name, name, speeds, [0.5] * 3, [ErrorPoint(*point) for point in points])


def test_times_to_an_error_follow_straight_lines_of_logarithms():
    # The error falls as 1 / n, the time grows as n.
    ours = standing("lumipath", [2.0], [(4, 1.0, 1.0), (16, 0.25, 4.0), (64, 0.0625, 16.0)])
    assert ours.seconds_to(0.25) == pytest.approx(4)
    assert ours.seconds_to(0.5) == pytest.approx(2)
    assert ours.seconds_to(0.01) == pytest.approx(100)
    assert ours.seconds_to(2.0) == pytest.approx(0.5)


def test_a_result_compares_round_by_round():
    ours = standing("lumipath", [4.0, 6.0, 8.0], [(16, 0.5, 1.0), (64, 0.125, 4.0)])
    theirs = standing("other", [2.0, 2.0, 8.0], [(16, 1.0, 2.0), (64, 0.25, 8.0)])
    result = Result("a", 36, [ours, theirs])
    assert result.ratios(theirs) == [2.0, 3.0, 1.0]
    assert result.equal_error(theirs) == pytest.approx(8 / 2)
    facts = report([result], COMPARE_SETTINGS, complete=True)
    assert facts["scenes"][0]["renderers"][1]["ratio"] == 2.0
    assert "ratio" not in facts["scenes"][0]["renderers"][0]


def test_without_errors_there_is_no_time_to_equal_ones():
    result = Result("a", 36, [standing("lumipath", [1.0], []), standing("other", [1.0], [])])
    assert result.equal_error(result.standings[1]) is None


@pytest.mark.parametrize(
    ("shape", "reason"),
    [
        (lp.Sphere(), "shapes that are not meshes"),
        (lp.Square(material=lp.Material(specular=1.0)), "mirrors or glass"),
        (lp.Square(material=lp.Conductor()), "materials that are not matt"),
        (lp.Square(material=lp.Material(diffuse=lp.Texture(image=np.ones((1, 1, 3))))), "textures"),
    ],
)
def test_what_renderers_do_not_mean_alike_is_refused(shape, reason, tmp_path):
    with pytest.raises(UsageError, match=f"scene has {reason}"):
        write_exchange(tmp_path / "scene.npz", lp.Scene(shapes=[shape]), TINY)
    with pytest.raises(UsageError, match="lights that are not surfaces"):
        write_exchange(tmp_path / "scene.npz", lp.Scene(lights=[lp.PointLight(position=(0, 1, 0))]), TINY)


def test_renderers_that_are_not_there_are_named():
    with pytest.raises(UsageError, match="no renderer 'arnold' to compare with; there is mitsuba-llvm"):
        chosen_peers(["arnold"], {})
    with pytest.raises(UsageError, match="/no/python is not a Python that can be run"):
        is_installed("cycles", "/no/python")
    if not is_installed("cycles"):
        with pytest.raises(UsageError, match="cycles needs the package bpy"):
            chosen_peers(["cycles"], {})


def test_a_renderer_that_fails_says_why(monkeypatch):
    from lumipath.bench.peers import process

    monkeypatch.setitem(process.PEERS, "broken", process.Peer("x", "mitsuba_peer.py", ("no_such_variant",)))
    with pytest.raises(RenderError, match=r"broken: .+"):
        OtherProcess("broken", lp.builtin("bench-cornell"), TINY)


@needs_mitsuba
def test_mitsuba_renders_the_same_light():
    scene = lp.builtin("bench-cornell")
    items = list(
        compare_renderers(
            [scene], ["mitsuba-scalar"], TINY, rounds=2, error_size=16, reference_spp=256, pythons={"x": sys.executable}
        )
    )
    result = items[-1]
    assert all(isinstance(item, Step) for item in items[:-1])
    ours, theirs = result.standings
    np.testing.assert_allclose(ours.mean_rgb, theirs.mean_rgb, rtol=0.03)
    assert len(ours.mpaths_per_s) == len(theirs.mpaths_per_s) == 2
    for row in (ours, theirs):
        # Sixty-four times as many samples have a far lower error.
        assert row.errors[-1].mse < row.errors[0].mse / 8
        assert min(point.seconds for point in row.errors) > 0
