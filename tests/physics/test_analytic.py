"""Scenes whose image is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from judging import assert_same
from parts import HIDDEN, floor, hidden, moved, quad, scaled, sky, sphere_mesh, turned
from renders import renders

from lumipath.scene import (
    Box,
    Camera,
    Cone,
    Cylinder,
    DirectionalLight,
    Material,
    PointLight,
    Scene,
    Sphere,
    Square,
)

SMALL = {"width": 16, "spp": 64, "seeds": 12}
INSIDE = Camera(position=(0.1, -0.2, 0.3), direction=(0.3, 0.2, 1.0), fov=80)


def shell(kind, **options):
    """The unit sphere, exact or as a fine mesh."""
    return [Sphere(**options)] if kind == "quadric" else [sphere_mesh(64, **options), *hidden("quadric")]


# ---- inside a sphere of albedo one half -----------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["quadric", "mesh"])
def test_inside_a_sphere_that_emits_half_and_reflects_half_every_pixel_is_1(device, kind):
    scene = Scene(shapes=shell(kind, material=Material(emission=0.5, diffuse=0.5)), cameras=[INSIDE])
    assert_same(renders(scene, device=device, max_depth=24, **SMALL), 1.0)


@pytest.mark.parametrize("depth", [0, 1, 2, 5])
def test_max_depth_counts_scattering_events(device, depth):
    scene = Scene(shapes=[Sphere(material=Material(emission=0.5, diffuse=0.5))], cameras=[INSIDE])
    assert_same(renders(scene, device=device, max_depth=depth, **SMALL), 1.0 - 0.5 ** (depth + 1))


@pytest.mark.parametrize("kind", ["quadric", "mesh"])
def test_inside_a_sphere_lit_by_a_point_light_at_its_centre_every_pixel_is_1(device, kind):
    # The direct light is 0.5; what is reflected once more is half of that, and so on.
    scene = Scene(
        shapes=shell(kind, material=Material(diffuse=0.5)),
        lights=[PointLight(position=(0, 0, 0), colour=1.0)],
        cameras=[INSIDE],
    )
    images = renders(scene, device=device, max_depth=24, **SMALL)
    # A light inside a polyhedron is a little nearer to its faces than 1.
    assert_same(images, 1.0) if kind == "quadric" else np.testing.assert_allclose(images.mean(0), 1.0, atol=4e-3)


def test_max_depth_of_a_point_light_counts_from_the_first_scattering(device):
    scene = Scene(
        shapes=[Sphere(material=Material(diffuse=0.5))], lights=[PointLight(position=(0, 0, 0))], cameras=[INSIDE]
    )
    assert renders(scene, device=device, max_depth=0, **SMALL).max() == 0.0
    assert_same(renders(scene, device=device, max_depth=1, **SMALL), 0.5)
    assert_same(renders(scene, device=device, max_depth=3, **SMALL), 0.875)


@pytest.mark.parametrize("lamp", ["quadric", "mesh"])
def test_inside_a_sphere_around_a_small_lamp_every_pixel_is_1(device, lamp):
    # The wall sees r^2 of the lamp's radiance and 1 - r^2 of its own, weighted by the cosine.
    r, albedo = 0.2, 0.5
    radiance = (1 - albedo * (1 - r * r)) / (albedo * r * r)
    glow = Material(emission=radiance)
    inner = Sphere(transform=scaled(r), material=glow)
    if lamp == "mesh":
        inner = sphere_mesh(48, transform=scaled(r * 1.00054), material=glow)
    camera = Camera(position=(0.0, 0.0, 0.5), direction=(0.1, 0.2, 1.0), fov=60)
    walls = Sphere(material=Material(diffuse=albedo))
    scene = Scene(shapes=[walls, inner], cameras=[camera])
    images = renders(scene, device=device, max_depth=30, **SMALL)
    assert_same(images, 1.0) if lamp == "quadric" else np.testing.assert_allclose(images.mean(), 1.0, atol=2e-3)


# ---- the furnace ----------------------------------------------------------------------------------------------------

LOBES = {
    "diffuse": Material(diffuse=1.0),
    "mirror": Material(specular=1.0),
    "diffuse and mirror": Material(diffuse=0.5, specular=0.5),
    "clear glass": Material(transmissive=1.0, index=1.5),
    "dense glass": Material(transmissive=1.0, index=2.4),
    "bubble": Material(transmissive=1.0, index=0.7),
    "nothing": Material(transmissive=1.0, index=1.0),
}
TILT = turned("y", 25) @ turned("x", -50)
PRIMITIVES = {
    "box": lambda place, m: Box(transform=place @ TILT, material=m),
    "square": lambda place, m: Square(transform=place @ TILT, material=m),
    "sphere": lambda place, m: Sphere(transform=place @ scaled(0.6), material=m),
    "ellipsoid": lambda place, m: Sphere(transform=place @ TILT @ scaled(0.7, 0.2, 0.5), material=m),
    "cylinder": lambda place, m: Cylinder(transform=place @ TILT @ scaled(0.5, 0.3, 0.8), material=m),
    "cone": lambda place, m: Cone(transform=place @ TILT @ scaled(0.6), material=m),
    "truncated cone": lambda place, m: Cone(top_radius=0.4, transform=place @ TILT @ scaled(0.6), material=m),
    "open cone": lambda place, m: Cone(top_radius=0.4, capped=False, transform=place @ TILT @ scaled(0.6), material=m),
    "mesh": lambda place, m: sphere_mesh(8, transform=place @ scaled(0.6), material=m),
}


@pytest.mark.parametrize("fresnel", ["exact", "schlick"])
@pytest.mark.parametrize("primitive", PRIMITIVES)
def test_nothing_that_keeps_all_light_is_seen_in_a_furnace(device, primitive, fresnel):
    shapes = [
        PRIMITIVES[primitive](moved(1.6 * (k % 4) - 2.4, 0.8 - 1.6 * (k // 4), 0), material)
        for k, material in enumerate(LOBES.values())
    ]
    camera = Camera(position=(0, 0, 8), fov=26, aspect=2)
    scene = Scene(shapes=[*shapes, *hidden("quadric", "mirror", "glass")], environment=sky(), cameras=[camera])
    images = renders(scene, device=device, width=64, spp=32, seeds=12, max_depth=200, fresnel=fresnel)
    assert_same(images, 1.0)


@pytest.mark.parametrize("albedo", [0.8, (0.2, 0.5, 0.9)])
def test_no_surface_gives_back_more_light_than_it_gets(device, albedo):
    # In a furnace a convex shape shows its albedo, and a hollow one less than 1.
    m = Material(diffuse=albedo)
    ball = Sphere(transform=moved(-1, 0, 0) @ scaled(0.8), material=m)
    bowl = Cone(bottom_radius=0, top_radius=0.8, height=1.2, capped=False, transform=moved(1, 0, -0.5), material=m)
    scene = Scene(
        shapes=[ball, bowl, *hidden("mirror", "glass")],
        environment=sky(),
        cameras=[Camera(position=(0, 0, 5), fov=30, aspect=2)],
    )
    images = renders(scene, device=device, width=64, spp=32, seeds=12, max_depth=100)
    assert_same(images[:, 12:20, 12:20], np.broadcast_to(albedo, 3))
    mean = images.mean(axis=0)
    assert (mean <= 1 + 6 * images.std(axis=0) / np.sqrt(12) + 1e-5).all()
    # The inside of the bowl gets less than a furnace sends.
    assert (mean[14:18, 46:50] < np.broadcast_to(albedo, 3)).all()


# ---- absorption -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", ["box", "cylinder", "mesh"])
def test_a_slab_of_index_1_absorbs_kt_to_the_power_of_its_thickness(device, shape):
    kt, thickness = np.array([0.8, 0.3, 1.0]), 2.5
    m = Material(transmissive=tuple(kt), index=1.0)
    slab = {
        "box": lambda: Box(transform=scaled(20, 20, thickness), material=m),
        "cylinder": lambda: Cylinder(transform=moved(0, 0, -1.25) @ scaled(20, 20, thickness), material=m),
        "mesh": lambda: Box(transform=turned("z", 30) @ scaled(20, 20, thickness), material=m),
    }[shape]()
    # A lens so long that every ray runs straight through.
    camera = Camera(position=(0, 0, 8), fov=0.5)
    scene = Scene(shapes=[slab, *hidden("quadric", "mirror")], environment=sky(), cameras=[camera])
    images = renders(scene, device=device, width=8, spp=16, seeds=2, max_depth=8)
    np.testing.assert_allclose(images, np.broadcast_to(kt**thickness, images.shape), rtol=3e-4)


def test_kt_of_0_lets_one_channel_through_and_stops_the_others(device):
    slab = Box(transform=scaled(20, 20, 1.0), material=Material(transmissive=(1.0, 0.0, 0.0), index=1.0))
    scene = Scene(
        shapes=[slab, *hidden("quadric", "mirror")],
        environment=sky(),
        cameras=[Camera(position=(0, 0, 30), fov=1)],
    )
    images = renders(scene, device=device, width=8, spp=48, seeds=12, max_depth=8)
    assert_same(images, (1.0, 0.0, 0.0))


# ---- lights without a size, and a square one ------------------------------------------------------------------------

DOWN = Camera(position=(0, 2, 0), direction=(0, -1, 0), up=(0, 0, -1), fov=50)


def pixel_points(camera, width):
    """(H, W, 3): where the middles of the pixels of a camera that looks straight down see the plane y = 0."""
    half = np.tan(np.radians(camera.fov) / 2)
    s = (2 * (np.arange(width) + 0.5) / width - 1) * half * camera.position[1]
    x, z = np.meshgrid(s, s)
    return np.stack([x + camera.position[0], np.zeros_like(x), z + camera.position[2]], -1)


@pytest.mark.parametrize("attenuation", [(0, 0, 1), (0.5, 0.2, 0.1), (0, 1, 0), (0.1, 0, 0)])
def test_a_point_light_gives_colour_times_attenuation_times_cosine_times_albedo(device, attenuation):
    light = PointLight(position=(0.3, 1.2, -0.2), colour=(2.0, 1.0, 0.5), attenuation=attenuation)
    scene = Scene(shapes=[floor(5, material=Material(diffuse=(0.5, 0.6, 0.7)))], lights=[light], cameras=[DOWN])
    scene.shapes += hidden("quadric")
    width = 48
    images = renders(scene, device=device, width=width, spp=64, seeds=2, max_depth=1)
    to_light = np.array(light.position) - pixel_points(DOWN, width)
    d = np.linalg.norm(to_light, axis=-1, keepdims=True)
    a, b, c = attenuation
    expected = np.minimum(1, 1 / (a + b * d + c * d * d)) * to_light[..., 1:2] / d * light.colour * (0.5, 0.6, 0.7)
    # What is left is that a pixel's mean is not the value in its middle.
    np.testing.assert_allclose(images.mean(0), expected, rtol=3e-3)


@pytest.mark.parametrize("direction", [(0, -1, 0), (1, -2, 0.5), (-3, -1, 2)])
def test_a_directional_light_gives_colour_times_cosine_times_albedo(device, direction):
    light = DirectionalLight(direction=direction, colour=(3.0, 2.0, 1.0))
    unseen = PointLight(position=HIDDEN[:3, 3], colour=1e-9)
    ground = floor(5, material=Material(diffuse=(0.5, 0.6, 0.7)))
    scene = Scene(shapes=[ground, *hidden("texture", "smooth")], lights=[light, unseen], cameras=[DOWN])
    images = renders(scene, device=device, width=8, spp=64, seeds=8, max_depth=3)
    cosine = 1 / np.linalg.norm(direction) * -direction[1]
    assert_same(images, cosine * np.array([3.0, 2.0, 1.0]) * (0.5, 0.6, 0.7))


def parallel_form_factor(p, x0, x1, z0, z1, h):
    """Form factor from points (N, 3) of a plane to the parallel rectangle at the height h (Howell, catalog, B-3)."""

    def corner(x, z):
        a, b = x / h, z / h
        ra, rb = np.sqrt(1 + a * a), np.sqrt(1 + b * b)
        return (a / ra * np.arctan(b / ra) + b / rb * np.arctan(a / rb)) / (2 * np.pi)

    x0, x1, z0, z1 = x0 - p[..., 0], x1 - p[..., 0], z0 - p[..., 2], z1 - p[..., 2]
    return corner(x1, z1) - corner(x0, z1) - corner(x1, z0) + corner(x0, z0)


@pytest.mark.parametrize("height", [0.1, 0.7, 5.0])
def test_a_square_lamp_above_a_plane_gives_albedo_times_its_form_factor(device, height):
    lamp = quad(
        (-0.6, height, -0.3), (0.5, height, -0.3), (0.5, height, 0.4), (-0.6, height, 0.4),
        material=Material(emission=(4.0, 2.0, 1.0)),
        two_sided=False,
    )  # fmt: skip
    camera = Camera(position=(0, 2, 0), direction=(0, -1, 0), up=(0, 0, -1), fov=80)
    ground = floor(5, material=Material(diffuse=0.5))
    # The lamp shines downwards only and is not there for rays from above.
    scene = Scene(shapes=[ground, lamp], cameras=[camera])
    images = renders(scene, device=device, width=32, spp=64, seeds=16, max_depth=1)
    fine = pixel_points(camera, 32 * 8)
    factor = parallel_form_factor(fine, -0.6, 0.5, -0.3, 0.4, height).reshape(32, 8, 32, 8).mean(axis=(1, 3))
    assert_same(images, 0.5 * factor[..., None] * (4.0, 2.0, 1.0))


@pytest.mark.parametrize("distance", [10.0, 1e3, 1e4])
def test_a_sphere_lamp_at_any_distance_gives_its_solid_angle(device, distance):
    lamp = Sphere(transform=moved(0, distance, 0), material=Material(emission=distance**2))
    camera = Camera(position=(0, 1, 0), direction=(0, -1, 0), up=(0, 0, -1), fov=20)
    scene = Scene(shapes=[floor(1.0, material=Material(diffuse=0.5)), lamp], cameras=[camera])
    images = renders(scene, device=device, width=8, spp=256, seeds=12, max_depth=1)
    np.testing.assert_allclose(images.mean(), 0.5, rtol=0.01)
    assert_same(images.mean(axis=(1, 2), keepdims=True), 0.5, block=1) if distance > 10 else None


@pytest.mark.parametrize("distance", [10.0, 1e3, 1e4])
def test_a_closed_box_lamp_at_any_distance_gives_the_solid_angle_of_its_front(device, distance):
    lamp = Box(transform=moved(0, distance + 0.5, 0), material=Material(emission=distance**2))
    camera = Camera(position=(0, 1, 0), direction=(0, -1, 0), up=(0, 0, -1), fov=20)
    ground = floor(0.5, material=Material(diffuse=0.5), two_sided=False)
    scene = Scene(shapes=[ground, lamp], cameras=[camera])
    images = renders(scene, device=device, width=8, spp=256, seeds=12, max_depth=1)
    np.testing.assert_allclose(images.mean(), 0.5 / np.pi, rtol=0.01)
