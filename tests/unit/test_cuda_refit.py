"""What GPUs are brought when meshes deform, without one: stand-ins take their places."""

import attrs
import numpy as np
import pytest

pytest.importorskip("numba_cuda", reason="needs the extra 'cuda'")

from fake_gpus import GPUS, Gpu, device_of, to_host

from lumipath.devices.cuda import device as module
from lumipath.devices.cuda.device import CudaDevice
from lumipath.devices.cuda.driver import OutOfMemoryError
from lumipath.errors import DeviceError
from lumipath.lang import Features
from lumipath.pack.layout import LIGHT_TREE, WIDE_TREE
from lumipath.pack.scene import pack_scene, repack_scene
from lumipath.scene import Mesh, Scene, with_meshes
from lumipath.scenes import builtin


@pytest.fixture
def device(monkeypatch):
    return device_of(monkeypatch)


def deformed(packed, before, change):
    """A scene of one mesh after `change` of its vertices (T, 3, 3), packed anew on top of what a device has made."""
    (mesh,) = before.shapes
    vertices = change(mesh.vertices.reshape(-1, 3, 3)).reshape(-1, 3)
    after = with_meshes(before, {mesh: attrs.evolve(mesh, vertices=vertices)})
    return repack_scene(after, packed, pack_scene(before).unmoved)


@pytest.mark.parametrize("count", [50, 3000])
def test_refitting_brings_only_what_has_moved(device, count):
    centres = np.random.default_rng(1).random((count, 1, 3))
    corners = centres + 0.02 * np.random.default_rng(2).random((count, 3, 3))
    before = Scene(shapes=[Mesh(vertices=corners.reshape(-1, 3), faces=np.arange(3 * count).reshape(-1, 3))])
    packed = device.upload(pack_scene(before))
    there = device._scenes[1]
    assert bool(packed.features.mask & WIDE_TREE) == (count > module.SMALL_SCENE)
    made = device.refit(deformed(packed, before, lambda corners: corners * (1, 1.1, 1)))
    links = packed.accel.nodes.view(np.int32)[:, 12:14]
    np.testing.assert_array_equal(made.accel.nodes.view(np.int32)[:, 12:14], links)
    assert made.features.mask == packed.features.mask
    for scene in device._scenes.values():
        np.testing.assert_array_equal(scene.accel.triangles, made.accel.triangles)
        np.testing.assert_array_equal(scene.primitives, made.primitives)
    assert device._scenes[1].materials is there.materials
    assert device._scenes[1].primitives is not there.primitives
    # Triangles that are all elsewhere: the tree of before is worth nothing.
    far = deformed(made, before, lambda corners: np.random.default_rng(3).permutation(corners))
    built = device.refit(far)
    want = CudaDevice(None).upload(far)
    np.testing.assert_array_equal(built.accel.nodes.view(np.int32), want.accel.nodes.view(np.int32))
    assert built.features.mask == want.features.mask


def test_where_memory_runs_out_the_frame_before_goes_on(device, monkeypatch):
    corners = np.random.default_rng(1).random((20, 3, 3))
    before = Scene(shapes=[Mesh(vertices=corners.reshape(-1, 3), faces=np.arange(60).reshape(-1, 3))])
    packed = device.upload(pack_scene(before))
    there, uploaded = dict(device._scenes), device._uploaded
    opened = []

    def short_of_memory(value):
        # The first GPU has everything by then.
        if opened[-1] == GPUS - 1:
            raise OutOfMemoryError("no memory")
        return to_host(value)

    monkeypatch.setattr(Gpu, "open", lambda gpu: opened.append(gpu.index))
    monkeypatch.setattr(module, "to_device", short_of_memory)
    with pytest.raises(DeviceError, match="no memory"):
        device.refit(deformed(packed, before, lambda corners: corners * 2))
    assert device._scenes == there
    assert device._uploaded is uploaded


def test_kernels_are_compiled_once_for_all_frames(device, monkeypatch):
    made = []
    monkeypatch.setattr(module, "scheduler_for", lambda mask, kernel: lambda *arguments: made.append(arguments))
    packed = device.upload(pack_scene(builtin("bench-cornell")))
    for _ in range(3):
        device.compile(packed, None, None)
    assert len(made) == len(device._workers)
    device.compile(packed._replace(features=Features(packed.features.mask | LIGHT_TREE)), None, None)
    assert len(made) == 2 * len(device._workers)
