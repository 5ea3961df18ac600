"""Opacity, mixes, bent normals, vertex colours, emission: against what is known, and between estimators."""

from __future__ import annotations

import numpy as np
import pytest
from judging import assert_same
from parts import floor, moved, quad, scaled, sky, sphere_mesh, with_all_surfaces
from renders import renders, without_light_sampling

from lumipath.scene import (
    Camera,
    Checker,
    Conductor,
    Cylinder,
    Diffuse,
    DirectionalLight,
    Mesh,
    Mix,
    Scene,
    Sphere,
    Texture,
)

RNG = np.random.default_rng(6)
SIZE = {"width": 24, "height": 24}
LEAF = Texture(np.concatenate([np.full((8, 8, 3), 0.5), RNG.random((8, 8, 1))], axis=2))
DOWN = Camera.look_at((0, 4, 0.001), (0, 0, 0), up=(0, 0, -1), fov=30)


def pictures(*shapes, device="cpu", environment=None, lights=(), camera=DOWN, **settings):
    """(seeds, H, W, 3): renders of a scene that shares its kernels with all others here."""
    made = Scene(shapes=list(shapes), lights=list(lights), environment=environment, cameras=[camera])
    return renders(
        with_all_surfaces(made), device=device, **SIZE, **({"spp": 16, "seeds": 12, "max_depth": 2} | settings)
    )


def sheet(y, half=3.0, **options):
    """A square that faces upwards, with texture coordinates."""
    return floor(half, y=y, uv=True, **options)


def test_light_through_a_sheet_is_what_its_opacity_leaves(device):
    # Against the sky: the camera looks up through a black sheet.
    up = Camera.look_at((0, -2, 0.001), (0, 0, 0), up=(0, 0, -1), fov=30)
    black = Diffuse(reflectance=0.0, opacity=0.3)
    images = pictures(sheet(0.0, material=black), device=device, environment=sky(2.0), camera=up, spp=64)
    assert_same(images, 2.0 * 0.7)


@pytest.mark.parametrize("cutoff", [None, 0.5])
def test_shadows_of_leaves_are_as_the_leaves(device, cutoff):
    # A sun straight above: each point of the floor sees the leaf's opacity above it, as the camera does from there.
    leaf = Diffuse(reflectance=0.0, opacity=LEAF.view("a"), alpha_cutoff=cutoff)
    ground = sheet(-0.5, material=Diffuse(reflectance=1.0))
    sun = DirectionalLight(direction=(0, -1, 0), colour=1.0)
    below = Camera.look_at((0, -0.1, 0.001), (0, -0.5, 0), up=(0, 0, -1), fov=100)
    images = pictures(
        sheet(0.0, half=0.5, material=leaf), ground, device=device, lights=[sun], camera=below, max_depth=1, spp=256
    )
    x, z = np.meshgrid((np.arange(24) + 0.5) / 24 - 0.5, (np.arange(24) + 0.5) / 24 - 0.5)
    reach = 0.4 * np.tan(np.radians(50)) * 2
    # The middles of pixels, interpolated in the same way: compare blocks away from the edge of the leaf.
    u, v = x * reach + 0.5, -(z * reach) + 0.5
    inside = (abs(u - 0.5) < 0.45) & (abs(v - 0.5) < 0.45)
    alpha = bilinear(LEAF.image[:, :, 3], u, v)
    alpha = alpha if cutoff is None else (alpha >= cutoff) * 1.0
    found = images.mean(axis=(0, 3))
    assert abs((found - (1 - alpha))[inside].mean()) < 0.01
    assert np.corrcoef(found[inside], (1 - alpha)[inside])[0, 1] > (0.99 if cutoff is None else 0.9)


def bilinear(image, u, v):
    """Repeating look-up in float64, v upwards."""
    height, width = image.shape
    x, y = u * width - 0.5, (1 - v) * height - 0.5
    column, row = np.floor(x).astype(int), np.floor(y).astype(int)
    total = 0.0
    for k in range(2):
        for j in range(2):
            weight = abs(1 - j - (x - column)) * abs(1 - k - (y - row))
            total = total + weight * image[(row + k) % height, (column + j) % width]
    return total


@pytest.mark.parametrize("shape", ["sphere", "cylinder"])
def test_both_walls_of_a_body_let_their_share_through(device, shape):
    # A black body of opacity 0.4 against the sky: its two walls leave 0.6 x 0.6.
    black = Diffuse(reflectance=0.0, opacity=0.4)
    body = Sphere(material=black) if shape == "sphere" else Cylinder(material=black, transform=moved(0, 0, -0.5))
    camera = Camera.look_at((0, 0, 6), (0, 0, 0), fov=8)
    images = pictures(body, device=device, environment=sky(), camera=camera, spp=64)
    assert_same(images, 0.36)


def test_vertex_alpha_and_colours(device):
    corners = ((-3, 0, 3), (3, 0, 3), (3, 0, -3), (-3, 0, -3))
    colours = np.array([(0.2, 0.4, 1.0, 0.5)] * 4)
    tinted = quad(*corners, material=Diffuse(reflectance=0.8, roughness=0.0), colours=colours)
    images = pictures(tinted, device=device, environment=sky(), max_depth=1, spp=64)
    # Half of the rays see the sky from the other side, straight on.
    assert_same(images, 0.5 + 0.5 * 0.8 * np.array([0.2, 0.4, 1.0]))


def test_a_mix_is_the_weighted_sum_of_its_parts(device):
    first, second = Diffuse(reflectance=(0.9, 0.2, 0.1), roughness=1.0), Conductor(metal="copper", roughness=0.4)
    weight = Checker(0.25, 0.75, 64)
    inner = Mix(first=second, second=first, weight=0.5)
    made = {
        name: pictures(sheet(0.0, material=material), device=device, environment=sunset(), max_depth=1, spp=64)
        for name, material in {
            "first": first,
            "second": second,
            "mix": Mix(first=first, second=second, weight=0.3),
            "nested": Mix(first=inner, second=Diffuse(reflectance=0.0), weight=0.2),
            "chequered": Mix(first=first, second=second, weight=weight),
        }.items()
    }
    a, b = made["first"].mean(axis=0), made["second"].mean(axis=0)
    assert_same(made["mix"], made["first"] * 0.7 + made["second"] * 0.3)
    assert_same(made["nested"], 0.4 * (made["first"] + made["second"]))
    assert made["chequered"].mean() == pytest.approx((a.mean() + b.mean()) / 2, rel=0.05)


def sunset():
    """A sky that is brighter to one side."""
    made = sky(1.0, rows=8)
    image = made.image.copy()
    image[:, :4] = (4.0, 2.0, 1.0)
    return type(made)(image=image)


PATTERN = Texture(RNG.random((3, 4, 3)) ** 3 * 8)
LAMPS = {
    "rough": lambda: Diffuse(reflectance=0.3, roughness=1.0, emission=PATTERN),
    "metal": lambda: Conductor(emission=PATTERN),
    "mix": lambda: Mix(first=Diffuse(), second=Conductor(), emission=PATTERN),
    "half": lambda: Diffuse(reflectance=0.0, emission=PATTERN, opacity=LEAF.view("a")),
    "mask": lambda: Diffuse(reflectance=0.0, emission=(4.0, 3.0, 2.0), opacity=LEAF.view("a"), alpha_cutoff=0.5),
    "bytes": lambda: Diffuse(emission=Texture(RNG.integers(0, 256, (5, 4, 3), np.uint8), factor=5, wrap="mirror")),
    "one-sided": lambda: Diffuse(emission=PATTERN, two_sided=False),
}


@pytest.mark.parametrize("shape", ["quad", "sphere"])
@pytest.mark.parametrize("lamp", LAMPS)
def test_lamps_of_all_surfaces_that_are_sampled_shine_like_those_that_are_hit(device, lamp, shape):
    place = moved(0.1, 0.9, 0.0) @ scaled(0.4)
    corners = ((-0.5, 0.8, -0.4), (-0.3, 1.1, 0.4), (0.4, 0.9, 0.5), (0.5, 0.7, -0.4))
    material = LAMPS[lamp]()
    made = (
        Sphere(transform=place, material=material) if shape == "sphere" else quad(*corners, uv=True, material=material)
    )
    shapes = [floor(1.5, material=Diffuse(reflectance=0.6)), made]
    camera = Camera.look_at((0.3, 1.3, 2.6), (0, 0.5, 0), fov=60)
    settings = {"camera": camera, "device": device, "max_depth": 1, "seeds": 16, "environment": sky(1e-3)}
    sampled = pictures(*shapes, spp=64, **settings)
    found = pictures(*shapes, spp=256, first_seed=500, change=without_light_sampling, **settings)
    assert_same(sampled, found)


def test_a_lamp_lights_itself_from_within(device):
    # The shaded point is on the sphere that it draws a point of: by rounding, now inside and now outside.
    ball = Sphere(transform=scaled(2), material=Diffuse(reflectance=0.5, roughness=0.5, emission=0.5))
    settings = {"camera": Camera(position=(0.5, 0, 0.5), fov=60), "device": device}
    found = pictures(ball, spp=64, first_seed=500, change=without_light_sampling, **settings)
    assert_same(pictures(ball, **settings), found)


def test_a_one_sided_material_is_not_there_from_behind(device):
    up = Camera.look_at((0, -2, 0.001), (0, 0, 0), up=(0, 0, -1), fov=30)
    black = Diffuse(reflectance=0.0, two_sided=False)
    assert_same(pictures(sheet(0.0, material=black), device=device, environment=sky(2.0), camera=up), 2.0)
    assert_same(pictures(sheet(0.0, material=black), device=device, environment=sky(2.0)), 0.0)


def tilted_by(angle, towards):
    """A normal map that is the same everywhere: turned by an angle towards u or v."""
    x, y = (np.sin(angle), 0) if towards == "u" else (0, np.sin(angle))
    return Texture(np.broadcast_to((np.array([x, y, np.cos(angle)]) + 1) / 2, (2, 2, 3)))


FLAT = Diffuse(reflectance=0.8)
ANGLE = np.radians(20)
SLOPE = np.tan(ANGLE)
# Heights along u and v, one metre of surface being a sixth of uv: steep as the angle, and the same again behind 1.
RAMPS = np.meshgrid((np.arange(64) + 0.5) / 64, 1 - (np.arange(64) + 0.5) / 64)


@pytest.mark.parametrize("kind", ["normals", "heights", "bytes"])
@pytest.mark.parametrize("towards", ["u", "v"])
@pytest.mark.parametrize("mirrored", [False, True], ids=["", "mirrored"])
def test_bent_normals_are_lit_like_a_bent_surface(device, kind, towards, mirrored):
    # u runs along x and v along -z; a slope that rises along u turns the normal against u.
    if kind == "heights":
        ramp = Texture(1 - RAMPS[0] if towards == "u" else 1 - RAMPS[1], wrap="clamp")
        material = Diffuse(reflectance=0.8, bump_map=ramp, bump_height=6 * SLOPE)
    else:
        image = tilted_by(ANGLE, towards).image
        image = np.rint(image * 255).astype(np.uint8) if kind == "bytes" else image
        material = Diffuse(reflectance=0.8, normal_map=Texture(image, srgb=False))
    side = -1 if mirrored else 1
    corners = ((-3, 0, 3), (3, 0, 3), (3, 0, -3), (-3, 0, -3))
    uvs = np.array([(0.0, 0), (1, 0), (1, 1), (0, 1)])
    uvs[:, 0] = uvs[:, 0] if side > 0 else 1 - uvs[:, 0]
    mesh = Mesh(vertices=corners, faces=[(0, 1, 2), (0, 2, 3)], uvs=uvs, material=material)
    n = np.array([np.sin(ANGLE) * side, np.cos(ANGLE), 0] if towards == "u" else [0, np.cos(ANGLE), -np.sin(ANGLE)])
    for direction in ((0.6, -1.0, 0.2), (-0.6, -1.0, -0.4)):
        towards_light = -np.array(direction) / np.linalg.norm(direction)
        sun = DirectionalLight(direction=direction, colour=1.0)
        bent = pictures(mesh, device=device, lights=[sun], max_depth=1, seeds=1).mean()
        # The same random numbers choose among the lights.
        flat = pictures(sheet(0.0, material=FLAT), device=device, lights=[sun], max_depth=1, seeds=1).mean()
        want = (n @ towards_light) / towards_light[1]
        assert bent / flat == pytest.approx(want, rel=0.01 if kind == "bytes" else 1e-3)


def test_a_normal_map_is_the_same_way_round_from_behind(device):
    material = Diffuse(reflectance=0.8, normal_map=tilted_by(ANGLE, "u"))
    up = Camera.look_at((0, -4, 0.001), (0, 0, 0), up=(0, 0, -1), fov=30)
    direction = np.array([0.5, 1.0, 0.1])
    sun = DirectionalLight(direction=direction, colour=1.0)
    bent, flat = (
        pictures(sheet(0.0, material=m), device=device, lights=[sun], camera=up, max_depth=1, seeds=1).mean()
        for m in (material, FLAT)
    )
    n = np.array([np.sin(ANGLE), np.cos(ANGLE), 0])
    assert bent / flat == pytest.approx((n @ direction) / direction[1], rel=1e-3)


def test_steep_normals_leave_no_black_spots_in_a_mirror(device):
    bumps = Texture(np.stack([RNG.random((16, 16)), RNG.random((16, 16)), np.full((16, 16), 0.6)], axis=2))
    metal = Conductor(reflectance=1.0, roughness=0.0, normal_map=bumps)
    low = Camera.look_at((0, 0.3, 2.5), (0, 0, 0), fov=20)
    images = pictures(sheet(0.0, half=1.5, material=metal), device=device, environment=sky(), camera=low, max_depth=4)
    assert images.mean(axis=0).min() > 0.9


@pytest.mark.parametrize("rotation", [0.0, 90.0])
@pytest.mark.parametrize("round_the_corner", [False, True], ids=["", "other triangle"])
def test_a_highlight_is_drawn_out_along_u(device, rotation, round_the_corner):
    # A small sun seen in brushed metal, from above: roughness is greater along u, so the highlight is longer there.
    metal = Conductor(reflectance=1.0, roughness=0.4, anisotropy=0.95, rotation=rotation)
    corners = ((-3, 0, 3), (3, 0, 3), (3, 0, -3), (-3, 0, -3))
    faces = [(1, 2, 3), (1, 3, 0)] if round_the_corner else [(0, 1, 2), (0, 2, 3)]
    mesh = Mesh(vertices=corners, faces=faces, uvs=[(0, 0), (1, 0), (1, 1), (0, 1)], material=metal)
    sun = DirectionalLight(direction=(0, -1, 0), colour=1.0)
    camera = Camera.look_at((0, 4, 0.001), (0, 0, 0), up=(0, 0, -1), fov=60)
    image = pictures(mesh, device=device, lights=[sun], camera=camera, max_depth=1, seeds=1).mean(axis=(0, 3))
    place = np.arange(24) - 11.5
    along, across = (np.sqrt((image * p**2).sum() / image.sum()) for p in (place[None, :], place[:, None]))
    assert (along > 1.3 * across) if rotation == 0 else (across > 1.3 * along)
    # The highlight has the symmetry of the surface: no seam between the triangles.
    np.testing.assert_allclose(image, image[:, ::-1], rtol=0.3, atol=0.02 * image.max())


def test_tangents_of_a_sphere_are_those_of_a_mesh(device):
    # u runs around the axis of either; the sphere's is z, the mesh's y.
    metal = Conductor(reflectance=1.0, roughness=0.5, anisotropy=0.95)
    turn = np.array([(1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)], float)
    mesh = sphere_mesh(64, smooth=True, material=metal)
    p = mesh.vertices
    uvs = np.stack([np.arctan2(-p[:, 2], p[:, 0]) / (2 * np.pi), np.arccos(np.clip(-p[:, 1], -1, 1)) / np.pi], axis=1)
    uvs[:, 0] %= 1.0
    made = Mesh(vertices=p, faces=mesh.faces, normals=mesh.normals, uvs=uvs, material=metal)
    camera = Camera.look_at((0, 0.5, 5), (0, 0, 0), fov=20)
    sun = DirectionalLight(direction=(-0.3, -0.5, -1), colour=1.0)
    images = [
        pictures(shape, device=device, lights=[sun], camera=camera, max_depth=1, seeds=4, spp=64).mean(axis=(0, 3))
        for shape in (Sphere(transform=turn, material=metal), made)
    ]
    inner = (slice(5, 19), slice(4, 20))
    np.testing.assert_allclose(images[0][inner], images[1][inner], atol=0.05 * images[0].max())
