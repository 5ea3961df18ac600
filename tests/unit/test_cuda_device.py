"""How the samples of a render are shared among GPUs, without one: stand-ins take the place of their schedulers."""

import signal
from typing import ClassVar, NamedTuple

import numpy as np
import pytest

pytest.importorskip("numba_cuda", reason="needs the extra 'cuda'")

from fake_gpus import GPUS, Gpu, HostArray, device_of, to_host

from lumipath.accel.bvh4 import gpu_tree
from lumipath.devices import open_device
from lumipath.devices.cuda import device as module
from lumipath.devices.cuda import layers as layers_module
from lumipath.devices.cuda.arguments import FILM_TYPE, LAYERS_TYPE, VIEW_TYPE, type_of
from lumipath.devices.cuda.device import CudaDevice, joint_name, slice_samples
from lumipath.devices.cuda.driver import OutOfMemoryError
from lumipath.devices.cuda.schedulers import Megakernel, Wavefront, scheduler_for
from lumipath.devices.cuda.work import item_count
from lumipath.devices.device import goals_of
from lumipath.errors import DeviceError, UsageError
from lumipath.pack import layout
from lumipath.pack.scene import pack_scene, pack_view
from lumipath.rendering.film import Film
from lumipath.rendering.layer_film import LayerFilm
from lumipath.scene import Camera
from lumipath.scenes import builtin
from lumipath.settings import RenderSettings

PLANES = 3


class Scene(NamedTuple):
    """Two of the many parts of a packed scene."""

    features: int
    lights: np.ndarray


SCENE = Scene(0, np.zeros(3))


class Scheduler:
    """Counts launches; each sample adds 1 to the last plane."""

    slice_seconds = 0.05
    least_samples = 1

    def __init__(self, during=lambda: None):
        self.launches = []
        self.scenes = []
        self.during = during

    def planes(self, view):
        return PLANES

    def run(self, scene, view, film, first, last):
        self.launches.append((first, last))
        self.scenes.append(scene)
        self.during()
        film.total[-int(view.film_height) :] += last - first
        if film.goals.size:
            rows = slice(-int(view.film_height), None)
            # As the kernels do: tiles whose goal is reached take no part.
            host = film._replace(counts=np.zeros(film.total[rows].shape[:2], np.uint32))
            film.total[rows][goals_of(host, 1 << 30) <= first] -= last - first
            film.squares[rows] = film.total[rows][..., 0]
        return 0


@pytest.fixture
def device(monkeypatch):
    made = device_of(monkeypatch)
    made._uploaded = SCENE
    made._scenes = {number: to_host(SCENE) for number in range(GPUS)}
    schedule(made, Scheduler())
    return made


def schedule(device, scheduler):
    for worker in device._workers:
        worker._scheduler = scheduler


def render(device, film, last, scene=SCENE, **settings):
    view = pack_view(Camera(), RenderSettings(width=film.width, height=film.height, **settings))
    return device.render(scene, view, film.arrays, last)


def launches(device):
    return sorted(device._workers[0]._scheduler.launches)


@pytest.mark.parametrize("settings", [{}, {"noise": 0.1, "aov": ("direct", "variance")}])
def test_kernels_are_compiled_for_what_they_are_called_with(settings):
    assert type_of(pack_view(Camera(), RenderSettings(**settings))) == VIEW_TYPE
    assert type_of(Film(4, 3, "noise" in settings, settings.get("aov", ())).arrays) == FILM_TYPE
    assert type_of(LayerFilm(["depth"], 4, 3, 8).arrays) == LAYERS_TYPE


@pytest.mark.parametrize("scene", ["cornell-box", "bench-blob100k", "cubemap"])
def test_kernels_are_compiled_for_the_scene_before_it_is_there(device, scene):
    packed = pack_scene(builtin(scene))
    draft, uploaded = device.draft(packed), device.upload(packed)
    assert type_of(draft) == type_of(uploaded) == type_of(device._scenes[0])
    assert str(type_of(draft)) == str(type_of(uploaded))


@pytest.mark.parametrize(
    ("kernel", "mask", "expected"),
    [
        ("auto", layout.TRIANGLE_LIGHTS | layout.LOBE_GLASS, Megakernel),
        ("auto", layout.CONDUCTORS, Wavefront),
        ("auto", layout.LIGHT_TREE, Wavefront),
        ("auto", layout.PRINCIPLED | layout.ADAPTIVE, Megakernel),
        ("auto", layout.PRINCIPLED | layout.VARIANCE, Megakernel),
        ("auto", layout.PRINCIPLED | layout.WHITTED, Megakernel),
        ("megakernel", layout.PRINCIPLED, Megakernel),
        ("wavefront", 0, Wavefront),
        ("wavefront", layout.ALBEDO, Megakernel),
    ],
)
def test_long_shading_gets_a_kernel_of_its_own(kernel, mask, expected):
    assert scheduler_for(mask, kernel) is expected


def test_a_tree_deeper_than_most_has_kernels_compiled_once_more(device, monkeypatch):
    packed = pack_scene(builtin("cornell-box"))
    compiled = []
    monkeypatch.setattr(module, "scheduler_for", lambda mask, kernel: lambda gpu, scene, stack: compiled.append(stack))
    device.compile(device.draft(packed), None, None)
    device.compile(device.upload(packed), None, None)
    assert compiled == [64] * len(device._workers)
    monkeypatch.setattr(module, "gpu_tree", lambda *given, **options: (*gpu_tree(*given, **options)[:2], 65))
    device.compile(device.upload(packed), None, None)
    assert compiled == [64] * len(device._workers) + [256] * len(device._workers)


def test_all_gpus_together_render_every_sample_once(device):
    film = Film(4, 3)
    list(render(device, film, 100, first_sample=1000))
    assert [sample for first, last in launches(device) for sample in range(first, last)] == list(range(1000, 1100))
    device.download(film.arrays)
    assert (film.counts == 100).all()
    assert (film.total == 100).all()
    assert sum(worker.has_sums for worker in device._workers) == 2 * GPUS


def test_a_later_pass_adds_to_the_sums_of_the_film(device):
    film = Film(4, 3)
    film.total[...] = 7
    film.counts[...] = 7
    list(render(device, film, 9))
    assert launches(device) == [(7, 8), (8, 9)]
    device.download(film.arrays)
    assert (film.total == 9).all()
    list(render(device, film, 12))
    device.download(film.arrays)
    assert (film.total == 12).all()


def test_what_changed_in_a_scene_is_brought_to_the_gpus(device):
    before = device._scenes[0].lights
    list(render(device, Film(4, 3), 1))
    list(render(device, Film(4, 3), 1, SCENE._replace(lights=np.ones(3))))
    first, second = device._workers[0]._scheduler.scenes
    assert first.lights is before
    np.testing.assert_array_equal(second.lights, 1)


def test_tiles_that_have_reached_their_goal_stay_as_they_are(device):
    film = Film(40, 20, adaptive=True)
    film.goals[...] = [[64, 32, 64], [32, 32, 64]]
    list(render(device, film, 20))
    assert (film.counts == 20).all()
    list(render(device, film, 32))
    assert (film.counts == 32).all()
    list(render(device, film, 50))
    np.testing.assert_array_equal(film.counts[::16, ::16], [[50, 32, 50], [32, 32, 50]])
    # A tile that goes on later, while others are ahead.
    film.goals[1, 0] = 48
    list(render(device, film, 1 << 30))
    device.download(film.arrays)
    np.testing.assert_array_equal(film.counts, goals_of(film.arrays, 1 << 30))
    np.testing.assert_array_equal(film.total[..., 0], film.counts)
    np.testing.assert_array_equal(film.squares, film.counts)
    list(render(device, film, 1 << 30))
    assert (film.counts.max(), film.counts.min()) == (64, 32)


def test_goals_of_all_kinds_in_one_pass(device):
    film = Film(40, 20, adaptive=True)
    film.goals[...] = [[64, 33, 64], [7, 48, 1]]
    list(render(device, film, 1 << 30))
    device.download(film.arrays)
    np.testing.assert_array_equal(film.counts, goals_of(film.arrays, 1 << 30))
    np.testing.assert_array_equal(film.total[..., 0], film.counts)
    np.testing.assert_array_equal(film.squares, film.counts)


def test_a_film_without_any_pass_stays_as_it_is(device):
    film = Film(4, 3)
    film.total[...] = 7
    device.download(film.arrays)
    assert (film.total == 7).all()


def test_a_cancelled_pass_ends_after_its_slices(device):
    film = Film(4, 3)
    work = render(device, film, 1 << 30)
    next(work)
    device.cancel()
    assert sum(work) == 0
    done = int(film.counts[0, 0])
    assert 0 < done < 1 << 30
    # The next pass is not cancelled.
    list(render(device, film, done + 1))
    device.download(film.arrays)
    assert (film.counts == done + 1).all()
    np.testing.assert_allclose(film.total, done + 1, rtol=1e-5)


def test_an_iterator_that_is_closed_leaves_true_counts(device):
    film = Film(4, 3)
    work = render(device, film, 1 << 30)
    next(work)
    work.close()
    device.download(film.arrays)
    # In float32 as on a GPU, but without the digits that it keeps apart.
    np.testing.assert_allclose(film.total[:, :, 0], film.counts, rtol=1e-5)
    assert film.counts[0, 0] > 0


def test_an_interrupt_in_a_launch_leaves_true_counts(device):
    before = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        # Only once: a second one would come when nobody waits for it any more.
        keys = [signal.SIGINT]
        schedule(device, Scheduler(during=lambda: keys and signal.raise_signal(keys.pop())))
        film = Film(4, 3)
        with pytest.raises(KeyboardInterrupt):
            list(render(device, film, 1 << 20))
    finally:
        signal.signal(signal.SIGINT, before)
    device.download(film.arrays)
    # In float32 as on a GPU, but without the digits that it keeps apart.
    np.testing.assert_allclose(film.total[:, :, 0], film.counts, rtol=1e-5)
    assert film.counts[0, 0] > 0


def test_an_error_on_a_gpu_reaches_the_caller(device):
    def fail():
        raise DeviceError("the GPU is on fire")

    film = Film(4, 3)
    schedule(device, Scheduler(during=fail))
    with pytest.raises(DeviceError, match="on fire"):
        list(render(device, film, 10))
    # The sums lack samples, so nobody gets them.
    with pytest.raises(DeviceError, match="on fire"):
        device.download(film.arrays)
    device.clear()
    film.clear()
    schedule(device, Scheduler())
    list(render(device, film, 10))
    device.download(film.arrays)
    assert (film.total == 10).all()


def test_a_gpu_without_room_for_two_sums_goes_on_with_one(device, monkeypatch):
    made = []

    def zeros(shape, dtype):
        made.append(shape)
        # Room for the arrays of sums of one worker of each GPU.
        if len(made) > 5 * GPUS:
            raise OutOfMemoryError("no room")
        return np.zeros(shape, dtype).view(HostArray)

    monkeypatch.setattr(HostArray, "zeros", zeros)
    film = Film(4, 3)
    list(render(device, film, 20))
    device.download(film.arrays)
    assert len(device._workers) == GPUS
    assert (film.total == 20).all()


def test_no_room_at_all_is_an_error(device, monkeypatch):
    def zeros(shape, dtype):
        raise OutOfMemoryError("no room")

    monkeypatch.setattr(HostArray, "zeros", zeros)
    with pytest.raises(DeviceError, match="no room"):
        list(render(device, Film(4, 3), 20))


def test_it_wants_even_counts():
    assert CudaDevice.even_counts


def test_the_first_slice_is_one_sample():
    assert slice_samples(0.0, 1000, 2) == 1


def test_slices_hold_what_is_rendered_in_their_time():
    assert slice_samples(50.0, 10**6, 2) == 50


def test_slices_are_not_made_too_short_only_because_few_samples_are_left():
    assert slice_samples(50.0, 100, 2, least=32) == 34
    assert slice_samples(50.0, 33, 2, least=32) == 33
    assert slice_samples(50.0, 20, 2, least=32) == 20
    # But they are where time is short, or where a GPU would have nothing to do.
    assert slice_samples(5.0, 100, 2, least=32) == 5
    assert slice_samples(50.0, 64, 16, gpus=8, least=32) == 8


def test_no_slice_is_left_over():
    assert slice_samples(42.0, 44, 2, least=32) == 22
    assert slice_samples(42.0, 22, 2, least=32) == 22


@pytest.mark.parametrize("workers", [1, 2, 16])
def test_slices_become_shorter_towards_the_end_and_cover_all_samples(workers):
    left, slices = 1000, []
    while left:
        slices.append(slice_samples(1e9, left, workers))
        left -= slices[-1]
    assert sum(slices) == 1000
    assert slices == sorted(slices, reverse=True)
    assert slices[-1] == 1


def test_equal_gpus_are_counted():
    assert joint_name(["H200"]) == "H200"
    assert joint_name(["H200", "H200", "A100"]) == "2 x H200, A100"


@pytest.mark.parametrize(("size", "items"), [((8, 4), 32), ((9, 4), 64), ((1, 1), 32), ((16, 5), 128)])
def test_tiles_cover_the_film(size, items):
    assert item_count(*size) == items


@pytest.mark.parametrize("name", ["cuda:", "cuda:x", "gpu", "cuda:all:1", ""])
def test_a_wrong_name_is_a_usage_error(name):
    with pytest.raises(UsageError, match="cuda:all"):
        open_device(name)


def test_a_gpu_that_is_not_there_is_an_error_that_names_those_that_are():
    with pytest.raises(DeviceError):
        open_device("cuda:999")


# ---- layers ---------------------------------------------------------------------------------------------------------


class Nothing:
    """Stands for what a GPU is needed for."""

    capability = (9, 0)
    cubin, name = b"", ""

    def __init__(self, *_):
        pass

    def wait(self):
        pass


class CountingPass(layers_module.LayerPass):
    """Adds 1 for each sample, where the kernel would."""

    launches: ClassVar[list] = []

    def _run(self, view, layers, first, last):
        self.launches.append((first, last))
        layers.sums[...] += last - first
        layers.counts[...] = last


@pytest.fixture
def layer_device(device, monkeypatch):
    for name in ("compile_layers", "Kernel", "Stream", "type_of"):
        monkeypatch.setattr(layers_module, name, Nothing)
    monkeypatch.setattr(layers_module, "DeviceArray", HostArray)
    monkeypatch.setattr(layers_module, "to_device", to_host)
    monkeypatch.setattr(module, "LayerPass", CountingPass)
    monkeypatch.setattr(Gpu, "capability", (9, 0), raising=False)
    monkeypatch.setattr(CountingPass, "launches", [])
    scene = pack_scene(builtin("bench-cornell")).scene
    device._scenes = dict.fromkeys(range(GPUS), scene)
    device.compile_layers(scene, None, None)
    return device


def layer_arrays():
    return LayerFilm(["normal", "object_id"], 4, 3, 64).arrays


def test_layers_are_filled_in_slices_and_brought_to_the_host(layer_device):
    arrays = layer_arrays()
    assert set(layer_device.render_layers(None, None, arrays, 64)) == {0}
    assert [sample for first, last in CountingPass.launches for sample in range(first, last)] == list(range(64))
    assert len(CountingPass.launches) < 64
    assert (arrays.counts == 64).all()
    assert (arrays.sums == 64).all()


@pytest.mark.parametrize("stop", ["close", "cancel"])
def test_layers_that_are_stopped_go_on_later(layer_device, stop):
    arrays = layer_arrays()
    work = layer_device.render_layers(None, None, arrays, 64)
    next(work)
    getattr(work if stop == "close" else layer_device, stop)()
    assert list(work) == []
    assert (arrays.sums == arrays.counts[..., None]).all()
    assert 0 < arrays.counts[0, 0] < 64
    list(layer_device.render_layers(None, None, arrays, 64))
    assert (arrays.sums == 64).all()
