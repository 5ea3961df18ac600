"""Spheres and cones: distances, normals, texture coordinates, areas and sampling, against float64."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_calls import looped
from reference_geometry import quadric_hits, rotation
from scipy import stats

from lumipath.kernels.quadrics import (
    area_scale,
    is_inside,
    normal_to_world,
    object_area,
    object_normal,
    object_uv,
    point_to_object,
    quadric_at,
    quadric_distance,
    sample_quadric,
)
from lumipath.lang import Vec3, f32, i32
from lumipath.pack.lights import object_area as packed_area
from lumipath.pack.scene import pack_scene
from lumipath.scene import Cone, Cylinder, Scene, Sphere


def _distance(scene, ox, oy, oz, dx, dy, dz, tmax):
    return quadric_distance(scene.quadrics, i32(0), Vec3(ox, oy, oz), Vec3(dx, dy, dz), tmax)


def _normal(scene, x, y, z):
    q = quadric_at(scene.quadrics, i32(0))
    p = point_to_object(q, Vec3(x, y, z))
    n = object_normal(q, p)
    w = normal_to_world(q, n)
    u, v = object_uv(q, p, n)
    return w.x, w.y, w.z, u, v, area_scale(q, n)


def _sample(scene, u, v):
    q = quadric_at(scene.quadrics, i32(0))
    s = sample_quadric(q, u, v)
    return s.p.x, s.p.y, s.p.z, s.n.x, s.n.y, s.n.z, object_area(q)


def _inside(scene, x, y, z):
    return is_inside(quadric_at(scene.quadrics, i32(0)), Vec3(x, y, z))


_insides = looped(_inside, scene=True)
_distances = looped(_distance, scene=True)
_normals = looped(_normal, outputs=6, scene=True)
_samples = looped(_sample, outputs=7, scene=True)


def packed(shape):
    return pack_scene(Scene(shapes=[shape])).scene


def distances(shape, o, d, tmax=np.inf):
    return _distances(packed(shape), *np.float32(np.transpose(o)), *np.float32(np.transpose(d)), f32(tmax))


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def tilted(*factors, seed=1):
    matrix = rotation(np.random.default_rng(seed)) @ np.diag([*factors, 1.0])
    matrix[:3, 3] = 0.3, -0.2, 0.1
    return matrix


SHAPES = {
    "sphere": lambda **o: Sphere(**o),
    "cylinder": lambda **o: Cylinder(**o),
    "pipe": lambda **o: Cylinder(capped=False, **o),
    "cone": lambda **o: Cone(**o),
    "open cone": lambda **o: Cone(capped=False, **o),
    "inverted cone": lambda **o: Cone(bottom_radius=0, top_radius=0.7, height=1.5, **o),
    "truncated cone": lambda **o: Cone(bottom_radius=1.2, top_radius=0.4, height=0.8, **o),
    "flat cone": lambda **o: Cone(bottom_radius=1.0, top_radius=0.2, height=0.05, **o),
}
TRANSFORMS = {
    "plain": np.eye(4),
    "turned": tilted(1, 1, 1),
    "stretched": tilted(0.3, 2.0, 0.8),
    "mirrored": tilted(-1, 0.5, 1),
}


@pytest.mark.parametrize("transform", TRANSFORMS)
@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("start", ["outside", "inside"])
def test_distances_are_those_of_float64(name, transform, start):
    shape = SHAPES[name](transform=TRANSFORMS[transform])
    rng = np.random.default_rng(7)
    local = rng.normal(size=(20_000, 3)) * (2.0 if start == "outside" else 0.15) + (0, 0, 0.02)
    target = rng.uniform(-1, 1, (20_000, 3))
    o, goal = (v @ shape.transform[:3, :3].T + shape.transform[:3, 3] for v in (local, target))
    o = o.astype(np.float32)
    d = unit(goal - o).astype(np.float32)
    expected, _, slack = quadric_hits(shape, o, d)
    found = distances(shape, o, d)
    clear = slack > 1e-3
    assert clear.mean() > 0.7
    np.testing.assert_array_equal(np.isfinite(found[clear]), np.isfinite(expected[clear]))
    hit = clear & np.isfinite(expected)
    assert hit.mean() > 0.1
    np.testing.assert_allclose(found[hit], expected[hit], rtol=2e-4, atol=2e-5)


@pytest.mark.parametrize("name", [name for name in SHAPES if name != "flat cone"])
@pytest.mark.parametrize("far", [1e2, 1e4])
def test_distances_from_far_away_are_as_good_as_float32_numbers_of_that_size(name, far):
    shape = SHAPES[name](transform=np.eye(4))
    rng = np.random.default_rng(8)
    o = (unit(rng.normal(size=(20_000, 3))) * far).astype(np.float32)
    d = unit(rng.uniform(-0.7, 0.7, (20_000, 3)) + (0, 0, 0.4) - o).astype(np.float32)
    expected, _, slack = quadric_hits(shape, o, d)
    # A direction in float32 wanders off by that much; the reference uses the same one.
    found = distances(shape, o, d)
    clear = slack > 3e-6 * far + 1e-3
    assert clear.mean() > 0.3
    np.testing.assert_array_equal(np.isfinite(found[clear]), np.isfinite(expected[clear]))
    hit = clear & np.isfinite(expected)
    assert hit.sum() > 1000
    assert np.abs(found[hit] - expected[hit]).max() < 4e-6 * far + 1e-4


def test_a_ray_that_touches_a_sphere_hits_near_the_point_of_contact_or_misses():
    rng = np.random.default_rng(9)
    contact = unit(rng.normal(size=(5000, 3)))
    d = unit(np.cross(contact, rng.normal(size=(5000, 3)))).astype(np.float32)
    for outside, hits in ((1 + 1e-5, False), (1 - 1e-5, True)):
        o = (contact * outside - 3 * d).astype(np.float32)
        t = distances(Sphere(), o, d)
        assert (np.isfinite(t) == hits).all()
        if hits:
            assert np.abs(t - 3).max() < 1e-2
    grazing = distances(Sphere(), (contact - 3 * d).astype(np.float32), d)
    assert np.abs(grazing[np.isfinite(grazing)] - 3).max() < 2e-3


@pytest.mark.parametrize("name", ["cylinder", "cone", "truncated cone", "pipe", "open cone"])
def test_rays_along_the_axis_and_across_it_and_along_a_side_line_are_right(name):
    shape = SHAPES[name]()
    h, slope = shape.height, (shape.top_radius - shape.bottom_radius) / shape.height
    side = unit(np.array([slope, 0.0, 1.0]))
    o = [(0.1, 0.2, -2), (0.1, 0.2, 5), (-3, 0.01, h / 2), (0, 0, h / 2), (0.05, 0, -1), *([0.1, 0.0, h / 2],) * 2]
    d = [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0, 0, 1), (0, 0, 1), tuple(side), tuple(-side)]
    expected, _, _ = quadric_hits(shape, np.float32(o), np.float32(d))
    found = distances(shape, o, d)
    np.testing.assert_array_equal(np.isfinite(found), np.isfinite(expected))
    hit = np.isfinite(expected)
    np.testing.assert_allclose(found[hit], expected[hit], rtol=1e-4)


def test_hits_lie_between_0_and_tmax():
    o, d = [(0, 0, 3)] * 4, [(0, 0, -1)] * 4
    assert distances(Sphere(), o[:1], d[:1], 1.99)[0] == np.inf
    assert distances(Sphere(), o[:1], d[:1], 2.01)[0] == pytest.approx(2)
    assert distances(Cylinder(), o[:1], d[:1], 1.99)[0] == np.inf
    assert distances(Cylinder(), o[:1], d[:1], 2.01)[0] == pytest.approx(2)
    assert distances(Sphere(), o[:1], [(0, 0, 1)])[0] == np.inf
    assert distances(Cylinder(), o[:1], [(0, 0, 1)])[0] == np.inf


def surface_points(shape, count=20_000):
    """Hits by float64: world points (N, 3), object points (N, 3), parts (N,)."""
    rng = np.random.default_rng(10)
    o = rng.normal(size=(count, 3)) * 3
    d = unit(rng.uniform(-1, 1, (count, 3)) + (0, 0, 0.3) - o)
    m = shape.transform
    o, d = o @ m[:3, :3].T + m[:3, 3], d @ m[:3, :3].T
    t, part, _ = quadric_hits(shape, o, d)
    hit = np.isfinite(t)
    p = o[hit] + t[hit, None] * d[hit]
    return p, (p - m[:3, 3]) @ np.linalg.inv(m[:3, :3]).T, part[hit]


def object_normals(shape, p, part):
    """Outward unit normals in object space."""
    if isinstance(shape, Sphere):
        return unit(p)
    slope = (shape.top_radius - shape.bottom_radius) / shape.height
    r = np.hypot(p[:, 0], p[:, 1])
    mantle = unit(np.stack([p[:, 0] / r, p[:, 1] / r, np.full(len(p), -slope)], 1))
    return np.where(part[:, None] == 0, mantle, np.where(part[:, None] == 1, (0, 0, -1), (0, 0, 1)))


@pytest.mark.parametrize("transform", TRANSFORMS)
@pytest.mark.parametrize("name", SHAPES)
def test_normals_point_outwards_and_areas_scale_as_the_surface_does(name, transform):
    shape = SHAPES[name](transform=TRANSFORMS[transform])
    p, local, part = surface_points(shape)
    n = object_normals(shape, local, part)
    inverse = np.linalg.inv(shape.transform[:3, :3])
    expected = unit(n @ inverse)
    x, y, z, u, v, scale = _normals(packed(shape), *np.float32(p.T))
    found = unit(np.stack([x, y, z], 1).astype(float))
    # Rims belong to both parts.
    clear = np.ones(len(p), bool)
    if not isinstance(shape, Sphere):
        r = np.hypot(local[:, 0], local[:, 1])
        off_rim = np.minimum(np.abs(local[:, 2]), np.abs(local[:, 2] - shape.height)) + np.where(
            part == 0, 0, np.abs(r - np.where(part == 1, shape.bottom_radius, shape.top_radius))
        )
        clear = (off_rim > 1e-4) & (r > 1e-3)
    assert clear.mean() > 0.9
    assert (np.sum(found * expected, axis=1)[clear] > 1 - 1e-6).all()
    determinant = abs(np.linalg.det(shape.transform[:3, :3]))
    np.testing.assert_allclose(scale[clear], (determinant * np.linalg.norm(n @ inverse, axis=1))[clear], rtol=1e-3)
    assert ((u >= 0) & (u <= 1) & (v >= -1e-6) & (v <= 1 + 1e-6)).all()


@pytest.mark.parametrize("name", SHAPES)
def test_texture_coordinates_run_around_the_axis_and_along_it(name):
    shape = SHAPES[name](transform=np.eye(4))
    p, local, part = surface_points(shape)
    u, v = _normals(packed(shape), *np.float32(p.T))[3:5]
    around = np.arctan2(local[:, 1], local[:, 0]) / (2 * np.pi) % 1
    mantle = part == 0
    difference = np.abs(u - around)
    assert np.minimum(difference, 1 - difference)[mantle & (np.hypot(local[:, 0], local[:, 1]) > 1e-2)].max() < 1e-4
    along = 1 - np.arccos(np.clip(local[:, 2], -1, 1)) / np.pi if name == "sphere" else local[:, 2] / shape.height
    np.testing.assert_allclose(v[mantle], along[mantle], atol=5e-4)


@pytest.mark.parametrize("name", SHAPES)
def test_areas_are_those_of_geometry(name):
    shape = SHAPES[name]()
    area = _samples(packed(shape), np.float32([0.5]), np.float32([0.5]))[6, 0]
    if name == "sphere":
        expected = 4 * np.pi
    else:
        b, t, h = shape.bottom_radius, shape.top_radius, shape.height
        expected = np.pi * (b + t) * np.hypot(h, b - t) + (np.pi * (b * b + t * t) if shape.capped else 0)
    assert area == pytest.approx(expected, rel=1e-5)
    assert packed_area(shape) == pytest.approx(expected)


@pytest.mark.parametrize("name", SHAPES)
def test_sampled_points_lie_on_the_surface_with_even_density_and_with_its_normals(name):
    shape = SHAPES[name]()
    u = np.random.default_rng(11).random((2, 200_000), np.float32)
    found = _samples(packed(shape), *u).astype(float)
    p, n = found[:3].T, found[3:6].T
    np.testing.assert_allclose(np.linalg.norm(n, axis=1), 1, atol=1e-5)
    around = np.arctan2(p[:, 1], p[:, 0])
    if name == "sphere":
        np.testing.assert_allclose(np.linalg.norm(p, axis=1), 1, atol=1e-6)
        np.testing.assert_allclose(n, p, atol=1e-6)
        cells = [np.histogram2d(p[:, 2], around, (16, 16))[0]]
        areas = [4 * np.pi]
    else:
        b, t, h = shape.bottom_radius, shape.top_radius, shape.height
        part = np.where(n[:, 2] == -1, 1, np.where(n[:, 2] == 1, 2, 0))
        r = np.hypot(p[:, 0], p[:, 1])
        mantle = part == 0
        np.testing.assert_allclose(r[mantle], (b + (t - b) / h * p[:, 2])[mantle], atol=2e-6)
        assert (np.sum(n * object_normals(shape, p, part), axis=1)[(r > 1e-4) | ~mantle] > 1 - 1e-6).all()
        assert (p[part == 1, 2] == 0).all()
        np.testing.assert_allclose(p[part == 2, 2], h, rtol=1e-6)
        # Equal areas of the mantle: by the square of the radius, or by height for a cylinder.
        z = p[mantle, 2] / h
        even = (b * z + (t - b) / 2 * z * z) / ((b + t) / 2)
        assert even.min() > -1e-5
        assert even.max() < 1 + 1e-5
        cells = [np.histogram2d(np.clip(even, 0, 1), around[mantle], (12, 16), ((0, 1), (-np.pi, np.pi)))[0]]
        areas = [np.pi * (b + t) * np.hypot(h, b - t)]
        for number, radius in ((1, b), (2, t)):
            if shape.capped and radius > 0:
                square = np.clip((r[part == number] / radius) ** 2, 0, 1)
                edges = ((0, 1), (-np.pi, np.pi))
                cells.append(np.histogram2d(square, around[part == number], (8, 16), edges)[0])
                areas.append(np.pi * radius**2)
    total = np.concatenate([c.ravel() for c in cells])
    assert total.sum() == len(p)
    expected = np.concatenate([np.full(c.size, a / c.size) for c, a in zip(cells, areas)]) / sum(areas) * len(p)
    assert stats.chisquare(total, expected).pvalue > 1e-4


@pytest.mark.parametrize("name", ["sphere", "cylinder", "truncated cone"])
def test_points_of_the_surface_are_inside_however_they_are_rounded_and_those_beyond_are_not(name):
    # A lamp is lit by its own far side wherever one is within it.
    scene = packed(SHAPES[name]())
    x, y, z, *normal, _ = _samples(scene, *np.random.default_rng(4).random((2, 2000), np.float32))
    points, normal = np.stack([x, y, z]), np.stack(normal)
    for off, inside in ((-5e-4, True), (-1e-6, True), (1e-6, True), (0.01, False)):
        assert (_insides(scene, *(points + normal * np.float32(off))).astype(bool) == inside).all()


@pytest.mark.parametrize("corner", [(0, 0), (0, 1 - 2**-24), (1 - 2**-24, 0), (1 - 2**-24, 1 - 2**-24)])
@pytest.mark.parametrize("name", SHAPES)
def test_the_corners_of_the_square_give_finite_points(name, corner):
    found = _samples(packed(SHAPES[name]()), *np.float32(corner)[:, None])
    assert np.isfinite(found).all()
    assert np.linalg.norm(found[3:6]) == pytest.approx(1, abs=1e-5)
