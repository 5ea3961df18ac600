"""What it takes to prepare a scene: times are there, and bytes are those of the arrays."""

import json

import numpy as np
import pytest

from lumipath.bench.build import array_bytes, measure_build
from lumipath.cli import main
from lumipath.devices.cpu import CpuDevice
from lumipath.errors import UsageError
from lumipath.pack.scene import pack_scene
from lumipath.scene import Scene, Sphere
from lumipath.scenes import builtin


def test_figures_of_a_scene():
    scene = builtin("bench-cornell")
    figures = measure_build(scene, device="cpu", threads=1, repeat=2)
    assert (figures.scene, figures.triangles) == ("bench-cornell", 36)
    for seconds in (figures.pack_s, figures.tree_s, figures.build_s, figures.repack_s, figures.refit_s):
        assert len(seconds) == 2
        assert min(seconds) > 0
    packed = CpuDevice(1).upload(pack_scene(scene))
    assert figures.bytes["primitives"] == packed.primitives.nbytes == 36 * 16
    assert figures.bytes["accel.nodes"] == packed.accel.nodes.nbytes
    arrays = [*packed, *packed.accel]
    assert sum(figures.bytes.values()) == sum(array.nbytes for array in arrays if isinstance(array, np.ndarray))
    assert figures.bytes_per_triangle == sum(figures.bytes.values()) / 36


def test_numbers_have_no_bytes():
    assert (
        array_bytes(pack_scene(builtin("bench-cornell")).scene._replace(accel=None))
        .keys()
        .isdisjoint({"accel", "extent", "features", "triangle_count"})
    )


def test_a_scene_without_triangles_is_refused():
    with pytest.raises(UsageError, match="no triangles"):
        measure_build(Scene(shapes=[Sphere()]), device="cpu")


def test_command(capsys):
    assert main(["bench", "build", "bench-cornell", "--device", "cpu", "--repeat", "1", "--threads", "1"]) == 0
    out = capsys.readouterr().out
    for text in ("refit the tree", "accel.groups", "together", "bench-cornell: 36 triangles stored; medians of 1 on"):
        assert text in out
    assert main(["bench", "build", "bench-cornell", "--device", "cpu", "--repeat", "1", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["bytes"]["primitives"] == 576
    assert len(facts["refit_s"]) == 1
    assert main(["bench", "build", "nowhere"]) == 3
