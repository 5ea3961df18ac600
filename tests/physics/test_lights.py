"""Lights whose irradiance is known, and lights that are sampled against the same ones hit by chance."""

from __future__ import annotations

import numpy as np
import pytest
from judging import assert_same
from parts import HIDDEN, floor, hidden, moved, quad, scaled, sky, sphere_mesh, turned
from renders import renders, without_light_sampling

from lumipath.pack.sky import sky_image, sun_colour
from lumipath.scene import (
    Camera,
    Conductor,
    Cylinder,
    Dielectric,
    DirectionalLight,
    Environment,
    Instance,
    Material,
    Mesh,
    PointLight,
    Scene,
    Sky,
    Sphere,
    SpotLight,
)

WHITE = Material(diffuse=1.0)
SMALL = {"width": 16, "height": 16, "spp": 64, "seeds": 8, "max_depth": 1}
WIDTH = 1.0


# These light nothing that is seen, and make the scenes share their kernels.
FAINT = [
    SpotLight(position=(0, 1, 0), direction=(0, 1, 0), intensity=1e-9),
    DirectionalLight(direction=(0, 1, 0), colour=1e-9),
    DirectionalLight(direction=(0, 1, 0), colour=1e-9, angle=1),
]
DARK = Environment.constant(1e-18)


def from_above(*lights, environment=DARK):
    """A white floor of which the picture shows the square of side WIDTH about the origin, x to the right, -z up."""
    fov = 2 * np.degrees(np.arctan(WIDTH / 2 / 0.5))
    camera = Camera(position=(0, 0.5, 0), direction=(0, -1, 0), up=(0, 0, -1), fov=fov)
    shapes = [floor(5, material=WHITE), *hidden("quadric")]
    return Scene(shapes=shapes, lights=[*lights, *FAINT], environment=environment, cameras=[camera])


def floor_points(fine=8):
    """(16 * fine, 16 * fine, 3): points of the floor under a fine grid of the pixels."""
    across = ((np.arange(16 * fine) + 0.5) / (16 * fine) - 0.5) * WIDTH
    x, z = np.meshgrid(across, across)
    return np.stack([x, np.zeros_like(x), z], -1)


def pixels(fine):
    """Means over the pixels of values on the grid of `floor_points`, and three channels."""
    count = len(fine) // 16
    return np.repeat(fine.reshape(16, count, 16, count).mean(axis=(1, 3))[..., None], 3, axis=2)


@pytest.mark.parametrize(("inner", "outer"), [(0, 30), (15, 25), (50, 89)])
def test_the_floor_under_a_spot_is_as_bright_as_calculated(device, inner, outer):
    place, axis = np.array([0.3, 1.0, 0.1]), np.array([-0.3, -1.0, 0.1])
    light = SpotLight(position=place, direction=axis, intensity=2.0, inner_angle=inner, outer_angle=outer)
    # Fine enough for the corner of a pixel that the edge of the cone cuts off.
    to = place - floor_points(128)
    distance2 = (to**2).sum(-1)
    cosine = -(to @ axis) / np.linalg.norm(axis) / np.sqrt(distance2)
    ci, co = np.cos(np.radians([inner, outer]))
    fade = np.clip((cosine - co) / (ci - co), 0, 1) ** 2
    irradiance = 2.0 * fade * to[..., 1] / distance2**1.5
    # Enough samples that where only such a corner is lit, the scatter of means is not lopsided.
    images = renders(from_above(light), device=device, **{**SMALL, "spp": 1024})
    assert_same(images, pixels(irradiance / np.pi))


def test_the_floor_near_a_point_light_of_an_intensity_is_as_bright_as_calculated(device):
    place = np.array([0.1, 0.2, -0.1])
    to = place - floor_points(16)
    irradiance = 0.5 * to[..., 1] / (to**2).sum(-1) ** 1.5
    images = renders(from_above(PointLight(position=place, intensity=0.5)), device=device, **SMALL)
    assert_same(images, pixels(irradiance / np.pi))


def test_whitted_ray_tracing_sees_spots_points_and_suns_as_the_path_tracer_does(device):
    scene = from_above(
        SpotLight(position=(0.1, 0.8, 0.2), direction=(0.1, -1, 0), intensity=0.6, inner_angle=10, outer_angle=30),
        PointLight(position=(-0.2, 0.6, 0.1), intensity=(0.1, 0.2, 0.3)),
        DirectionalLight(direction=(0.3, -1, 0.2), colour=(0.3, 0.2, 0.1), angle=1),
    )
    path, whitted = (renders(scene, device=device, integrator=name, **SMALL) for name in ("path", "whitted"))
    assert_same(whitted, path)


@pytest.mark.parametrize("angle", [0, 0.53, 30, 100])
def test_the_irradiance_of_a_sun_does_not_depend_on_its_size(device, angle):
    height = np.radians(50)
    light = DirectionalLight(direction=(np.cos(height), -np.sin(height), 0), colour=(1, 0.5, 2), angle=angle)
    images = renders(from_above(light), device=device, **SMALL)
    # While the disc is above the horizon, as all of these are but the largest.
    if angle < 80:
        assert_same(images, np.sin(height) * np.array([1, 0.5, 2]))
    else:
        assert images.mean() > np.sin(height) * 3.5 / 3


def test_a_sun_that_fills_half_of_the_sky_is_a_constant_one(device):
    light = DirectionalLight(direction=(0, -1, 0), colour=0.7, angle=180)
    assert_same(renders(from_above(light), device=device, **SMALL), 0.7)


def test_a_sun_is_seen_with_its_radiance(device):
    light = DirectionalLight(direction=(0, 0, 1), colour=(1, 2, 3), angle=20)
    camera = Camera(fov=50)
    shapes = [floor(0.1, y=-50), *hidden("quadric")]
    scene = Scene(shapes=shapes, lights=[light, *FAINT], environment=DARK, cameras=[camera])
    images = renders(scene, device=device, **SMALL)
    radiance = np.array([1, 2, 3]) / np.sin(np.radians(10)) ** 2
    np.testing.assert_allclose(images[:, 7:9, 7:9], np.broadcast_to(radiance, (8, 2, 2, 3)), rtol=1e-5)
    assert images[:, 0].max() < 1e-8
    # Its diameter, in a picture of 2 tan(25 degrees) height.
    share = np.pi * np.tan(np.radians(10)) ** 2 / (2 * np.tan(np.radians(25))) ** 2
    assert images.mean(axis=(0, 1, 2)) == pytest.approx(radiance * share, rel=0.02)


def test_the_ground_under_a_sky_has_its_irradiance(device):
    day = Sky(elevation=40, azimuth=30)
    image = sky_image(day).astype(np.float64)
    height = np.pi / 2 - np.pi * (np.arange(256) + 0.5) / 256
    cells = np.maximum(np.sin(height), 0) * np.cos(height) * (np.pi / 256) ** 2
    expected = (image * cells[:, None, None]).sum(axis=(0, 1)) / np.pi + sun_colour(day) * np.sin(np.radians(40))
    images = renders(from_above(environment=day), device=device, **SMALL)
    assert images.mean(axis=(0, 1, 2)) == pytest.approx(expected, rel=2e-3)


# ---- equality of estimators -----------------------------------------------------------------------------------------

GLOW = Material(emission=(4.0, 3.0, 2.0), diffuse=0.3)
WALL = Material(diffuse=(0.8, 0.5, 0.3))
CORNER = Camera.look_at((0.3, 1.3, 2.6), (0, 0.5, 0), fov=60)


def corner(*shapes, **options):
    """A floor and a wall, with a block that throws a shadow."""
    wall = quad((-1, 0, -1), (1, 0, -1), (1, 2, -1), (-1, 2, -1), material=WALL)
    block = Sphere(transform=moved(0.3, 0.4, 0) @ scaled(0.3), material=Material(diffuse=0.5))
    return Scene(shapes=[floor(1.5, material=WALL), wall, block, *shapes], cameras=[CORNER], **options)


@pytest.mark.parametrize("angle", [12, 80])
def test_a_sun_that_is_sampled_shines_like_one_that_is_hit(device, angle):
    sun = DirectionalLight(direction=(-0.5, -1, -0.4), colour=(1.0, 0.8, 0.6), angle=angle)
    far = DirectionalLight(direction=(0.9, -1, -0.2), colour=(0.1, 0.3, 0.9), angle=20)
    settings = {"width": 24, "max_depth": 2, "seeds": 16, "device": device}
    scene = corner(lights=[sun, far, *FAINT], environment=sky(0.1))
    sampled = renders(scene, spp=64, **settings)
    found = renders(scene, spp=1024, first_seed=500, change=without_light_sampling, **settings)
    assert_same(sampled, found)


def test_a_sky_that_is_sampled_shines_like_one_that_is_hit(device):
    # A sun so large that directions find it by chance.
    scene = corner(lights=FAINT, environment=Sky(elevation=50, azimuth=160, sun_angle=15))
    assert scene.has_sun
    settings = {"width": 24, "max_depth": 2, "seeds": 16, "device": device}
    sampled = renders(scene, spp=64, **settings)
    found = renders(scene, spp=1024, first_seed=500, change=without_light_sampling, **settings)
    assert_same(sampled, found)


def lamps():
    """Lamps of every kind, two-sided and one-sided, near and far, over a corner."""
    lamp = np.array([(-0.5, 0.8, -0.4), (-0.3, 1.1, 0.4), (0.4, 0.9, 0.5), (0.5, 0.7, -0.4)])
    faces = [(0, 1, 2), (0, 2, 3)]
    return [
        Mesh(vertices=lamp, faces=faces, material=GLOW),
        Mesh(vertices=lamp[::-1] * (1, 1, 0.3) + (0.2, -0.6, -0.5), faces=faces, material=GLOW, two_sided=False),
        sphere_mesh(4, transform=moved(-0.6, 0.3, 0.4) @ scaled(0.2), material=GLOW, two_sided=False),
        Sphere(transform=moved(0.7, 0.3, 0.6) @ scaled(0.2), material=GLOW),
        Sphere(transform=moved(-0.8, 0.9, -0.7) @ scaled(0.1, 0.2, 0.1), material=Material(emission=(0, 0, 9.0))),
        Cylinder(transform=moved(0.8, 0.1, -0.6) @ turned("x", -70) @ scaled(0.1, 0.1, 0.4), material=GLOW),
        # Below the floor: chosen where the surface does not count, of use to nobody.
        sphere_mesh(4, transform=moved(0, -1.0, 0) @ scaled(0.3), material=Material(emission=20.0)),
    ]


def with_all_kinds(scene):
    """The scene with some of all lights and some materials, far below and faint: such scenes share their kernels."""
    small = HIDDEN @ scaled(0.01)
    twice = Sphere(material=Conductor(roughness=0.3))
    hidden_away = [
        *hidden("quadric lamp", "one-sided", "mirror", "glass"),
        Sphere(transform=small, material=Dielectric(roughness=0.4)),
        *(Instance(twice, transform=small) for _ in range(2)),
    ]
    return Scene(
        shapes=[*scene.shapes, *hidden_away],
        lights=[*scene.lights, *FAINT, PointLight(position=HIDDEN[:3, 3], colour=1e-9)],
        environment=scene.environment or DARK,
        cameras=scene.cameras,
    )


@pytest.mark.parametrize("sampling", ["tree", "power", "uniform"])
def test_many_lamps_that_are_sampled_shine_like_lamps_that_are_hit(device, sampling):
    scene = with_all_kinds(corner(*lamps(), environment=sky(0.05)))
    settings = {"width": 24, "max_depth": 3, "seeds": 16, "light_sampling": sampling, "device": device}
    sampled = renders(scene, spp=64, **settings)
    found = renders(scene, spp=512, first_seed=500, change=without_light_sampling, **settings)
    assert_same(sampled, found)


def test_the_tree_chooses_among_all_that_there_may_be_as_the_table_does(device):
    rng = np.random.default_rng(2)

    def places(count):
        # Away from surfaces, next to which the light of a point has no bound.
        return rng.uniform((-1, 1.6, -0.5), (1, 2.2, 1), (count, 3))

    lights = [
        *(PointLight(position=p, intensity=0.02) for p in places(40)),
        *(PointLight(position=p, colour=0.01) for p in places(10)),
        *(
            SpotLight(position=p, direction=d, intensity=0.1, inner_angle=5, outer_angle=a)
            for p, d, a in zip(places(40), rng.normal(size=(40, 3)), rng.uniform(10, 170, 40))
        ),
        DirectionalLight(direction=(-0.4, -1, -0.6), colour=0.3),
    ]
    metal = Conductor(reflectance=(0.9, 0.7, 0.5), roughness=0.3)
    leaf = quad((-1, -1, 0), (1, -1, 0), (1, 1, 0.5), (-1, 1, 0.5), material=metal)
    shapes = [
        *lamps(),
        Sphere(transform=moved(-0.3, 0.25, 0.8) @ scaled(0.25), material=Material(transmissive=0.9, index=1.5)),
        Sphere(transform=moved(0.1, 0.2, 1.1) @ scaled(0.2), material=Material(specular=0.8, diffuse=0.1)),
        Sphere(transform=moved(-0.7, 0.15, 0.9) @ scaled(0.15), material=Dielectric(ior=1.4, roughness=0.4)),
        *(Instance(leaf, transform=moved(x, 1.2, -0.5) @ scaled(0.2)) for x in (-0.6, 0.1, 0.7)),
        # One that shines stands alone, and is in the tree of lights.
        Instance(leaf, transform=moved(-0.9, 0.2, 0.3) @ scaled(0.1), material=GLOW),
    ]
    scene = with_all_kinds(corner(*shapes, lights=lights, environment=Environment.constant(0.05)))
    settings = {"width": 24, "max_depth": 5, "seeds": 16, "spp": 128, "device": device}
    tree = renders(scene, light_sampling="tree", **settings)
    assert_same(tree, renders(scene, first_seed=300, light_sampling="power", **settings))


def test_a_tree_makes_far_less_noise_than_a_uniform_choice_among_scattered_lamps(device):
    rng = np.random.default_rng(9)
    count = 1000
    centres = rng.uniform((-10, 0.1, -10), (10, 0.4, 10), (count, 3))
    corners = centres[:, None] + 0.03 * rng.normal(size=(count, 3, 3))
    material = [Material(emission=10 ** rng.uniform(0, 2.5)) for _ in range(8)]
    shapes = [
        Mesh(vertices=corners[k::8].reshape(-1, 3), faces=np.arange(375).reshape(-1, 3), material=material[k])
        for k in range(8)
    ]
    camera = Camera(position=(0, 6, 0), direction=(0, -1, 0), up=(0, 0, -1), fov=40)
    scene = with_all_kinds(Scene(shapes=[floor(10, material=WHITE), *shapes], cameras=[camera]))
    settings = {"width": 32, "spp": 16, "seeds": 8, "max_depth": 1, "device": device}
    lamps_seen = renders(scene, **(settings | {"max_depth": 0, "spp": 64})).max(axis=(0, 3)) > 0
    variance = {
        name: renders(scene, light_sampling=name, **settings).var(axis=0)[~lamps_seen].mean()
        for name in ("tree", "power", "uniform")
    }
    assert variance["tree"] < variance["power"] / 4
    assert variance["tree"] < variance["uniform"] / 8
