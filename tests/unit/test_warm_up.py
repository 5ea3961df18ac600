"""Compiling ahead."""

import pytest

from lumipath import builtin
from lumipath.errors import LumipathError
from lumipath.pack.scene import pack_scene
from lumipath.rendering.warm_up import common_scenes, warm_up
from lumipath.scenes import names


def test_the_common_scenes_have_every_set_of_features_once():
    chosen = [pack_scene(builtin(name)).scene for name in common_scenes()]
    kinds = [(scene.features.mask, len(scene.primitives) > 2000) for scene in chosen]
    assert len(set(kinds)) == len(kinds)
    everything = {pack_scene(builtin(name)).scene.features.mask for name in names() if name != "bench-blob1m"}
    assert {mask for mask, _ in kinds} == everything


def test_kernels_are_compiled_in_other_processes():
    (done,) = warm_up(["cpu"], ["bench-cornell"])
    assert (done.scene, done.device) == ("bench-cornell", "cpu")
    assert done.seconds > 0


def test_an_error_of_a_device_comes_out():
    with pytest.raises(LumipathError):
        list(warm_up(["cuda:999"], ["bench-cornell"]))
