"""The tree of lights: its nodes hold their lights, and it chooses with the probabilities that it claims."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_calls import looped
from parts import moved, quad, scaled, sky, turned
from scipy import stats

from lumipath.kernels.light_tree import rival_of
from lumipath.kernels.lights import pick_from_tree
from lumipath.lang import Vec3
from lumipath.pack import layout
from lumipath.pack.light_tree import BOUNDS, build_light_tree
from lumipath.pack.scene import pack_scene
from lumipath.scene import Cylinder, DirectionalLight, Material, Mesh, PointLight, Scene, Sphere, SpotLight

ALPHA = 1e-4
COUNT = 200_000


def scattered_triangles(count, seed=1, **options):
    """A mesh of small emissive triangles all over the unit cube, each turned its own way."""
    rng = np.random.default_rng(seed)
    corners = rng.random((count, 1, 3)) + 0.1 * (rng.random((count, 3, 3)) - 0.5)
    options.setdefault("material", Material(emission=3.0))
    return Mesh(vertices=corners.reshape(-1, 3), faces=np.arange(3 * count).reshape(-1, 3), **options)


def all_kinds():
    """Every kind of light at once, near and far."""
    shapes = [
        scattered_triangles(20, two_sided=False),
        scattered_triangles(10, seed=2),
        quad((0, 1.5, 0), (0, 1.5, 1), (1, 1.5, 1), (1, 1.5, 0), material=Material(emission=(0, 0, 1.0))),
        *(Sphere(transform=moved(x, 0.5, 0.5) @ scaled(0.1), material=Material(emission=x + 0.1)) for x in (0, 1, 2)),
        Cylinder(transform=moved(0, 0, 2) @ turned("x", 30) @ scaled(0.2), material=Material(emission=0.5)),
    ]
    lights = [
        PointLight(position=(0.5, 0.5, 2.0)),
        PointLight(position=(-1, 0.5, 0.5), intensity=0.3),
        SpotLight(position=(0.5, 2, 0.5), intensity=2.0, outer_angle=35),
        SpotLight(position=(2, 1, 0.5), direction=(-1, 0, 0), outer_angle=120, inner_angle=100),
        DirectionalLight(colour=0.1),
        DirectionalLight(direction=(0, -1, 0), colour=0.2, angle=5),
    ]
    return Scene(shapes=shapes, lights=lights, environment=sky(0.1))


@pytest.fixture(scope="module")
def packed():
    return pack_scene(all_kinds(), light_sampling="tree").scene


def pick(scene, ox, oy, oz, nx, ny, nz, u):
    chosen = pick_from_tree(scene, Vec3(ox, oy, oz), Vec3(nx, ny, nz), u)
    return chosen.light, chosen.pdf, chosen.rival


def rival(scene, primitive, ox, oy, oz):
    return rival_of(scene, primitive, Vec3(ox, oy, oz)) * scene.tree_probability


PICK, RIVAL = looped(pick, outputs=3, scene=True), looped(rival, scene=True)
PLACES = {
    "above all": ((0.5, 3.0, 0.5), (0, -1, 0)),
    "within": ((0.4, 0.6, 0.3), (0.6, 0, 0.8)),
    "within, without a normal": ((0.4, 0.6, 0.3), (0, 0, 0)),
    "far away": ((40.0, 5.0, -9.0), (-1, 0, 0)),
}


def picks(scene, place, normal, count=COUNT):
    u = (np.arange(count) + 0.5) / count
    light, pdf, rival = PICK(scene, *place, *np.float64(normal), np.minimum(u, 1 - 2**-24))
    return light.astype(int), pdf, rival


@pytest.mark.parametrize("where", PLACES)
def test_the_tree_chooses_with_the_probabilities_that_it_claims(packed, where):
    light, pdf, _ = picks(packed, *PLACES[where])
    rows = int(packed.light_count)
    found = light >= 0
    frequency = np.bincount(light[found], minlength=rows) / COUNT
    claimed = np.zeros(rows)
    claimed[light] = pdf
    infinite = int(packed.first_infinite)
    claimed[infinite:] *= packed.lights[infinite:, 2]
    # Numbers are spread evenly, so counts are off by the rounding of the numbers and by one or two, not by chance.
    np.testing.assert_allclose(frequency, claimed, atol=12 / COUNT)
    assert claimed.sum() == pytest.approx(found.mean(), abs=2e-3)
    if not any(PLACES[where][1]):
        assert found.all()


def test_lights_near_and_far_share_the_probability(packed):
    far = packed.lights[int(packed.first_infinite) :]
    assert far[:, 2].sum(dtype=float) == pytest.approx(1 - packed.tree_probability, rel=1e-5)
    assert packed.environment_probability == far[-1, 2]
    sun = far[far.view(np.int32)[:, 3] == layout.SUN_LIGHT][0]
    assert sun[12] == pytest.approx(sun[2] / (2 * np.pi * (1 - np.cos(np.radians(2.5)))), rel=1e-4)


def test_random_numbers_draw_lights_like_the_probabilities_say(packed):
    place, normal = PLACES["within"]
    u = np.random.default_rng(3).random(COUNT, np.float32)
    light, pdf, _ = PICK(packed, *place, *np.float64(normal), u)
    light = light.astype(int)
    near = (light >= 0) & (light < packed.first_infinite)
    observed = np.bincount(light[near], minlength=int(packed.first_infinite))
    expected = np.zeros(len(observed))
    expected[light[near]] = pdf[near]
    expected *= near.sum() / expected.sum()
    many = expected > 10
    observed = np.append(observed[many], observed[~many].sum())
    expected = np.append(expected[many], expected[~many].sum() + 1e-9)
    assert stats.chisquare(observed, expected * observed.sum() / expected.sum()).pvalue > ALPHA


@pytest.mark.parametrize("where", PLACES)
def test_the_probability_found_upwards_is_that_of_the_way_down(packed, where):
    place, normal = PLACES[where]
    light, _, down = picks(packed, place, normal)
    kinds, numbers = packed.lights.view(np.int32)[:, 3], packed.lights.view(np.int32)
    primitives = np.where(kinds == layout.TRIANGLE_LIGHT, numbers[:, 11], numbers[:, 17])
    surfaces = (light >= 0) & np.isin(kinds[light], (layout.TRIANGLE_LIGHT, layout.QUADRIC_LIGHT))
    assert surfaces.sum() > COUNT // 20
    up = RIVAL(packed, primitives[light[surfaces]].astype(np.int32), *place)
    np.testing.assert_allclose(up, down[surfaces], rtol=1e-5)


def test_probabilities_without_a_normal_add_up_to_1_but_for_what_turns_away_at_last():
    alone = pack_scene(Scene(shapes=all_kinds().shapes), light_sampling="tree").scene
    assert alone.tree_probability == 1
    primitives = np.nonzero(alone.emitter_node >= 0)[0].astype(np.int32)
    assert len(primitives) == alone.light_count
    for place, _ in PLACES.values():
        assert 0.95 < RIVAL(alone, primitives, *place).sum(dtype=float) < 1 + 1e-5


def test_whatever_lights_a_point_can_be_chosen():
    mesh = scattered_triangles(300, two_sided=False)
    scene = pack_scene(Scene(shapes=[mesh]), light_sampling="tree").scene
    rng = np.random.default_rng(8)
    corners = mesh.vertices[mesh.faces].astype(float)
    facing = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing /= np.linalg.norm(facing, axis=1)[:, None]
    tried = 0
    for _ in range(20):
        o = rng.random(3) * 1.6 - 0.3
        n = rng.normal(size=3)
        n /= np.linalg.norm(n)
        to = corners - o
        to /= np.linalg.norm(to, axis=2)[..., None]
        shines = ((to @ n > 1e-3) & (np.einsum("tck,tk->tc", to, facing) < -1e-3)).any(axis=1)
        light, _, _ = picks(scene, o, n, 400_000)
        tried += shines.sum()
        # Those that shine most weakly may be missed by 400,000 numbers, so near ones only.
        near = np.linalg.norm(corners.mean(axis=1) - o, axis=1) < 0.6
        assert set(np.nonzero(shines & near)[0]) <= set(light)
    assert tried > 500


def test_nothing_below_the_horizon_is_chosen():
    shapes = [Sphere(transform=moved(x, -1, 0) @ scaled(0.1), material=Material(emission=1.0)) for x in range(5)]
    scene = pack_scene(Scene(shapes=shapes), light_sampling="tree").scene
    light, pdf, rival = picks(scene, (0, 0, 0), (0, 1, 0), 1000)
    assert (light == -1).all()
    assert pdf.max() == rival.max() == 0
    light, pdf, _ = picks(scene, (0, 0, 0), (0, -1, 0), 1000)
    assert set(light) == set(range(5))
    # By the inverse square of the distance, and the cosine.
    assert np.bincount(light).argmax() == 0


def random_bounds(count, seed=4):
    rng = np.random.default_rng(seed)
    bounds = np.zeros((count, BOUNDS))
    bounds[:, :3] = rng.random((count, 3)) * (5, 1, 3)
    bounds[:, 3:6] = bounds[:, :3] + rng.random((count, 3)) * 0.1
    axis = rng.normal(size=(count, 3))
    bounds[:, 6:9] = axis / np.linalg.norm(axis, axis=1)[:, None]
    bounds[:, 9] = rng.choice([0, 0.3, np.pi], count, p=[0.8, 0.1, 0.1])
    bounds[:, 10] = rng.choice([np.pi / 2, 0.4], count)
    bounds[:, 11] = rng.random(count) ** 4 + 1e-6
    bounds[:, 12] = rng.random(count) < 0.5
    return bounds


def lights_below(links, node):
    if links[node] < 0:
        return [-1 - links[node]]
    return lights_below(links, links[node]) + lights_below(links, links[node] + 1)


@pytest.mark.parametrize("count", [1, 2, 3, 200])
def test_nodes_hold_the_lights_below_them(count):
    bounds = random_bounds(count)
    nodes, parents, leaves = build_light_tree(bounds)
    links = nodes.view(np.int32)[:, 11]
    assert sorted(lights_below(links, 0)) == list(range(count))
    assert parents[0] == -1
    for node in [0, *range(2, 2 * count)]:
        below = lights_below(links, node)
        if links[node] < 0:
            assert leaves[below[0]] == node
        else:
            assert parents[links[node]] == parents[links[node] + 1] == node
        assert abs(nodes[node, 7]) == pytest.approx(bounds[below, 11].sum(), rel=1e-5)
        corners = np.concatenate([bounds[below, :3], bounds[below, 3:6]])
        assert np.linalg.norm(corners - nodes[node, :3], axis=1).max() <= nodes[node, 3]
        assert nodes[node, 10] <= np.cos(bounds[below, 10]).min()
        cosine = bounds[below, 6:9] @ nodes[node, 4:7]
        if nodes[node, 7] < 0:
            cosine = np.abs(cosine)
        else:
            assert not bounds[below, 12].any()
        needed = np.minimum(np.arccos(np.clip(cosine, -1, 1)) + bounds[below, 9], np.pi)
        # Axes are float32, of which the angle between two equal ones may be some 1e-4.
        assert np.arccos(nodes[node, 8].astype(float)) >= needed.max() - 5e-4
        assert np.hypot(nodes[node, 8], nodes[node, 9]) == pytest.approx(1, abs=1e-6)


def test_lights_in_one_place_make_a_tree_that_is_no_list():
    bounds = np.repeat(random_bounds(1), 64, axis=0)
    _, parents, leaves = build_light_tree(bounds)
    depth = 0
    node = leaves[0]
    while node > 0:
        node, depth = parents[node], depth + 1
    assert depth == 6


def test_a_tree_puts_near_lights_together():
    bounds = random_bounds(400)
    bounds[:200, [0, 3]] += 100
    nodes, _, _ = build_light_tree(bounds)
    links = nodes.view(np.int32)[:, 11]
    groups = [set(lights_below(links, links[0] + k)) for k in range(2)]
    assert set(range(200)) in groups


@pytest.mark.parametrize(
    ("sampling", "count", "expected"),
    [
        ("auto", 64, 0),
        ("auto", 65, layout.LIGHT_TREE),
        ("tree", 2, layout.LIGHT_TREE),
        ("power", 65, layout.MANY_LIGHTS),
        ("uniform", 65, layout.MANY_LIGHTS),
        ("uniform", 64, 0),
    ],
)
def test_the_setting_chooses_the_way(sampling, count, expected):
    mesh = scattered_triangles(count)
    scene = pack_scene(Scene(shapes=[mesh]), light_sampling=sampling).scene
    assert scene.features.mask == layout.TRIANGLE_LIGHTS | expected
    # Arrays on a device are never empty.
    assert len(scene.light_nodes) == (2 * count if expected == layout.LIGHT_TREE else 1)
    probability = scene.lights[:, 2]
    if sampling == "uniform":
        np.testing.assert_allclose(probability, 1 / count, rtol=1e-6)
    elif sampling == "power":
        assert np.ptp(probability) > 0.1 / count


def test_a_tree_over_nothing_is_no_tree():
    scene = pack_scene(
        Scene(shapes=[quad((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))], environment=sky()), light_sampling="tree"
    ).scene
    assert scene.features.mask == layout.ENVIRONMENT
    assert scene.environment_probability == 1
