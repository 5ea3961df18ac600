"""Whitted ray tracing of glass, its shadows, and the tree of rays, against values computed by hand."""

from __future__ import annotations

import numpy as np
import pytest
from parts import floor, hidden, moved, quad, scaled, sky
from rays_seen import NO_ATTENUATION, about, image_of, lamp, seen, wall

from lumipath.scene import Box, Camera, DirectionalLight, Material, PointLight, Scene, Sphere

# ---- glass ----------------------------------------------------------------------------------------------------------


def slab(thickness, x=0.0, z=0.0, **options):
    """Glass across the z axis."""
    return Box(transform=moved(x, 0, z) @ scaled(20, 20, thickness), material=Material(**options))


@pytest.mark.parametrize("index", [1.0, 1.5, 2.4, 0.7])
def test_glass_tints_by_the_distance_inside_and_refraction_has_the_weight_1(device, index):
    shapes = [slab(2, transmissive=(0.9, 0.5, 0.2), index=index), wall(3.0, -9)]
    assert seen(device, shapes, max_depth=2) == about(3 * 0.9**2, 3 * 0.5**2, 3 * 0.2**2)
    assert seen(device, shapes, max_depth=1) == about(0.0)


def test_light_goes_straight_through_glass_of_index_1_at_any_angle(device):
    glass = Material(transmissive=0.5)
    start, end = np.array([-6.0, 2, 4]), np.array([6.0, -2, -4])
    slabs = [Box(transform=moved(0, 0, z) @ scaled(40, 40, 0.5), material=glass) for z in (1.0, -1.0)]
    # A quarter of a metre to each side of where the straight ray arrives.
    x = end[0] * 9 / 4
    target = lamp(1.0, (x - 0.25, -9, -9), (x + 0.25, -9, -9), (x + 0.25, 9, -9), (x - 0.25, 9, -9))
    inside = 2 * 0.5 * np.linalg.norm(end - start) / 8
    assert seen(device, [*slabs, target], start=start, towards=end) == about(0.5**inside)


def test_glass_shifts_what_is_seen_through_it_by_snells_law(device):
    index, thickness, angle = 1.5, 2.0, np.radians(50)
    inner = np.arcsin(np.sin(angle) / index)
    # Where the ray that aims at the origin leaves the glass, it goes on in parallel.
    x = 4 * np.tan(angle) - 2 * np.tan(angle) + thickness * (np.tan(inner) - np.tan(angle)) + 2 * np.tan(angle)
    glass = Box(transform=scaled(60, 60, thickness), material=Material(transmissive=1.0, index=index))
    start = (-4 * np.tan(angle), 0, 4)
    for left, right, expected in ((x - 0.02, x + 0.02, 1.0), (x - 0.06, x - 0.02, 0.0), (x + 0.02, x + 0.06, 0.0)):
        target = lamp(1.0, (left, -9, -4), (right, -9, -4), (right, 9, -4), (left, 9, -4))
        assert seen(device, [glass, target], start=start) == about(expected)


def test_beyond_the_critical_angle_all_light_stays_inside(device):
    # Inside a block of glass whose face is at x = 2; sin of the critical angle is 1 / 1.5.
    camera, kt = np.array([0.0, 0.0, 0.0]), 0.8
    glow = lamp(2.0, (-1.9, -9, -6), (1.9, -9, -6), (1.9, 9, -6), (-1.9, 9, -6))

    def view(degrees, **material):
        block = Box(transform=scaled(4, 40, 40), material=Material(transmissive=kt, index=1.5, **material))
        angle = np.radians(degrees)
        towards = np.array([np.cos(angle), 0.0, -np.sin(angle)])
        options = {"start": camera, "towards": towards, "environment": sky((0, 1, 0)), "max_depth": 6}
        return seen(device, [block, glow], **options), 2 / np.cos(angle)

    # Just below the angle: out, to the sky. Beyond it: back inside, to the lamp.
    light, distance = view(41.0)
    assert light == about(0, kt**distance, 0)
    light, _ = view(60.0)
    assert light == about(2 * kt ** (6 / np.sin(np.radians(60))))
    light, _ = view(60.0, reflective=0.5)
    assert light == about(0.5 * 2 * kt ** (6 / np.sin(np.radians(60))))


def test_glass_with_reflective_adds_what_it_mirrors(device):
    shapes = [slab(1, transmissive=1.0, reflective=(0.5, 0.25, 0.125)), wall(1.0, -9), wall(8.0, 9)]
    # Seen: the front's mirror; the wall behind, and what goes to and fro between the two faces.
    kr = np.array([0.5, 0.25, 0.125])
    expected = 8 * kr
    inside = np.ones(3)
    for depth in range(2, 13):
        # Leaving at the back or at the front, after one refraction and depth - 2 inner reflections.
        expected = expected + inside * (1.0 if depth % 2 == 0 else 8.0)
        inside = inside * kr
    np.testing.assert_allclose(seen(device, shapes, max_depth=12), expected, rtol=1e-3)


def test_paint_on_glass_is_lit_from_outside_only(device):
    painted = slab(1, transmissive=1.0, diffuse=0.5)
    lights = [DirectionalLight(direction=(0, 0, -1))]
    # The front is lit; the back of the slab turns away from the light on its outside.
    assert seen(device, [painted], lights) == about(0.5)
    # From behind: first the dark side, then the lit front's paint from within.
    assert seen(device, [painted], lights, start=(0, 0, -4)) == about(0.5)


# ---- shadows --------------------------------------------------------------------------------------------------------

GROUND = floor(30, material=Material(diffuse=1.0))
DOWN = [DirectionalLight(direction=(0, -1, 0))]


def pane(y, thickness=0.5, **options):
    """A horizontal block."""
    return Box(transform=moved(0, y, 0) @ scaled(4, thickness, 4), material=Material(**options))


@pytest.mark.parametrize(
    ("shapes", "expected"),
    [
        ([], (1, 1, 1)),
        ([pane(2, diffuse=0.1)], (0, 0, 0)),
        ([pane(2, reflective=1.0)], (0, 0, 0)),
        ([pane(2, transmissive=(0.25, 0.5, 1), index=1.5)], (0.5, 0.5**0.5, 1)),
        ([pane(2, 1, transmissive=0.5), pane(4, 2, transmissive=(1, 0.5, 0.5))], (0.5, 0.125, 0.125)),
        ([pane(2, transmissive=0.5), pane(4, diffuse=0.1)], (0, 0, 0)),
        ([floor(4, y=2, two_sided=False)], (1, 1, 1)),
        ([quad((-4, 2, 4), (-4, 2, -4), (4, 2, -4), (4, 2, 4), two_sided=False)], (0, 0, 0)),
    ],
    ids=["nothing", "opaque", "mirror", "glass", "two glasses", "glass and opaque", "faces up", "faces down"],
)
def test_glass_tints_shadows_and_all_else_is_opaque(device, shapes, expected):
    assert seen(device, [GROUND, *shapes], DOWN, start=(6, 2, 0)) == about(*expected)


def test_an_oblique_shadow_is_deeper(device):
    lights = [PointLight(position=(3, 4, 0), attenuation=NO_ATTENUATION)]
    glass = Box(transform=moved(0, 2, 0) @ scaled(20, 1, 20), material=Material(transmissive=0.5, index=1.5))
    assert seen(device, [GROUND, glass], lights, start=(4, 1, 0)) == about(0.8 * 0.5 ** (5 / 4))


def test_what_is_behind_a_point_light_casts_no_shadow(device):
    lights = [PointLight(position=(0, 2, 0), attenuation=NO_ATTENUATION)]
    assert seen(device, [GROUND, pane(2.5, 0.9, diffuse=1.0)], lights, start=(6, 1, 0)) == about(1.0)


def test_a_scene_without_glass_has_the_same_shadows(device):
    scene = Scene(
        shapes=[floor(9, material=Material(diffuse=0.5)), Sphere(transform=moved(0, 2, 0))],
        lights=[PointLight(position=(0, 6, 0), attenuation=NO_ATTENUATION)],
        cameras=[Camera(position=(0, 9, 0), direction=(0, -1, 0), up=(0, 0, -1), fov=80)],
    )
    image = image_of(scene, device, width=64, spp=1)
    with_glass = Scene(shapes=[*scene.shapes, *hidden("glass")], lights=scene.lights, cameras=scene.cameras)
    np.testing.assert_allclose(image_of(with_glass, device, width=64, spp=1), image, atol=1e-5)
    dark = (image[..., 0] == 0).mean()
    # The shadow of the ball is the disc of the radius 6 tan(arcsin(1 / 4)); the ball itself hides its middle.
    shadow = np.pi * (6 / np.sqrt(15)) ** 2 / (2 * 9 * np.tan(np.radians(40))) ** 2
    assert dark == pytest.approx(shadow, rel=0.1)


# ---- the tree of rays, against recursion ----------------------------------------------------------------------------

BALLS = [
    ((0.0, 0.0, 0.0), 1.0, 1.5, 0.3, 0.8, 0.1),
    ((1.3, 0.2, -1.9), 0.9, 1.3, 0.5, 0.6, 0.2),
    ((-0.8, 0.5, -2.6), 0.7, 2.0, 0.2, 0.9, 0.4),
]
BACKGROUND = 0.7


def traced(o, d, depth):
    """What recursion gives: balls of glass under an even sky; centre, radius, index, kr, kt, emission each."""
    nearest, ball = np.inf, None
    for candidate in BALLS:
        centre, radius = np.array(candidate[0]), candidate[1]
        b, c = (o - centre) @ d, (o - centre) @ (o - centre) - radius**2
        root = b * b - c
        for t in (-b - np.sqrt(root), -b + np.sqrt(root)) if root > 0 else ():
            if 1e-9 < t < nearest:
                nearest, ball = t, candidate
    if ball is None:
        return BACKGROUND
    centre, radius, index, kr, kt, emission = ball
    p = o + d * nearest
    n = (p - np.array(centre)) / radius
    leaving = n @ d > 0
    n = -n if leaving else n
    light = emission
    if depth > 0:
        cosine = -n @ d
        mirrored = d + 2 * cosine * n
        eta = 1 / index if leaving else index
        squared = 1 - (1 - cosine**2) / eta**2
        light += kr * traced(p, mirrored, depth - 1)
        if squared > 0:
            light += traced(p, d / eta + (cosine / eta - np.sqrt(squared)) * n, depth - 1)
    return light * (kt**nearest if leaving else 1.0)


@pytest.mark.parametrize("depth", [1, 3, 7])
def test_the_tree_of_rays_is_that_of_recursion(device, depth):
    shapes = [
        Sphere(
            transform=moved(*centre) @ scaled(radius),
            material=Material(reflective=kr, transmissive=kt, index=index, emission=emission),
        )
        for centre, radius, index, kr, kt, emission in BALLS
    ]
    start = np.array([0.3, 0.4, 6.0])
    for target in ((0.1, 0.2, 0.0), (0.9, 0.1, -1.0), (-0.5, 0.6, -0.5), (0.55, -0.3, 0.0)):
        towards = np.array(target)
        direction = (towards - start) / np.linalg.norm(towards - start)
        light = seen(device, shapes, start=start, towards=towards, environment=sky(BACKGROUND), max_depth=depth)
        # Branches of a weight below 1e-4 are left out.
        assert light == pytest.approx([traced(start, direction, depth)] * 3, rel=3e-3)
