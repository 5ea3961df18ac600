"""Lights without a surface, and round ones: what arrives from them, and how they are drawn."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_calls import looped
from parts import moved, scaled, sky, turned
from scipy import stats

from lumipath.errors import SceneError
from lumipath.kernels.lights import emitter_pdf, sample_quadric_light
from lumipath.kernels.punctual import sample_point_light, sample_spot_light, sample_sun, sun_from
from lumipath.kernels.rays import Hit, Ray
from lumipath.kernels.surface import surface_at
from lumipath.lang import Vec3, i32
from lumipath.pack import layout
from lumipath.pack.scene import pack_scene
from lumipath.scene import Box, DirectionalLight, Environment, Material, PointLight, Scene, Sky, Sphere, SpotLight

ALPHA = 1e-4
COUNT = 200_000


def packed(*lights, shapes=(), **options):
    return pack_scene(Scene(shapes=shapes or [Box()], lights=lights, **options)).scene


def spot(scene, ox, oy, oz):
    found = sample_spot_light(scene, i32(0), Vec3(ox, oy, oz), 0.0, 0.0)
    return found.radiance.x, found.radiance.y, found.direction.y, found.distance, found.pdf


SPOT = looped(spot, outputs=5, scene=True)


def at_angles(degrees, distance):
    """Points below the origin, at angles from -y."""
    a = np.radians(degrees)
    return np.sin(a) * distance, -np.cos(a) * distance, np.zeros_like(a)


@pytest.mark.parametrize(("inner", "outer"), [(0, 45), (20, 30), (0.05, 0.1), (80, 150), (120, 180)])
def test_a_spot_fades_as_gltf_recommends(inner, outer):
    scene = packed(SpotLight(position=(0, 0, 0), intensity=(3, 6, 0), inner_angle=inner, outer_angle=outer))
    angles = np.linspace(0, min(1.3 * outer, 179), 200)
    red, green, _, distance, pdf = SPOT(scene, *at_angles(angles, 2.0))
    c, ci, co = (np.cos(np.radians(np.float64(a))) for a in (angles, inner, outer))
    fade = np.clip((c - co) / (ci - co), 0, 1) ** 2
    # Of a fade within a twentieth of a degree, float32 directions keep three digits.
    np.testing.assert_allclose(red, 3 * fade / 4, rtol=2e-5, atol=2e-5 if outer > 1 else 2e-3)
    np.testing.assert_allclose(green, 2 * red, rtol=1e-6)
    np.testing.assert_allclose(distance, 2, rtol=1e-6)
    assert (pdf[fade > 1e-4] == 1).all()
    assert (pdf[angles > outer * 1.01] == 0).all()


def test_a_spot_with_equal_angles_has_a_sharp_edge():
    scene = packed(SpotLight(position=(0, 0, 0), intensity=1.0, inner_angle=40, outer_angle=40))
    red = SPOT(scene, *at_angles(np.array([0, 39.99, 40.01, 90]), 1.0))[0]
    np.testing.assert_allclose(red, [1, 1, 0, 0], atol=1e-5)


def test_a_point_light_of_an_intensity_shines_alike_everywhere_and_by_the_square_of_the_distance():
    scene = packed(PointLight(position=(1, 2, 3), intensity=(4, 2, 1)))
    assert scene.features.mask == layout.SPOT_LIGHTS
    offsets = np.random.default_rng(1).normal(size=(3, 50)) * np.geomspace(1e-3, 1e3, 50)
    red, green, _, _, _ = SPOT(scene, *(np.array([[1.0], [2], [3]]) + offsets))
    # Positions are float32.
    exact = 4 / (offsets**2).sum(axis=0)
    np.testing.assert_allclose(red[10:], exact[10:], rtol=1e-4)
    np.testing.assert_allclose(green, red / 2, rtol=1e-6)


def test_a_point_light_of_a_colour_is_one_of_an_intensity_beyond_a_metre():
    def point(scene, ox, oy, oz):
        return sample_point_light(scene, i32(0), Vec3(ox, oy, oz), 0.0, 0.0).radiance.x

    places = (np.array([0.5, 1.0, 3.0]), 0.0, 0.0)
    ours = looped(point, scene=True)(packed(PointLight(position=(0, 0, 0), colour=2.0)), *places)
    theirs = SPOT(packed(PointLight(position=(0, 0, 0), intensity=2 * np.pi)), *places)[0]
    np.testing.assert_allclose(ours[1:], theirs[1:], rtol=1e-5)
    assert ours[0] == pytest.approx(2 * np.pi, rel=1e-6)
    assert theirs[0] == pytest.approx(8 * np.pi, rel=1e-6)


def sun(scene, u, v):
    s = sample_sun(scene, i32(0), Vec3(0, 0, 0), u, v)
    seen = sun_from(scene, i32(0), s.direction)
    return s.direction.x, s.direction.y, s.direction.z, s.pdf, s.radiance.x, seen.radiance.x, seen.pdf


def frame(axis):
    """An orthonormal basis with the axis last."""
    side = np.cross(axis, (0.3, 0.9, -0.2))
    side /= np.linalg.norm(side)
    return np.stack([side, np.cross(axis, side), axis])


@pytest.mark.parametrize("angle", [0.1, 0.53, 10, 90, 180])
def test_suns_are_drawn_uniformly_and_seen_where_they_are_drawn(angle):
    direction = np.array([0.48, -0.6, 0.64])
    scene = packed(DirectionalLight(direction=direction, colour=(2, 1, 1), angle=angle))
    u = np.random.default_rng(5).random((2, COUNT), np.float32)
    x, y, z, pdf, radiance, seen, seen_pdf = looped(sun, outputs=7, scene=True)(scene, *u)
    d = np.stack([x, y, z]).astype(float)
    assert np.abs(np.linalg.norm(d, axis=0) - 1).max() < 1e-6
    local = frame(-direction) @ d
    half = np.radians(angle) / 2
    # Chord squared over that of the edge, and angle: both uniform.
    chord2 = (local[0] ** 2 + local[1] ** 2 + (1 - local[2]) ** 2) / (4 * np.sin(half / 2) ** 2)
    assert chord2.max() < 1 + 2e-3
    cells = np.histogram2d(chord2, np.arctan2(local[1], local[0]), (12, 16), ((0, 1.01), (-np.pi, np.pi)))[0]
    cells = np.histogram2d(np.minimum(chord2, 1), np.arctan2(local[1], local[0]), (12, 16))[0] if angle < 1 else cells
    edges = np.linspace(0, 1 if angle < 1 else 1.01, 13)
    share = np.diff(np.minimum(edges, 1))[:, None] / 16 * np.ones(16)
    assert stats.chisquare(cells.ravel(), share.ravel() * COUNT).pvalue > ALPHA
    solid_angle = 2 * np.pi * (1 - np.cos(half))
    np.testing.assert_allclose(pdf, 1 / solid_angle, rtol=1e-3 if angle < 1 else 1e-5)
    np.testing.assert_allclose(seen_pdf, pdf)
    np.testing.assert_allclose(radiance, 2 / np.sin(half) ** 2, rtol=1e-5)
    # But for those at the very edge.
    assert (seen == radiance).mean() > 0.999
    # The irradiance is pi times the colour, whatever the size.
    irradiance = (radiance * local[2] / pdf).mean(dtype=float)
    spread = (radiance * local[2] / pdf).std(dtype=float) / np.sqrt(COUNT)
    assert irradiance == pytest.approx(2 * np.pi, rel=1e-4, abs=5 * spread)


def test_a_sun_is_not_seen_beyond_its_edge():
    scene = packed(DirectionalLight(direction=(0, -1, 0), angle=10))

    def seen(scene, x, y, z):
        return sun_from(scene, i32(0), Vec3(x, y, z)).radiance.x

    angles = np.radians([0, 4.99, 5.01, 20, 180])
    radiance = looped(seen, scene=True)(scene, np.sin(angles), np.cos(angles), 0.0)
    assert (radiance > 0).tolist() == [True, True, False, False, False]


def ball(scene, ox, oy, oz, u, v):
    o = Vec3(ox, oy, oz)
    s = sample_quadric_light(scene, i32(0), o, u, v)
    ray = Ray(o, s.direction, s.distance)
    hit = Hit(s.distance, scene.triangle_count, i32(-1))
    density = emitter_pdf(scene, ray, hit, surface_at(scene, ray, hit))
    return s.direction.x, s.direction.y, s.direction.z, s.distance, s.pdf, density


BALL = looped(ball, outputs=6, scene=True)


@pytest.mark.parametrize(
    "place", [(0.0, 0.0, 4.0), (0.9, 0.0, 0.0), (0.501, 0, 0), (30.0, -10.0, 3.0), (0.1, 0.2, 0.1)]
)
def test_round_lights_are_drawn_by_the_solid_angle_in_which_they_are_seen(place):
    transform = turned("x", 30) @ scaled(0.5)
    scene = packed(shapes=[Sphere(transform=transform, material=Material(emission=1.0))])
    assert scene.features.mask == layout.QUADRICS | layout.QUADRIC_LIGHTS | layout.ROUND_LIGHTS
    u = np.random.default_rng(6).random((2, COUNT), np.float32)
    x, y, z, distance, pdf, hit_pdf = BALL(scene, *place, *u)
    d = np.stack([x, y, z]).astype(float)
    o = np.array(place)
    points = o[:, None] + d * distance
    np.testing.assert_allclose(np.linalg.norm(points, axis=0), 0.5, rtol=1e-4)
    np.testing.assert_allclose(hit_pdf, pdf, rtol=2e-3)
    size = np.linalg.norm(o)
    if size < 0.5:
        # From inside it is seen everywhere.
        assert (1 / pdf).mean(dtype=float) == pytest.approx(4 * np.pi, rel=0.02)
        return
    local = frame(-o / size) @ d
    limit = 1 - np.sqrt(1 - (0.5 / size) ** 2)
    np.testing.assert_allclose(pdf, 1 / (2 * np.pi * limit), rtol=1e-3)
    height = (local[0] ** 2 + local[1] ** 2 + (1 - local[2]) ** 2) / 2 / limit
    # Directions to the edge are turned a little, since the shadow ray ends before the surface.
    assert height.max() < 1 + 1e-3
    cells = np.histogram2d(height, np.arctan2(local[1], local[0]), (10, 16), ((0, 1 + 1e-3), (-np.pi, np.pi)))[0]
    share = np.diff(np.minimum(np.linspace(0, 1 + 1e-3, 11), 1))[:, None] / 16 * np.ones(16)
    assert stats.chisquare(cells.ravel(), share.ravel() * COUNT).pvalue > ALPHA


def test_only_spheres_that_stay_round_are_round_lights():
    glow = Material(emission=1.0)
    flat = Sphere(transform=scaled(1, 2, 1), material=glow)
    assert not packed(shapes=[flat]).features.mask & layout.ROUND_LIGHTS
    both = packed(shapes=[flat, Sphere(transform=moved(5, 0, 0) @ turned("y", 20) @ scaled(3), material=glow)])
    assert both.features.mask & layout.ROUND_LIGHTS
    assert both.quadrics[:, 13].tolist() == [0, 1]


def test_lights_lie_in_the_order_that_the_records_promise():
    lights = [
        DirectionalLight(angle=1, colour=0.5),
        DirectionalLight(),
        SpotLight(position=(0, 1, 0)),
        PointLight(position=(0, 1, 0), intensity=1),
        PointLight(position=(0, 1, 0)),
        SpotLight(position=(0, 1, 0), intensity=0),
    ]
    scene = packed(*lights, shapes=[Box(material=Material(emission=1.0))], environment=sky())
    kinds = scene.lights.view(np.int32)[:, 3].tolist()
    assert kinds == [layout.TRIANGLE_LIGHT] * 12 + [
        layout.POINT_LIGHT,
        layout.SPOT_LIGHT,
        layout.SPOT_LIGHT,
        layout.DIRECTIONAL_LIGHT,
        layout.SUN_LIGHT,
        layout.ENVIRONMENT_LIGHT,
    ]
    assert (scene.first_delta, scene.delta_count) == (12, 5)
    assert (scene.first_sun, scene.sun_count, scene.first_infinite) == (16, 1, 15)
    assert scene.lights[:, 2].sum(dtype=float) == pytest.approx(1, abs=1e-5)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SpotLight(position=(0, 0, 0), inner_angle=50, outer_angle=40), "inner_angle is 50, more than outer"),
        (lambda: SpotLight(position=(0, 0, 0), outer_angle=0), "outer_angle is 0: it must be a number from 0.01"),
        (lambda: SpotLight(position=(0, 0, 0), direction=(0, 0, 0)), "spot light: direction is"),
        (lambda: SpotLight(position=(0, 0, 0), intensity=-1), "spot light: intensity"),
        (lambda: DirectionalLight(angle=181), "angle is 181: it must be a number from 0 to 180 degrees"),
        (lambda: PointLight(position=(0, 0, 0), intensity=1, colour=2), "intensity takes the place of colour"),
        (lambda: PointLight(position=(0, 0, 0), intensity=1, attenuation=(1, 0, 0)), "intensity takes the place"),
        (lambda: Environment.constant(-1), "environment: radiance"),
        (lambda: Environment(image=np.ones((1, 2, 3)), rotation=float("nan")), "rotation is nan"),
        (lambda: Environment(image=np.ones((1, 2, 3)), scale=-1), "scale is -1"),
        (lambda: Sky(elevation=91), "sky: elevation is 91"),
        (lambda: Sky(turbidity=True), "sky: turbidity is True"),
        (lambda: Sky(albedo=1.5), "sky: albedo"),
        (lambda: Sky.facing((0, 0, 0)), r"sky: direction is \(0, 0, 0\)"),
        (lambda: Scene(environment="sky"), "environment is a str"),
    ],
)
def test_bad_lights_are_refused(make, message):
    with pytest.raises(SceneError, match=message):
        make()


def test_a_number_turns_an_environment_about_the_vertical():
    image = np.random.default_rng(1).random((4, 8, 3))
    number = Environment(image=image, rotation=30)
    np.testing.assert_allclose(number.rotation, turned("y", 30), atol=1e-12)
    np.testing.assert_allclose(Environment.constant((1, 2, 3)).image[0, 1], (1, 2, 3))
