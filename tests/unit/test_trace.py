"""Tracing rays through the 8-wide tree: against brute force in float64, on ugly geometry, and without leaks."""

from __future__ import annotations

import numpy as np
import pytest
from reference_geometry import brute_force, quadric_distances, rotation
from tracing import METHODS, hits, upload

from lumipath.scene import Box, Cone, Cylinder, Material, Mesh, Sphere, transform_mesh


def trace(scene, o, d, tmax=np.inf, any_hit=False, method="one by one"):
    """Distances (N,) float32 and primitives (N,), -1 for none; with `any_hit` only whether there is one is defined."""
    return hits(scene, o, d, tmax, any_hit, method)[:2]


@pytest.fixture(params=METHODS)
def closest(request):
    """Nearest hits of rays, found one by one or by packets."""
    return lambda scene, o, d, tmax=np.inf: trace(scene, o, d, tmax, False, request.param)


@pytest.fixture
def blocked(request, closest):
    """(N,) whether anything is on each ray."""
    method = request.node.callspec.params["closest"]
    return lambda scene, o, d, tmax=np.inf: trace(scene, o, d, tmax, True, method)[1] >= 0


@pytest.fixture
def assert_same_hits(closest, blocked):
    """Check distances and primitives against brute force, but for rays so near to an edge that rounding decides."""

    def check(scene, mesh, o, d, culled=False, size=1.0):
        want_t, want, margin = brute_force(mesh, o, d, culled)
        t, primitive = closest(scene, o, d)
        reach = np.where(np.isfinite(want_t), want_t, 0) + np.abs(o).max(axis=1) + size
        clear = margin > 1e-6 * reach
        assert clear.mean() > 0.9
        np.testing.assert_array_equal(primitive[clear] >= 0, want[clear] >= 0)
        hit = clear & (want >= 0)
        assert (np.abs(t[hit].astype(np.float64) - want_t[hit]) <= 4e-6 * reach[hit]).all()
        # Where two primitives are at the same distance within rounding, either is right.
        assert (hit & (primitive != want)).mean() < 0.01
        np.testing.assert_array_equal(blocked(scene, o, d)[clear], want[clear] >= 0)

    return check


def unit(v):
    v = np.asarray(v, np.float64)
    return (v / np.linalg.norm(v, axis=-1, keepdims=True)).astype(np.float32)


def soup(count, seed, size=0.3, scale=1.0, centre=(0.0, 0.0, 0.0)):
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1, 1, (count, 1, 3)) + rng.normal(0, size, (count, 3, 3))
    vertices = (corners.reshape(-1, 3) * scale + centre).astype(np.float32)
    return Mesh(vertices=vertices, faces=np.arange(3 * count).reshape(-1, 3))


def random_rays(count, seed, scale=1.0, centre=(0.0, 0.0, 0.0), spread=2.5):
    rng = np.random.default_rng(seed)
    o = (rng.normal(0, spread, (count, 3)) * scale + centre).astype(np.float32)
    target = rng.uniform(-1, 1, (count, 3)) * scale + centre
    return o, unit(target - o)


@pytest.mark.parametrize(("count", "seed"), [(1, 0), (2, 1), (7, 2), (9, 3), (64, 4), (500, 5), (3000, 6)])
def test_closest_and_any_hit_agree_with_brute_force_on_random_soups(assert_same_hits, count, seed):
    mesh = soup(count, seed)
    assert_same_hits(upload(mesh), mesh, *random_rays(600, 100 + seed))


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1e3, 1e6])
def test_hits_agree_with_brute_force_at_any_scale(assert_same_hits, scale):
    mesh = soup(300, 11, scale=scale)
    assert_same_hits(upload(mesh), mesh, *random_rays(500, 12, scale), size=scale)


def test_hits_agree_with_brute_force_far_from_the_origin(assert_same_hits):
    centre = np.array([3e3, -5e3, 2e3])
    mesh = soup(200, 13, scale=100.0, centre=centre)
    assert_same_hits(upload(mesh), mesh, *random_rays(500, 14, 100.0, centre), size=1e4)


def test_hits_agree_with_brute_force_on_slivers_and_on_triangles_without_area(closest):
    rng = np.random.default_rng(21)
    start = rng.uniform(-1, 1, (400, 3))
    along = rng.normal(0, 1, (400, 3))
    sliver = np.stack([start, start + along, start + along * 0.5 + rng.normal(0, 1e-3, (400, 3))], 1)
    line = np.stack([start, start + along, start + along * 0.5], 1)
    dot = np.repeat(start[:, None], 3, 1)
    corners = np.concatenate([sliver, line, dot]).astype(np.float32)
    rng.shuffle(corners)
    mesh = Mesh(vertices=corners.reshape(-1, 3), faces=np.arange(3600).reshape(-1, 3))
    o, d = random_rays(200, 22)
    # Half of the rays aim at slivers, the others hit next to nothing.
    aim = corners[rng.integers(0, 1200, 400)].mean(axis=1)
    o2 = rng.normal(0, 3, (400, 3)).astype(np.float32)
    o, d = np.concatenate([o, o2]), np.concatenate([d, unit(aim - o2)])
    _, want, margin = brute_force(mesh, o, d)
    _, primitive = closest(upload(mesh), o, d)
    clear = margin > 1e-5
    assert clear.mean() > 0.2
    np.testing.assert_array_equal(primitive[clear] >= 0, want[clear] >= 0)
    assert (want[clear] >= 0).sum() > 20


@pytest.mark.parametrize("shape", ["dot", "line"])
def test_a_triangle_without_area_is_never_hit(closest, blocked, shape):
    points = {"dot": [(0, 0, 0)] * 3, "line": [(0, 0, 0), (1, 0, 0), (0.5, 0, 0)]}[shape]
    scene = upload(Mesh(vertices=points, faces=[(0, 1, 2)] * 3))
    o, _ = random_rays(1000, 31)
    d = unit(np.array([0.25, 0, 0]) * (shape == "line") - o)
    assert (closest(scene, o, d)[1] == -1).all()
    assert not blocked(scene, o, d).any()


def test_a_scene_without_primitives_hits_nothing(closest):
    with pytest.warns(match="no shapes"):
        scene = upload()
    o, d = random_rays(1000, 32)
    t, primitive = closest(scene, o, d)
    assert (primitive == -1).all()
    assert np.isinf(t).all()


def test_a_hundred_thousand_equal_triangles_are_hit_like_one(closest):
    corners = [(-1, -1, 0), (1, -1, 0), (0, 1, 0)]
    one = upload(Mesh(vertices=corners, faces=[(0, 1, 2)]))
    many = upload(Mesh(vertices=corners, faces=np.tile([(0, 1, 2)], (100_000, 1))))
    o, d = random_rays(12, 33)
    t, primitive = closest(many, o, d)
    expected, found = closest(one, o, d)
    np.testing.assert_array_equal(t, expected)
    np.testing.assert_array_equal(primitive >= 0, found >= 0)
    assert (found >= 0).sum() > 2


def test_of_coincident_faces_one_is_hit_at_the_same_distance(closest):
    mesh = soup(50, 41)
    twice = Mesh(vertices=mesh.vertices, faces=np.concatenate([mesh.faces, mesh.faces[:, ::-1]]))
    o, d = random_rays(500, 42)
    t, primitive = closest(upload(twice), o, d)
    expected, found = closest(upload(mesh), o, d)
    np.testing.assert_allclose(t, expected, rtol=1e-6)
    np.testing.assert_array_equal(np.where(primitive >= 0, primitive % 50, -1), found)


def test_a_hit_lies_between_0_and_tmax_exclusively(closest, blocked):
    scene = upload(Mesh(vertices=[(-1, -1, -2), (1, -1, -2), (0, 1, -2)], faces=[(0, 1, 2)]))
    tmax = np.array(
        [1.0, np.nextafter(np.float32(2), np.float32(0)), 2.0, np.nextafter(np.float32(2), np.float32(3)), 3, 0]
    )
    o, d = np.zeros((6, 3)), np.tile([0.0, 0, -1], (6, 1))
    np.testing.assert_array_equal(closest(scene, o, d, tmax)[1], [-1, -1, -1, 0, 0, -1])
    np.testing.assert_array_equal(blocked(scene, o, d, tmax), [False, False, False, True, True, False])
    # From a point of the triangle itself, and from behind it.
    assert closest(scene, [(0, 0, -2), (0, 0, -2.5)], [(0, 0, -1), (0, 0, -1)])[1].tolist() == [-1, -1]


# ---- watertight ------------------------------------------------------------------------------------------------------


def closed_sphere(rings=24, sectors=48):
    """A closed tessellated sphere whose vertices are shared: vertices (N, 3), faces (M, 3)."""
    theta = np.pi * np.arange(1, rings)[:, None] / rings
    phi = 2 * np.pi * np.arange(sectors) / sectors
    ring = np.stack(np.broadcast_arrays(np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)), -1)
    vertices = np.concatenate([[(0, 1, 0)], ring.reshape(-1, 3), [(0, -1, 0)]])
    index = 1 + np.arange((rings - 1) * sectors).reshape(rings - 1, sectors)
    right = np.roll(index, -1, axis=1)
    a, b, c, d = index[:-1], right[:-1], right[1:], index[1:]
    quads = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    top = np.stack([right[0], index[0], np.zeros(sectors, int)], -1)
    bottom = np.stack([index[-1], right[-1], np.full(sectors, len(vertices) - 1)], -1)
    return vertices.astype(np.float32), np.concatenate([quads, top, bottom]).astype(np.int32)


def closed_box(cuts=4):
    """A box whose sides are grids, with shared vertices on integer coordinates."""
    grid = np.array([(i, j) for i in range(cuts) for j in range(cuts)])
    corners = []
    for axis in range(3):
        for side in (0, cuts):
            for i, j in grid:
                quad = np.insert([(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)], axis, side, axis=1)
                corners += [quad[[0, 1, 2]], quad[[0, 2, 3]]]
    points, inverse = np.unique(np.reshape(corners, (-1, 3)), axis=0, return_inverse=True)
    return (points / cuts * 2 - 1).astype(np.float32), inverse.reshape(-1, 3).astype(np.int32)


@pytest.mark.parametrize("make", [closed_sphere, closed_box])
@pytest.mark.parametrize("scale", [1.0, 1e-4, 1e5])
def test_no_ray_from_inside_escapes_through_a_vertex_an_edge_or_anywhere_else(closest, blocked, make, scale):
    vertices, faces = make()
    vertices = vertices * np.float32(scale)
    scene = upload(Mesh(vertices=vertices, faces=faces))
    rng = np.random.default_rng(51)
    count = 60_000
    o = np.concatenate([rng.uniform(-0.4, 0.4, (3 * count - 1000, 3)), np.zeros((1000, 3))]) * scale
    o = o.astype(np.float32)
    corners = vertices[faces[rng.integers(0, len(faces), 3 * count)]].astype(np.float64)
    part = rng.random((3 * count, 1))
    # Corners, points of edges, and middles of edges, which are hit more exactly.
    target = np.concatenate(
        [
            corners[:count, 0],
            (corners[:, 0] * part + corners[:, 1] * (1 - part))[count : 2 * count],
            (corners[:, 1] + corners[:, 2])[2 * count :] * 0.5,
        ]
    )
    anywhere = rng.normal(size=(20_000, 3))
    o = np.concatenate([o, o[:20_000]])
    d = np.concatenate([unit(target - o[: 3 * count]), unit(anywhere)])
    assert (closest(scene, o, d)[1] >= 0).all()
    assert blocked(scene, o, d).all()


def test_no_ray_along_an_axis_or_a_diagonal_of_the_grid_escapes(closest, blocked):
    vertices, faces = closed_box()
    scene = upload(Mesh(vertices=vertices, faces=faces))
    inner = np.array([-0.75, -0.5, -0.25, 0.0, 0.25, 0.5, 0.75])
    o = np.stack(np.meshgrid(inner, inner, inner), -1).reshape(-1, 3)
    ways = np.stack(np.meshgrid(*[(-1.0, 0.0, 1.0)] * 3), -1).reshape(-1, 3)
    ways = ways[np.abs(ways).sum(1) > 0]
    signs = np.where(ways == 0, -0.0, ways)
    for directions in (ways, signs):
        origins = np.repeat(o, len(ways), axis=0)
        d = np.tile(unit(directions), (len(o), 1))
        t, primitive = closest(scene, origins, d)
        assert (primitive >= 0).all()
        # Every exit lies on the box.
        assert np.abs(np.abs(origins + t[:, None].astype(np.float64) * d).max(axis=1) - 1).max() < 1e-6
        assert blocked(scene, origins, d).all()


def test_rays_along_an_axis_agree_with_brute_force_on_a_soup(assert_same_hits):
    mesh = soup(400, 61)
    rng = np.random.default_rng(62)
    o = rng.uniform(-1.5, 1.5, (600, 3)).astype(np.float32)
    d = np.eye(3)[rng.integers(0, 3, 600)] * rng.choice([-1.0, 1.0], (600, 1))
    assert_same_hits(upload(mesh), mesh, o, d)
    # Nearly parallel to an axis, down to denormal numbers.
    tiny = rng.choice([0.0, -0.0, 1e-40, -1e-40, 1e-20, -1e-20, 1e-10, -1e-10], (600, 3))
    d = np.where(d == 0, tiny, d)
    assert_same_hits(upload(mesh), mesh, o, d)


# ---- one-sided triangles, transforms, quadrics ----------------------------------------------------------------------


def one_sided(mesh, transform=None):
    vertices, faces, _ = transform_mesh(mesh.vertices, mesh.faces, np.eye(4) if transform is None else transform)
    return Mesh(vertices=vertices, faces=faces, two_sided=False)


def test_one_sided_triangles_are_hit_from_their_front_only(assert_same_hits):
    mesh = one_sided(soup(500, 71))
    assert_same_hits(upload(mesh), mesh, *random_rays(800, 72), culled=True)


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_one_sided_closed_surface_is_seen_from_outside_and_not_from_inside_under_mirroring_too(
    closest, blocked, mirrored
):
    vertices, faces = closed_sphere()
    matrix = rotation(np.random.default_rng(73)) @ np.diag([0.5, 2.0, -1.0 if mirrored else 1.0, 1.0])
    outward = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    assert ((outward * vertices[faces].mean(axis=1)).sum(1) > 0).all()
    scene = upload(one_sided(Mesh(vertices=vertices, faces=faces), matrix))
    rng = np.random.default_rng(74)
    inside = rng.uniform(-0.1, 0.1, (2000, 3)) @ matrix[:3, :3].T
    assert (closest(scene, inside, unit(rng.normal(size=(2000, 3))))[1] == -1).all()
    outside = unit(rng.normal(size=(2000, 3))) * 5.0
    toward = unit(inside - outside)
    t, primitive = closest(scene, outside, toward)
    assert (primitive >= 0).all()
    # It is the nearer of the two crossings.
    assert (t < np.linalg.norm(outside - inside, axis=1)).all()
    assert blocked(scene, outside, toward).all()


def test_one_sided_and_two_sided_triangles_live_side_by_side(closest):
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    left = Mesh(vertices=np.array(corners) - (2, 0, 0), faces=[(0, 1, 2), (0, 2, 3)], two_sided=False)
    right = Mesh(vertices=np.array(corners) + (2, 0, 0), faces=[(0, 1, 2), (0, 2, 3)])
    scene = upload(left, right)
    o = [(-2.1, 0.2, 1), (-2.1, 0.2, -1), (2.1, 0.2, 1), (2.1, 0.2, -1)]
    d = [(0, 0, -1), (0, 0, 1), (0, 0, -1), (0, 0, 1)]
    np.testing.assert_array_equal(closest(scene, o, d)[1] >= 0, [True, False, True, True])


def test_quadrics_and_triangles_mixed_agree_with_brute_force(closest, blocked):
    rng = np.random.default_rng(81)
    mesh = soup(100, 82, size=0.15)
    quadrics = []
    for k in range(60):
        matrix = rotation(rng) @ np.diag([*rng.uniform(0.05, 0.3, 3), 1.0])
        matrix[:3, 3] = rng.uniform(-1, 1, 3)
        kinds = (
            Sphere(transform=matrix),
            Cylinder(transform=matrix),
            Cylinder(transform=matrix, capped=False),
            Cone(transform=matrix),
            Cone(bottom_radius=0.4, top_radius=1.1, height=0.7, transform=matrix, capped=k % 2 == 0),
        )
        quadrics.append(kinds[k % 5])
    scene = upload(mesh, *quadrics)
    o, d = random_rays(1500, 83)
    want_t, want, margin = brute_force(mesh, o, d)
    for number, shape in enumerate(quadrics):
        t, slack = quadric_distances(shape, o, d)
        margin = np.minimum(margin, slack)
        nearer = t < want_t
        want_t, want = np.where(nearer, t, want_t), np.where(nearer, 100 + number, want)
    t, primitive = closest(scene, o, d)
    clear = margin > 1e-4
    assert clear.mean() > 0.9
    np.testing.assert_array_equal(primitive[clear], want[clear])
    hit = clear & (want >= 0)
    assert hit.sum() > 500
    np.testing.assert_allclose(t[hit], want_t[hit], rtol=1e-4, atol=1e-4)
    np.testing.assert_array_equal(blocked(scene, o, d)[clear], want[clear] >= 0)


def test_a_box_primitive_is_closed_and_its_faces_look_outwards(closest):
    box = Box(transform=rotation(np.random.default_rng(91)), material=Material(diffuse=0.5))
    closed = upload(Mesh(vertices=box.vertices, faces=box.faces, two_sided=False))
    rng = np.random.default_rng(92)
    inside = rng.uniform(-0.2, 0.2, (2000, 3))
    d = unit(rng.normal(size=(2000, 3)))
    assert (closest(upload(box), inside, d)[1] >= 0).all()
    assert (closest(closed, inside, d)[1] == -1).all()
    assert (closest(closed, inside - 5.0 * d, d)[1] >= 0).all()


@pytest.mark.parametrize("kind", ["soup", "closed sphere", "one-sided", "quadrics"])
@pytest.mark.parametrize("method", ["sorted packets", "packets as they come"])
def test_a_ray_in_a_packet_finds_the_bits_that_it_finds_alone(kind, method):
    shapes = {
        "soup": lambda: [soup(2000, 101)],
        "closed sphere": lambda: [Mesh(vertices=closed_sphere()[0], faces=closed_sphere()[1])],
        "one-sided": lambda: [one_sided(soup(2000, 102))],
        "quadrics": lambda: [soup(50, 103), Sphere(transform=np.diag([0.5, 0.3, 0.7, 1])), Cone(), Cylinder()],
    }[kind]()
    scene = upload(*shapes)
    o, d = random_rays(30_000, 104)
    # A pinhole camera, whose rays make full packets.
    o[:20_000] = (0.1, 0.2, 4.0)
    d[:20_000] = unit(np.random.default_rng(105).uniform(-1, 1, (20_000, 3)) - o[:20_000])
    alone, together = trace(scene, o, d), trace(scene, o, d, method=method)
    np.testing.assert_array_equal(together[1], alone[1])
    np.testing.assert_array_equal(together[0], alone[0])
    shadows = [trace(scene, o, d, 3.0, True, name)[1] >= 0 for name in ("one by one", method)]
    np.testing.assert_array_equal(*shadows)
