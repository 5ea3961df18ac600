"""Where the time of a path goes: shares of stages, and rays that others see as we do."""

import json

import attrs
import numpy as np
import pytest

from lumipath.bench.profile import KINDS, STAGES, measure_profile
from lumipath.bench.throughput import PROFILE_SETTINGS
from lumipath.cli import main
from lumipath.errors import UsageError
from lumipath.scene import Scene, Sphere
from lumipath.scenes import builtin

SMALL = attrs.evolve(PROFILE_SETTINGS, width=40, height=32, spp=2, threads=2)


@pytest.fixture(scope="module")
def figures():
    return measure_profile(builtin("bench-cornell"), SMALL, repeat=2)


def test_the_stages_share_the_time(figures):
    assert tuple(figures.shares) == STAGES
    assert min(figures.shares.values()) > 0
    assert sum(figures.shares.values()) == pytest.approx(1)
    assert figures.mpaths_per_s > 0


def test_every_kind_of_rays_is_timed_as_often_as_asked(figures):
    assert tuple(rays.kind for rays in figures.rays) == KINDS
    for rays in figures.rays:
        assert len(rays.mrays_per_s) == 2
        assert min(rays.mrays_per_s) > 0


def test_embree_hits_what_we_hit(figures):
    pytest.importorskip("embreex")
    for rays in figures.rays:
        assert len(rays.embree_mrays_per_s) == 2
        assert rays.disagreeing < 1e-3


def test_without_embree_nothing_is_said_of_it(monkeypatch, capsys):
    monkeypatch.setattr("lumipath.bench.profile.find_spec", lambda name: None)
    assert main(["bench", "profile", "bench-cornell", "--size", "16x16", "-s", "1", "--repeat", "1"]) == 0
    out, err = capsys.readouterr()
    assert "camera" in out
    assert "Embree" not in out
    assert "pip install embreex" in err


def test_numbers_as_json(capsys):
    assert main(["bench", "profile", "bench-cornell", "--size", "16x16", "-s", "1", "--repeat", "1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found["shares"]) == set(STAGES)
    assert np.isfinite([number for rays in found["rays"] for number in rays["mrays_per_s"]]).all()


def test_what_cannot_be_profiled_is_refused():
    with pytest.raises(UsageError, match="has other shapes than triangles"):
        measure_profile(Scene(shapes=[Sphere()], name="ball"), SMALL)
    with pytest.raises(UsageError, match="16 x 8 pixels are less than a tile of 16 x 16"):
        measure_profile(builtin("bench-cornell"), attrs.evolve(SMALL, width=16, height=8))
    with pytest.raises(UsageError, match="the integrator depth has no stages to profile; choose path"):
        measure_profile(builtin("bench-cornell"), attrs.evolve(SMALL, integrator="depth"))
