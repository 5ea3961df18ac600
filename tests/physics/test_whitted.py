"""Whitted ray tracing against values computed by hand, and against the path tracer."""

from __future__ import annotations

import numpy as np
import pytest
from parts import floor, moved, quad, scaled, turned
from rays_seen import NO_ATTENUATION, about, image_of, lamp, seen, wall

from lumipath.errors import LumipathWarning
from lumipath.rendering.session import Session
from lumipath.scene import (
    AmbientLight,
    Box,
    Camera,
    DirectionalLight,
    Environment,
    Material,
    PointLight,
    Scene,
    Sphere,
    Square,
    Texture,
)
from lumipath.scenes import builtin

# ---- Phong's formula ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("degrees", [0, 30, 60])
def test_a_sphere_under_a_point_light(device, degrees):
    angle = np.radians(degrees)
    p = np.array([np.sin(angle), 0, np.cos(angle)])
    light = np.array([0.0, 0.0, 3.0])
    distance = np.linalg.norm(light - p)
    expected = 0.5 * np.array([1, 2, 3]) * (p @ (light - p)) / distance / distance**2
    ball = Sphere(material=Material(diffuse=0.5))
    lights = [PointLight(position=light, colour=(1, 2, 3))]
    assert seen(device, [ball], lights, start=p * 5, towards=p) == about(*expected)


@pytest.mark.parametrize(
    ("attenuation", "factor"),
    [((0, 0, 1), 1 / 4), ((1, 2, 3), 1 / 17), ((0, 1, 0), 1 / 2), ((0.25, 0, 0), 1.0), ((0, 0, 0.1), 1.0)],
)
def test_attenuation_never_amplifies(device, attenuation, factor):
    lights = [PointLight(position=(0, 2, 0), attenuation=attenuation)]
    ground = floor(9, material=Material(diffuse=0.5))
    assert seen(device, [ground], lights, start=(1, 4, 0)) == about(0.5 * factor)


@pytest.mark.parametrize("degrees", [0, 10, 40])
@pytest.mark.parametrize("exponent", [1.0, 20.0, 500.0])
def test_the_highlight_falls_off_by_the_angle_to_the_mirrored_light(device, degrees, exponent):
    # The viewer looks down the y axis at 45 degrees; the mirrored light is off by some degrees.
    angle = np.radians(45 + degrees)
    lights = [DirectionalLight(direction=(-np.sin(angle), -np.cos(angle), 0), colour=2.0)]
    ground = floor(9, material=Material(diffuse=0.25, specular=(0.5, 0.25, 1), shininess=exponent))
    expected = 2 * (0.25 * np.cos(angle) + np.array([0.5, 0.25, 1]) * np.cos(np.radians(degrees)) ** exponent)
    assert seen(device, [ground], lights, start=(-2, 2, 0)) == about(*expected)


def test_a_light_beyond_the_surface_gives_neither_diffuse_light_nor_a_highlight(device):
    ground = Square(transform=turned("x", -90) @ scaled(9), material=Material(diffuse=0.5, specular=1, shininess=1))
    lights = [PointLight(position=(0, -1, 0)), DirectionalLight(direction=(0, 1, 0))]
    assert seen(device, [ground], lights, start=(-2, 2, 0)) == about(0.0)


def test_ambient_lights_add_up_and_reach_everywhere(device):
    lights = [AmbientLight(colour=(0.1, 0.2, 0.3)), AmbientLight(colour=0.5)]
    ground = floor(9, material=Material(ambient=(1, 0.5, 0.25), diffuse=0.7))
    lid = floor(20, y=5, material=Material())
    assert seen(device, [ground, lid], lights, start=(1, 2, 0)) == about(0.6, 0.35, 0.2)


def test_ambient_reflection_follows_its_texture(device):
    # Four texels, bottom left 1, bottom right 2, top left 3, top right 4.
    texture = Texture(image=np.repeat([[[3.0], [4.0]], [[1.0], [2.0]]], 3, axis=2), wrap="clamp")
    ground = quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), uv=True, material=Material(ambient=texture))
    lights = [AmbientLight(colour=0.5)]
    for x, y, expected in ((-0.5, -0.5, 0.5), (0.5, -0.5, 1.0), (-0.5, 0.5, 1.5), (0.5, 0.5, 2.0), (0, 0, 1.25)):
        assert seen(device, [ground], lights, start=(x, y, 4), towards=(x, y, 0)) == about(expected)


def test_materials_of_vertices_are_blended(device):
    ends = [Material(ambient=a, specular=a, shininess=4) for a in (0.2, 0.4, 0.9)]
    lights = [AmbientLight(), DirectionalLight(direction=(0, 0, -1))]
    mesh = quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), vertex_materials=(ends[0], ends[1], ends[2], ends[0]))
    # The middle of the lower right triangle; seen from the light, so the highlight is full.
    p = (1 / 3, -1 / 3)
    assert seen(device, [mesh], lights, start=(*p, 4), towards=(*p, 0)) == about(2 * 0.5)


def test_emission_is_added_and_lights_nothing(device):
    glow = Square(transform=moved(0, 2, 0) @ turned("x", 90), material=Material(emission=100))
    ground = floor(9, material=Material(diffuse=0.5, emission=(1, 2, 3)))
    lights = [DirectionalLight(direction=(0, -1, 0))]
    assert seen(device, [ground, glow], lights, start=(4, 4, 0), towards=(3, 0, 0)) == about(1.5, 2.5, 3.5)
    assert seen(device, [ground, glow], lights, start=(4, 4, 0)) == about(1, 2, 3)


@pytest.mark.filterwarnings("default::lumipath.errors.LumipathWarning")
def test_a_scene_of_area_lamps_alone_is_dark_with_a_warning(device):
    with pytest.warns(LumipathWarning, match="no point, directional or ambient light"):
        image = image_of(builtin("cornell-box"), device, width=32, spp=4)
    lit = image.max(axis=-1) > 0
    assert 0.005 < lit.mean() < 0.05


# ---- mirrors --------------------------------------------------------------------------------------------------------

ASKEW = moved(0, 0, -3) @ turned("y", 45)


@pytest.mark.parametrize(
    "mirror",
    [
        Material(reflective=(0.5, 0.25, 1)),
        Material(specular=(0.5, 0.25, 1)),
        Material(specular=0.3, shininess=50, reflective=(0.5, 0.25, 1)),
        Material(specular=0.0, reflective=(0.5, 0.25, 1)),
    ],
    ids=["reflective", "specular without shininess", "with a highlight", "no specular"],
)
def test_a_mirror_shows_what_is_there(device, mirror):
    glow = lamp(3.0, (10, -9, -9), (10, 9, -9), (10, 9, 9), (10, -9, 9))
    shapes = [Square(transform=ASKEW @ scaled(2), material=mirror), glow]
    assert seen(device, shapes, max_depth=1) == about(1.5, 0.75, 3)
    assert seen(device, shapes, max_depth=0) == about(0.0)


def test_specular_with_shininess_is_a_highlight_and_no_mirror(device):
    glow = lamp(3.0, (10, -9, -9), (10, 9, -9), (10, 9, 9), (10, -9, 9))
    mirror = Material(specular=0.5, shininess=50)
    assert seen(device, [Square(transform=ASKEW @ scaled(2), material=mirror), glow]) == about(0.0)


def test_two_mirrors_multiply(device):
    # The first mirror sends the ray along +x, the second along -z to the wall.
    first = Square(transform=ASKEW @ scaled(2), material=Material(reflective=(0.5, 1, 1), emission=(0, 0, 0.5)))
    second = Square(
        transform=moved(6, 0, -3) @ turned("y", 45) @ scaled(2), material=Material(reflective=(0.5, 0.5, 1))
    )
    shapes = [first, second, wall((4, 4, 2), -9)]
    assert seen(device, shapes, max_depth=2) == about(1, 2, 2.5)
    assert seen(device, shapes, max_depth=1) == about(0, 0, 0.5)


def test_a_lit_surface_in_a_mirror_is_two_events_away(device):
    mirror = Square(transform=ASKEW @ scaled(2), material=Material(reflective=0.5))
    white = quad((6, -9, -9), (6, -9, 9), (6, 9, 9), (6, 9, -9), material=Material(diffuse=0.8))
    lights = [PointLight(position=(5, 0, -3), attenuation=NO_ATTENUATION)]
    assert seen(device, [mirror, white], lights, max_depth=2) == about(0.4)
    assert seen(device, [mirror, white], lights, max_depth=1) == about(0.0)
    assert seen(device, [white], lights, start=(0, 0, -3), towards=(6, 0, -3), max_depth=1) == about(0.8)
    assert seen(device, [white], lights, start=(0, 0, -3), towards=(6, 0, -3), max_depth=0) == about(0.0)


def test_two_facing_mirrors_end_at_the_greatest_depth(device):
    mirrors = [
        quad((-9, -9, -1), (9, -9, -1), (9, 9, -1), (-9, 9, -1), material=Material(emission=1.0, reflective=1.0)),
        quad((-9, -9, 5), (-9, 9, 5), (9, 9, 5), (9, -9, 5), material=Material(emission=1.0, reflective=1.0)),
    ]
    for depth in (0, 1, 7, 32):
        assert seen(device, mirrors, max_depth=depth) == about(depth + 1.0)


@pytest.mark.filterwarnings("default::lumipath.errors.LumipathWarning")
def test_the_limit_of_depth_is_said(device):
    mirrors = [
        quad((-9, -9, -1), (9, -9, -1), (9, 9, -1), (-9, 9, -1), material=Material(emission=1.0, reflective=1.0)),
        quad((-9, -9, 5), (-9, 9, 5), (9, 9, 5), (9, -9, 5), material=Material(emission=1.0, reflective=1.0)),
    ]
    with pytest.warns(LumipathWarning, match="max_depth is 40: the integrator whitted stops at 32"):
        assert seen(device, mirrors, max_depth=40) == about(33.0)


# ---- together with the path tracer ----------------------------------------------------------------------------------


def room(glow=0.0, **options):
    """Diffuse things under one light."""
    shapes = [floor(4, material=Material(diffuse=(0.8, 0.5, 0.3))), Sphere(transform=moved(0, 1, 0))]
    shapes.append(Box(transform=moved(1.5, 0.5, 1) @ turned("y", 30), material=Material(diffuse=0.5, emission=glow)))
    camera = Camera.look_at((1, 3, 7), (0, 0.5, 0), fov=50)
    return Scene(shapes=shapes, lights=[PointLight(position=(-3, 5, 3), colour=9.0)], cameras=[camera], **options)


@pytest.mark.parametrize("lens", [{}, {"aperture": 0.2, "focus": 7.0}], ids=["pinhole", "lens"])
def test_direct_light_is_that_of_the_path_tracer(device, lens):
    scene = room()
    settings = {"width": 48, "spp": 4, "max_depth": 1, **lens}
    paths = np.asarray(Session(scene, device=device, rr_depth=None, **settings).run(), np.float64)
    np.testing.assert_allclose(image_of(scene, device, **settings), paths, rtol=1e-4, atol=1e-5)


def test_lamps_and_sky_are_seen_as_by_the_path_tracer(device):
    image = np.random.default_rng(3).uniform(0, 2, (8, 16, 3)).astype(np.float32)
    scene = room(glow=0.5, environment=Environment(image=image))
    settings = {"width": 48, "spp": 4, "max_depth": 0}
    paths = np.asarray(Session(scene, device=device, rr_depth=None, **settings).run(), np.float64)
    np.testing.assert_allclose(image_of(scene, device, **settings), paths, rtol=1e-4, atol=1e-5)


# ---- passes, crops, threads -----------------------------------------------------------------------------------------

SIZE = {"width": 37, "height": 21, "max_depth": 3, "integrator": "whitted"}


def test_a_crop_is_a_part_of_the_whole(device):
    whole = np.asarray(Session(room(), device=device, spp=3, **SIZE).run())
    part = np.asarray(Session(room(), device=device, spp=3, crop=(5, 3, 30, 20), **SIZE).run())
    np.testing.assert_allclose(part, whole[3:20, 5:30], rtol=1e-5, atol=1e-6)


def test_samples_in_one_pass_or_many_and_threads_change_no_bit():
    films = []
    for threads, stops in ((1, (7,)), (2, (1, 2, 7)), (3, (4, 7))):
        session = Session(room(), device="cpu", threads=threads, spp=7, **SIZE)
        for stop in stops:
            assert list(session.device.render(session._packed, session._view, session.film.arrays, stop))[-1] == 0
        films.append(session.film.total.tobytes() + session.film.lost.tobytes() + session.film.counts.tobytes())
    assert films[0] == films[1] == films[2]


def test_a_render_that_is_stopped_has_true_counts():
    session = Session(room(), device="cpu", threads=1, spp=1 << 20, **SIZE)
    work = session.device.render(session._packed, session._view, session.film.arrays, 1 << 14)
    next(work)
    work.close()
    counts = session.film.counts
    assert set(np.unique(counts)) <= {0, 1 << 14}
    assert 0 < (counts > 0).mean() < 1
    full = np.asarray(Session(room(), device="cpu", spp=64, **SIZE).run())
    done = counts > 0
    np.testing.assert_allclose(session.film.mean()[done].mean(axis=0), full[done].mean(axis=0), rtol=0.02)
