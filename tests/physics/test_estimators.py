"""Whatever the sampler, the hemisphere, the roulette or the way to find lights: the image is the same."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from judging import assert_same
from parts import floor, hidden, moved, quad, scaled, sky, sphere_mesh, turned
from renders import renders, without_light_sampling

from lumipath.scene import Camera, Cone, Cylinder, Environment, Material, Mesh, Scene, Sphere, Texture

# ---- sampler, hemisphere, roulette ----------------------------------------------------------------------------------

SETTINGS = {"width": 32, "spp": 64, "seeds": 16, "max_depth": 8}


def sun(rows=16, peak=300.0, **options):
    """A sky, brighter to one side, with a sun of one texel."""
    across = np.linspace(0.2, 0.8, 2 * rows)
    image = np.broadcast_to(across[None, :, None] * (0.6, 0.8, 1.0), (rows, 2 * rows, 3)).copy()
    image[rows // 4, rows + rows // 2] = (peak, 0.9 * peak, 0.7 * peak)
    return Environment(image=image.astype(np.float32), **options)


def still_life():
    """A diffuse corner with a mirror, a glass ball and a lacquered cylinder."""
    white, red = Material(diffuse=0.75), Material(diffuse=(0.7, 0.2, 0.1))
    wall = quad((-2, 0, -1.5), (2, 0, -1.5), (2, 3, -1.5), (-2, 3, -1.5), material=red)
    lacquer = Material(diffuse=(0.1, 0.3, 0.5), specular=0.3)
    shapes = [
        floor(3, material=white),
        wall,
        Sphere(transform=moved(-0.9, 0.6, -0.3) @ scaled(0.6), material=Material(specular=(0.9, 0.8, 0.7))),
        Sphere(
            transform=moved(0.5, 0.5, 0.4) @ scaled(0.5), material=Material(transmissive=(0.9, 1.0, 0.8), index=1.5)
        ),
        Cylinder(transform=moved(1.1, 0, -0.7) @ turned("x", -90) @ scaled(0.4, 0.4, 1.4), material=lacquer),
    ]
    camera = Camera.look_at((0, 1.6, 4.2), (0, 0.6, 0), fov=42)
    return Scene(shapes=shapes, environment=sun(peak=60.0), cameras=[camera])


@functools.cache
def reference():
    return renders(still_life(), first_seed=1000, **SETTINGS)


@pytest.mark.parametrize(
    "option",
    [
        {"hemisphere": "uniform"},
        {"sampler": "independent"},
        {"rr_depth": 4},
        {"rr_depth": 0},
        {"rr_depth": 1},
        {"rr_depth": 100},
    ],
    ids=str,
)
def test_an_option_that_only_changes_the_noise_leaves_the_image_alone(device, option):
    assert_same(renders(still_life(), device=device, **SETTINGS, **option), reference())


def test_sobol_numbers_make_less_noise_than_independent_ones(device):
    settings = {**SETTINGS, "max_depth": 1, "device": device}
    images = [renders(still_life(), sampler=name, **settings) for name in ("sobol", "independent")]
    noise = [np.median(image.std(axis=0)) for image in images]
    assert noise[0] < 0.8 * noise[1]


def test_cosine_directions_make_less_noise_than_uniform_ones_where_light_comes_from_everywhere(device):
    # A surface that lights nearly everything around it by bounces.
    scene = still_life()
    scene.environment = sky()
    noise = [
        renders(scene, device=device, hemisphere=h, change=without_light_sampling, **SETTINGS).std(axis=0).mean()
        for h in ("cosine", "uniform")
    ]
    assert noise[0] < 0.8 * noise[1]


# ---- light sampling against hitting lights by chance ----------------------------------------------------------------

PATTERN = Texture(image=np.random.default_rng(5).random((3, 4, 3)) ** 3 * 8, name="pattern")
GLOW = Material(emission=(4.0, 3.0, 2.0), diffuse=0.3)
PLACE = moved(0.1, 0.9, 0.0)
OBLIQUE = PLACE @ turned("z", 25) @ turned("x", 40)
LAMP_CORNERS = ((-0.5, 0.8, -0.4), (-0.3, 1.1, 0.4), (0.4, 0.9, 0.5), (0.5, 0.7, -0.4))
BLEND = (GLOW, Material(), Material(emission=(0, 5.0, 1.0)), Material(emission=0.5, diffuse=0.8))

LAMPS = {
    "triangle": lambda: quad(*LAMP_CORNERS, material=GLOW),
    "one-sided triangle": lambda: quad(*LAMP_CORNERS[::-1], material=GLOW, two_sided=False),
    "sphere": lambda: Sphere(transform=PLACE @ scaled(0.35), material=GLOW),
    "ellipsoid": lambda: Sphere(transform=OBLIQUE @ scaled(0.6, 0.1, 0.3), material=GLOW),
    "sheared sphere": lambda: Sphere(
        transform=OBLIQUE @ np.array([(0.3, 0.25, 0, 0), (0, 0.2, -0.1, 0), (0.1, 0, 0.4, 0), (0, 0, 0, 1)]),
        material=GLOW,
    ),
    "cylinder": lambda: Cylinder(transform=OBLIQUE @ scaled(0.2, 0.4, 0.5), material=GLOW),
    "pipe": lambda: Cylinder(transform=OBLIQUE @ scaled(0.4, 0.4, 0.3), capped=False, material=GLOW),
    "cone": lambda: Cone(transform=OBLIQUE @ scaled(0.4, 0.3, 0.6), material=GLOW),
    "truncated cone": lambda: Cone(top_radius=0.4, transform=OBLIQUE @ scaled(0.4, 0.4, 0.3), material=GLOW),
    "open cone": lambda: Cone(
        bottom_radius=0.1, top_radius=0.5, height=0.4, capped=False, transform=OBLIQUE, material=GLOW
    ),
    "textured quad": lambda: quad(*LAMP_CORNERS, uv=True, material=Material(emission=PATTERN)),
    "textured sphere": lambda: Sphere(transform=OBLIQUE @ scaled(0.4), material=Material(emission=PATTERN)),
    "textured cylinder": lambda: Cylinder(transform=OBLIQUE @ scaled(0.3), material=Material(emission=PATTERN)),
    "blended quad": lambda: Mesh(vertices=LAMP_CORNERS, faces=[(0, 1, 2), (0, 2, 3)], vertex_materials=BLEND),
    "smooth mesh": lambda: sphere_mesh(3, smooth=True, transform=PLACE @ scaled(0.4), material=GLOW),
}


def room_with(*lamps, environment=None):
    """A coloured corner around a lamp; the scene has every feature that lamps may need, so all share their kernels."""
    camera = Camera.look_at((0.3, 1.3, 2.6), (0, 0.5, 0), fov=60)
    wall = quad((-1, 0, -1), (1, 0, -1), (1, 2, -1), (-1, 2, -1), material=Material(diffuse=(0.8, 0.5, 0.3)))
    features = hidden("texture", "smooth", "blend", "one-sided", "quadric", "lamp", "quadric lamp")
    shapes = [floor(1.5, material=Material(diffuse=0.6)), wall, *lamps, *features]
    return Scene(shapes=shapes, environment=environment or sky(1e-3), cameras=[camera])


@pytest.mark.parametrize("lamp", LAMPS)
def test_lamps_that_are_sampled_shine_like_lamps_that_are_hit(device, lamp):
    settings = {"width": 24, "max_depth": 2, "seeds": 16, "device": device}
    scene = room_with(LAMPS[lamp]())
    sampled = renders(scene, spp=64, **settings)
    found = renders(scene, spp=256, first_seed=500, change=without_light_sampling, **settings)
    assert_same(sampled, found)


@pytest.mark.parametrize("turn", ["none", "about y", "all", "mirrored"])
def test_an_environment_that_is_sampled_shines_like_one_that_is_hit(device, turn):
    matrix = {
        "none": np.eye(4),
        "about y": turned("y", 77),
        "all": turned("x", 20) @ turned("y", 50) @ turned("z", 30),
        "mirrored": turned("y", 30) @ scaled(-1, 1, 1),
    }[turn]
    settings = {"width": 24, "max_depth": 2, "seeds": 16, "device": device}
    block = Sphere(transform=moved(0.1, 0.5, 0) @ scaled(0.4), material=Material(diffuse=0.5))
    scene = room_with(block, environment=sun(rotation=matrix))
    sampled = renders(scene, spp=64, **settings)
    found = renders(scene, spp=1024, first_seed=500, change=without_light_sampling, **settings)
    assert_same(sampled, found)


def test_sampling_a_small_lamp_makes_far_less_noise_than_hitting_it_by_chance(device):
    # This also shows that the tests above compare two different ways to the same image.
    scene = room_with(Sphere(transform=PLACE @ scaled(0.05), material=Material(emission=100.0)))
    settings = {"width": 24, "max_depth": 1, "spp": 16, "device": device}
    sampled, found = (renders(scene, change=change, **settings) for change in (None, without_light_sampling))
    # The edge of the lamp itself is as noisy either way.
    dark = renders(scene, **(settings | {"max_depth": 0})).max(axis=(0, 3)) < 0.1
    assert sampled.std(axis=0)[dark].mean() < 0.5 * found.std(axis=0)[dark].mean()
