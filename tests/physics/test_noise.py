"""Renders that stop where their noise is low enough: the same picture, from fewer samples."""

from __future__ import annotations

import numpy as np
import pytest
from judging import ALPHA, p_value
from parts import hidden, sky
from renders import renders

import lumipath as lp
from lumipath.devices import cpu
from lumipath.devices.device import goals_of
from lumipath.errors import CheckpointError
from lumipath.rendering.checkpoint import Checkpoint
from lumipath.rendering.merging import merge
from lumipath.rendering.noise import FIRST_GOAL, tile_errors
from lumipath.rendering.session import Session
from lumipath.scenes import builtin

# More than one tile, and tiles cut off at the edges.
SIZE = {"width": 41, "height": 37, "max_depth": 5, "rr_depth": None}
NOISE = 0.15


def at(scale, *position):
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = position
    return matrix


def uneven_scene():
    """A wide plain floor, and light that a glass ball gathers on a small part of it."""
    floor = lp.Mesh(
        vertices=[(-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9)],
        faces=[(0, 1, 2), (0, 2, 3)],
        material=lp.Material(diffuse=0.7),
    )
    ball = lp.Sphere(transform=at(0.3, -1.6, 0.5, -0.6), material=lp.Material(transmissive=0.9, index=1.5))
    lamp = lp.Sphere(transform=at(0.3, -2.2, 3.0, -0.6), material=lp.Material(emission=(20, 18, 15)))
    camera = lp.Camera.look_at((0, 5, 3), (0, 0, 0), fov=45, aspect=4 / 3)
    return lp.Scene(shapes=[floor, ball, lamp], cameras=[camera], name="uneven")


def bits(film):
    return [array.tobytes() for array in film.arrays]


def session_of(scene, **settings):
    made = Session(scene, **{"noise": NOISE, **SIZE, **settings})
    made.run()
    return made


@pytest.fixture(scope="module")
def scene():
    return builtin("cornell-box")


@pytest.fixture(scope="module")
def straight(scene):
    """On the CPU, by two threads, without a stop."""
    return session_of(scene, device="cpu", threads=2)


def test_every_tile_is_good_enough_and_none_better_than_need_be(device, scene):
    film = session_of(scene, device=device).film
    errors = tile_errors(film)
    assert errors.max() < NOISE
    assert film.goals.min() < film.goals.max()
    np.testing.assert_array_equal(film.counts[::16, ::16], film.goals)
    # At the stop before, where there was one, it was not good enough: errors fall with the root of the samples.
    later = film.goals > FIRST_GOAL
    assert (errors[later] > 0.5 * NOISE).all()


@pytest.mark.parametrize("sampler", ["independent", "sobol"])
def test_the_estimate_is_the_scatter_of_renders(device, scene, sampler):
    settings = {**SIZE, "spp": 64, "noise": 1e-3, "sampler": sampler, "device": device}
    images = renders(scene, seeds=24, **settings)
    scatter = (images @ [0.2126, 0.7152, 0.0722]).std(axis=0, ddof=1)[:32, :32]
    session = Session(scene, **settings)
    session.run()
    film = session.film
    light = film.mean()[:32, :32] @ np.array([0.2126, 0.7152, 0.0722])
    of_samples = film.squares[:32, :32] / 64 - light**2
    estimate = np.sqrt(of_samples.mean() / 63)
    actual = np.sqrt((scatter**2).mean())
    if sampler == "independent":
        np.testing.assert_allclose(estimate, actual, rtol=0.15)
    else:
        # Samples that are spread evenly err less than their scatter says, never more.
        assert actual < 1.1 * estimate


TEN_SCENES = {
    **dict.fromkeys(["cornell-box", "cornell-box-glass", "cornell-box-specular", "cornell-box-transmissive"], 0.2),
    **dict.fromkeys(["primitives", "textures", "knot40k", "caustics", "many-lobes", "lights"], 0.25),
}


def sharing_kernels(name):
    """A built-in scene with what it lacks added where it brings next to nothing, so that all have the same kernels."""
    scene = builtin(name)
    scene.shapes += hidden("mirror", "glass", "texture", "smooth", "blend", "one-sided", "quadric", "lamp")
    scene.shapes += hidden("quadric lamp")
    scene.lights += [
        lp.PointLight(position=(0, -20, 0), colour=1e-9),
        lp.DirectionalLight(direction=(0, 1, 0), colour=1e-9),
    ]
    scene.environment = scene.environment or sky(1e-9)
    return scene


# All of them would take a CPU ten minutes.
SOME_SCENES = ["textures", "many-lobes"]


@pytest.mark.parametrize(
    ("device", "name"),
    [*(("cpu", name) for name in SOME_SCENES), *(("cuda", name) for name in TEN_SCENES)],
    indirect=["device"],
)
def test_the_mean_is_that_of_equal_samples(device, name):
    scene, noise = sharing_kernels(name), TEN_SCENES[name]
    settings = {"width": 32, "max_depth": 5, "device": device}
    # A limit, since light that is gathered by glass may take very many samples to be below that noise.
    adaptive = renders(scene, seeds=32, noise=noise, spp=1024, **settings)
    equal = renders(scene, seeds=24, first_seed=100, spp=192, **settings)
    assert p_value(adaptive, equal) > ALPHA


def test_where_noise_is_uneven_fewer_samples_do(device):
    scene, settings = uneven_scene(), {"width": 128, "max_depth": 5, "device": device}
    session = Session(scene, rr_depth=None, noise=0.2, **settings)
    session.run()
    samples = session.film.samples
    assert session.film.goals.max() > 8 * session.film.goals.min()
    adaptive = renders(scene, seeds=6, noise=0.2, **settings)
    more = renders(scene, seeds=6, first_seed=20, spp=round(1.5 * samples), **settings)
    mean = np.concatenate([adaptive, more]).mean(axis=0)
    errors = [float((images.var(axis=0, ddof=1) / (mean**2 + 0.01)).mean()) for images in (adaptive, more)]
    # With half as many samples again, spread evenly, the error is still larger.
    assert errors[0] < errors[1]
    assert p_value(adaptive, more) > ALPHA


@pytest.mark.parametrize("threads", [1, 3])
def test_the_number_of_threads_does_not_change_a_bit(scene, straight, threads):
    assert bits(session_of(scene, device="cpu", threads=threads).film) == bits(straight.film)


@pytest.mark.parametrize("stops", [1, 3])
def test_a_stopped_render_goes_on_to_the_same_bits(scene, straight, tmp_path, eager, stops):
    path = tmp_path / "a.ckpt"
    lagging = 0
    for _ in range(300):
        session = Session(scene, checkpoint=path, resume=True, device="cpu", threads=2, **{"noise": NOISE, **SIZE})
        number = 0
        for number, _ in enumerate(session, 1):
            if number == stops:
                break
        lagging += session.film.fewest(1 << 30) is not None
        if not number:
            break
    assert lagging, "no round was left in its middle: the test shows nothing"
    assert bits(session.film) == bits(straight.film)


def test_less_noise_may_be_asked_for_later(scene, straight, tmp_path):
    path = tmp_path / "a.ckpt"
    session_of(scene, device="cpu", noise=0.3, checkpoint=path)
    film = session_of(scene, device="cpu", checkpoint=path, resume=True).film
    assert tile_errors(film).max() < NOISE
    done = film.counts == straight.film.counts
    assert done.any()
    np.testing.assert_array_equal(film.total[done], straight.film.total[done])


def test_a_device_that_needs_even_counts_gets_them(scene, straight, tmp_path, eager, monkeypatch):
    path = tmp_path / "a.ckpt"
    session = Session(scene, device="cpu", noise=NOISE, **SIZE)
    for progress in session:
        lacking = session.film.fewest(1 << 30)
        if progress.noise and lacking is not None and len(np.unique(session.film.counts)) > 2:
            break
    session.save_checkpoint(path)
    monkeypatch.setattr(cpu.CpuDevice, "even_counts", True)
    other = Session(scene, device="cpu", noise=NOISE, **SIZE)
    other.load_checkpoint(path)
    lacking = other.film.counts < goals_of(other.film.arrays, 1 << 30)
    assert len(np.unique(other.film.counts[lacking])) <= 1
    other.run()
    np.testing.assert_array_equal(other.film.goals, straight.film.goals)
    np.testing.assert_allclose(other.film.mean(), straight.film.mean(), rtol=1e-6, atol=1e-9)


def test_a_limit_of_samples_comes_first(device, scene):
    film = session_of(scene, device=device, spp=50, noise=1e-3).film
    assert (film.counts == 50).all()
    film = session_of(scene, device=device, spp=8).film
    assert (film.counts == 8).all()


def test_with_the_limits_so_wide_that_none_stops_the_picture_is_the_usual_one(device, scene):
    ours = session_of(scene, device=device, spp=64, noise=1e-3)
    usual = Session(scene, device=device, spp=64, **SIZE)
    usual.run()
    np.testing.assert_allclose(ours.film.mean(), usual.film.mean(), rtol=2e-3, atol=1e-4)


@pytest.mark.parametrize("integrator", ["ao", "normal", "whitted"])
def test_integrators_without_paths(device, integrator):
    film = session_of(builtin("lights"), device=device, integrator=integrator, noise=0.05).film
    assert tile_errors(film).max() < 0.05
    assert film.goals.min() >= FIRST_GOAL


def test_what_is_known_of_the_image(scene, straight):
    facts = straight.image().metadata
    assert facts["noise"] == pytest.approx(float(tile_errors(straight.film).max()))
    assert facts["fewest_samples"] == straight.film.goals.min()
    assert facts["most_samples"] == straight.film.goals.max()
    progress = straight.progress()
    assert progress.noise == facts["noise"]
    assert progress.fraction == 1


def test_merging_keeps_the_estimate_where_all_have_it(scene, straight, tmp_path):
    for seed in (1, 2):
        render = session_of(scene, device="cpu", seed=seed)
        render.save_checkpoint(tmp_path / f"{seed}.ckpt")
    film = merge([tmp_path / "1.ckpt", tmp_path / "2.ckpt"]).film
    errors = tile_errors(film)
    assert errors.max() < 0.85 * NOISE


def test_a_checkpoint_without_squares_is_refused(scene, tmp_path):
    path = tmp_path / "a.ckpt"
    lp.render(scene, device="cpu", spp=2, checkpoint=path, **SIZE)
    with pytest.raises(CheckpointError, match="was rendered without noise, and cannot be gone on with it"):
        Session(scene, device="cpu", noise=NOISE, checkpoint=path, resume=True, **SIZE)


def test_going_on_without_noise_drops_the_squares(scene, straight, tmp_path):
    path = tmp_path / "a.ckpt"
    straight.save_checkpoint(path)
    assert Checkpoint.load(path).film.is_adaptive
    spp = int(straight.film.counts.max())
    session = Session(scene, device="cpu", spp=spp, checkpoint=path, resume=True, **SIZE)
    session.run()
    assert (session.film.counts == spp).all()
    assert not Checkpoint.load(path).film.is_adaptive
