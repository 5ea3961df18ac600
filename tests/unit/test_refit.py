"""Trees whose primitives have moved: boxes that fit, and rays that find what they find in a tree that is built anew."""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np
import pytest
from parts import moved as at
from parts import scaled, sky, sphere_mesh
from reference_geometry import brute_force
from tracing import gpu_scene, hits, upload

from lumipath.accel.bvh8 import EMPTY, INSTANCE_LINK, PRIMITIVE_MASK
from lumipath.accel.refit import WORST, cpu_costs, gpu_costs, is_worn, moved, refit_cpu, refit_gpu
from lumipath.devices.cpu import CpuDevice
from lumipath.lang import INF, Features
from lumipath.pack.layout import LIGHT_TREE, SMOOTH_NORMALS, TRIANGLE_LIGHTS, WIDE_TREE, PackedScene
from lumipath.pack.scene import Packed, pack_scene, repack_scene
from lumipath.scene import (
    Checker,
    Conductor,
    Cone,
    Diffuse,
    DirectionalLight,
    Group,
    Instance,
    Material,
    Mesh,
    Mix,
    PointLight,
    Scene,
    Sky,
    Sphere,
    with_meshes,
)

WAYS = ["one by one", "sorted packets", "packets as they come", "binary", "wide"]


def soup(count: int, seed: int, size: float = 0.2, **options: Any) -> Mesh:
    """Triangles in the cube from -1 to 1."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1, 1, (count, 1, 3)) + rng.normal(0, size, (count, 3, 3))
    return Mesh(vertices=corners.reshape(-1, 3), faces=np.arange(3 * count).reshape(-1, 3), **options)


def twisted(mesh: Mesh, turns: float = 0.15) -> Mesh:
    """The mesh turned about y, the more the higher, and stretched."""
    x, y, z = mesh.vertices.astype(np.float64).T
    angle = 2 * np.pi * turns * y
    turned = (np.cos(angle) * x - np.sin(angle) * z, 1.3 * y + 0.1, np.sin(angle) * x + np.cos(angle) * z)
    return attrs.evolve(mesh, vertices=np.stack(turned, axis=-1))


def shuffled(mesh: Mesh) -> Mesh:
    """The triangles of a soup all elsewhere: the worst for a tree of before."""
    order = np.random.default_rng(9).permutation(len(mesh.faces))
    return attrs.evolve(mesh, vertices=mesh.vertices.reshape(-1, 9)[order].reshape(-1, 3))


def with_tree(scene: Scene, way: str) -> PackedScene:
    """The scene with a tree that is built for it."""
    if way in ("binary", "wide"):
        return gpu_scene(*scene.shapes, wide=way == "wide")
    return upload(*scene.shapes)


def repacked(before: Scene, after: Scene, packed: PackedScene) -> Packed:
    """The scene `after` with the tree of `before`."""
    return repack_scene(after, packed, pack_scene(before).unmoved)


def refitted(before: Scene, after: Scene, way: str) -> PackedScene:
    """The scene `after` with the tree of `before`, refitted."""
    packed = with_tree(before, way)
    host = repacked(before, after, packed)
    now = moved(host.geometry)
    if way not in ("binary", "wide"):
        return host.scene._replace(accel=refit_cpu(packed.accel, now))
    features = Features(host.scene.features.mask | (WIDE_TREE if way == "wide" else 0))
    return host.scene._replace(accel=refit_gpu(packed.accel, now, wide=way == "wide"), features=features)


def scene_of_everything() -> tuple[Scene, dict[Mesh, Mesh]]:
    """Meshes alone, in a group and in instances, quadrics, and what the meshes become."""
    alone, leaf, hair = soup(300, 1), soup(60, 2), soup(7, 3, 0.5)
    plant = Group([leaf, Cone(transform=at(0.5, 0, 0) @ scaled(0.4)), hair])
    placed = [Instance(plant, transform=at(3 * k, 0.5 * k, 1) @ scaled(1, 1 + 0.3 * k, 1)) for k in (1, 2, 3)]
    shapes = [
        alone,
        Sphere(transform=at(0, 2.5, 0)),
        *placed,
        *(Instance(hair, transform=at(0, -3, k)) for k in (0, 4)),
    ]
    return Scene(shapes=shapes), {mesh: twisted(mesh) for mesh in (alone, leaf, hair)}


def rays(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Origins all around, and directions to points among the shapes of `scene_of_everything`."""
    rng = np.random.default_rng(seed)
    aim = rng.uniform((-2, -4, -2), (11, 4, 5), (count, 3))
    o = aim + rng.normal(size=(count, 3)) * 5
    d = aim - o
    return o.astype(np.float32), (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)


def bits(array: np.ndarray) -> np.ndarray:
    """The bits of floats, among which integers lie; both zeros have those of the positive one."""
    words = array.view(np.uint32).copy()
    words[words == 0x80000000] = 0
    return words


def assert_same_bits(a: tuple, b: tuple) -> None:
    for name, left, right in zip(type(a)._fields, a, b, strict=True):
        np.testing.assert_array_equal(bits(left), bits(right), err_msg=name)


# ---- boxes -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", ["one by one", "binary", "wide"])
@pytest.mark.parametrize("everything", [True, False])
def test_refitting_to_where_all_is_already_changes_nothing(way: str, everything: bool) -> None:
    scene = scene_of_everything()[0] if everything else Scene(shapes=[soup(3, 4)])
    assert_same_bits(refitted(scene, scene, way).accel, with_tree(scene, way).accel)


@pytest.mark.parametrize("way", ["one by one", "binary", "wide"])
def test_refitting_forth_and_back_gives_the_tree_that_was_built(way: str) -> None:
    scene, meshes = scene_of_everything()
    forth = refitted(scene, with_meshes(scene, meshes), way)
    built = with_tree(scene, way)
    assert not np.array_equal(bits(forth.accel.nodes), bits(built.accel.nodes))
    now = moved(pack_scene(scene).geometry)
    is_gpu = way != "one by one"
    back = refit_gpu(forth.accel, now, wide=way == "wide") if is_gpu else refit_cpu(forth.accel, now)
    assert_same_bits(back, built.accel)


def boxes_below(tree: Any, node: int, boxes: np.ndarray, placed: np.ndarray) -> np.ndarray:
    """The box (6,) of a node of the CPU's tree, by going down; checks those of the children on the way."""
    links, numbers = tree.nodes.view(np.int32)[node, 48:56], tree.groups.view(np.int32)[:, 72:]
    found = []
    for slot in np.flatnonzero(links != EMPTY):
        link = int(links[slot])
        if link >= 0:
            box = boxes_below(tree, link, boxes, placed)
        elif link <= INSTANCE_LINK:
            box = placed[INSTANCE_LINK - link]
        else:
            inside = numbers[-2 - link]
            inside = boxes[inside[inside != EMPTY] & PRIMITIVE_MASK]
            box = np.concatenate([inside[:, :3].min(axis=0), inside[:, 3:].max(axis=0)])
        stored = tree.nodes[node, :48].reshape(3, 2, 8)[:, :, slot]
        np.testing.assert_array_equal(stored.T.reshape(-1), box)
        found.append(box)
    return np.concatenate([np.min(found, axis=0)[:3], np.max(found, axis=0)[3:]])


def test_every_box_is_the_union_of_what_is_below_it() -> None:
    scene, meshes = scene_of_everything()
    after = with_meshes(scene, meshes)
    made = refitted(scene, after, "one by one")
    geometry = pack_scene(after).geometry
    now = moved(geometry)
    roots = np.unique(repacked(scene, after, upload(*scene.shapes)).roots)
    assert len(roots) == 2
    for root in (0, *roots):
        whole = boxes_below(made.accel, root, now.boxes, now.placed)
        if root == 0:
            lower, upper = geometry.world_bounds()
            np.testing.assert_array_equal(whole, [*lower.min(axis=0), *upper.max(axis=0)])


# ---- hits ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", WAYS)
def test_rays_find_in_a_refitted_tree_what_they_find_in_one_that_is_built(way: str) -> None:
    scene, meshes = scene_of_everything()
    after = with_meshes(scene, meshes)
    o, d = rays(4000, 7)
    made, fresh = refitted(scene, after, way), with_tree(after, way)
    method = way if way not in ("binary", "wide") else "one by one"
    for found, wanted in zip(hits(made, o, d, method=method), hits(fresh, o, d, method=method), strict=True):
        np.testing.assert_array_equal(found, wanted)
    t, primitive, instance = hits(fresh, o, d, method=method)
    assert (primitive >= 0).mean() > 0.2
    assert (instance >= 0).sum() > 100
    assert not np.array_equal(t, hits(with_tree(scene, way), o, d, method=method)[0])
    blocked, want = (hits(tree, o, d, 5.0, any_hit=True, method=method)[1] >= 0 for tree in (made, fresh))
    np.testing.assert_array_equal(blocked, want)


@pytest.mark.parametrize("way", ["one by one", "sorted packets", "binary", "wide"])
@pytest.mark.parametrize("change", [twisted, shuffled])
def test_rays_find_in_a_refitted_tree_what_brute_force_finds(way: str, change: Any) -> None:
    mesh = soup(400, 11)
    after = change(mesh)
    o, d = rays(2000, 12)
    made = refitted(Scene(shapes=[mesh]), Scene(shapes=[after]), way)
    t, primitive, _ = hits(made, o / 3, d, method=way if way not in ("binary", "wide") else "one by one")
    want_t, want, margin = brute_force(after, o / 3, d)
    clear = margin > 1e-5
    assert clear.mean() > 0.9
    assert (want[clear] >= 0).mean() > 0.05
    np.testing.assert_array_equal(primitive[clear], want[clear])
    hit = clear & (want >= 0)
    np.testing.assert_allclose(t[hit], want_t[hit], rtol=1e-4)


@pytest.mark.parametrize("way", ["one by one", "wide"])
def test_triangles_may_lose_their_area_and_get_it_back(way: str) -> None:
    mesh = soup(50, 13)
    flat = attrs.evolve(mesh, vertices=mesh.vertices * np.float32([1, 0, 0]))
    o, d = rays(500, 14)
    before, after = Scene(shapes=[mesh]), Scene(shapes=[flat])
    assert (hits(refitted(before, after, way), o / 3, d)[1] == -1).all()
    back = hits(refitted(after, before, way), o / 3, d)
    for found, wanted in zip(back, hits(with_tree(before, way), o / 3, d), strict=True):
        np.testing.assert_array_equal(found, wanted)
    assert (back[1] >= 0).any()


# ---- when a tree is built anew ---------------------------------------------------------------------------------------


def costs(scene: Scene, packed: PackedScene, way: str) -> np.ndarray:
    roots = repacked(scene, scene, packed).roots
    return cpu_costs(packed.accel, roots) if way == "cpu" else gpu_costs(packed.accel, roots, wide=way == "wide")


@pytest.mark.parametrize("way", ["cpu", "binary", "wide"])
def test_costs_are_those_of_each_tree(way: str) -> None:
    scene, _ = scene_of_everything()
    found = costs(scene, with_tree(scene, way), way)
    assert found.shape == (3,)
    assert (found >= 1).all()
    # A scene twice as large in all directions costs the same, but for what rounding to 8 bits does.
    large = with_meshes(
        Scene(shapes=[scene.shapes[0]]),
        {scene.shapes[0]: attrs.evolve(scene.shapes[0], vertices=scene.shapes[0].vertices * 2)},
    )
    small = Scene(shapes=[scene.shapes[0]])
    np.testing.assert_allclose(
        costs(large, with_tree(large, way), way), costs(small, with_tree(small, way), way), rtol=1e-3
    )


def test_cost_of_a_tree_by_hand() -> None:
    # Two leaves of 8 triangles each, half of whose surface is 3, in a box of 1 x 1 x 9.
    corner = np.array([(0, 0, 0), (1, 0, 1), (1, 1, 0)], np.float32)
    vertices = np.concatenate([corner + (0, 0, z) for z in (0, 8) for _ in range(8)])
    scene = Scene(shapes=[Mesh(vertices=vertices, faces=np.arange(48).reshape(-1, 3))])
    np.testing.assert_allclose(costs(scene, upload(*scene.shapes), "cpu"), [6 / 19], rtol=1e-6)
    # Triangles one by one in leaves of 4; where nodes are binary, there are two more of them above these.
    np.testing.assert_allclose(costs(scene, with_tree(scene, "binary"), "binary"), [(3 * 16 + 6) / 19], rtol=1e-6)
    np.testing.assert_allclose(costs(scene, with_tree(scene, "wide"), "wide"), [3 * 16 / 19], rtol=0.1)


def test_worn_is_what_costs_more_than_the_limit_in_any_tree() -> None:
    built = np.array([10.0, 0.0, 3.0])
    assert not is_worn(built, built)
    assert not is_worn(built * (WORST - 0.01), built)
    assert is_worn(built * (1, 1, WORST + 0.01), built)
    assert is_worn(built + (0, 0.1, 0), built)


def test_a_little_motion_keeps_the_tree_and_much_of_it_builds_another() -> None:
    mesh = soup(2000, 21, 0.02)
    device, before = CpuDevice(1), Scene(shapes=[mesh])
    packed = device.upload(pack_scene(before))
    links = packed.accel.nodes.view(np.int32)[:, 48:56]

    def after(change: Any) -> tuple[Scene, PackedScene]:
        scene = Scene(shapes=[change(mesh)])
        return scene, device.refit(repacked(before, scene, packed))

    _, little = after(lambda mesh: twisted(mesh, 0.02))
    np.testing.assert_array_equal(little.accel.nodes.view(np.int32)[:, 48:56], links)
    scene, much = after(shuffled)
    assert_same_bits(much.accel, upload(*scene.shapes).accel)
    # What is worn is measured against the new tree from then on.
    again = device.refit(repacked(before, scene, much))
    assert_same_bits(again.accel, much.accel)


# ---- what is packed --------------------------------------------------------------------------------------------------


def lit_scene() -> tuple[Scene, dict[Mesh, Mesh]]:
    """Emissive meshes, smooth and flat, materials of several parts, lights of all kinds, and what the meshes become."""
    wood = Diffuse(reflectance=Checker(0.2, 0.7))
    uvs = np.random.default_rng(1).random((60, 2))
    glow = soup(40, 31, material=Material(emission=2.0))
    sheet = soup(
        20,
        32,
        material=Mix(first=wood, second=Conductor(metal="gold"), weight=0.3, opacity=0.5),
        uvs=uvs,
        normals=uvs @ np.ones((2, 3)) + 1,
    )
    lamp = soup(30, 33, material=Material(emission=(0, 0, 3)))
    shapes = [
        glow,
        sheet,
        *(Instance([lamp, sheet], transform=at(4, 0, k)) for k in (0, 3)),
        Sphere(transform=at(0, 5, 0)),
    ]
    lights = [PointLight(position=(0, 3, 0)), DirectionalLight(direction=(0, -1, 0), angle=2.0)]
    scene = Scene(shapes=shapes, lights=lights, environment=Sky(elevation=30))
    return scene, {mesh: twisted(mesh) for mesh in (glow, sheet, lamp)}


@pytest.mark.parametrize("sampling", ["auto", "power"])
def test_a_scene_packed_anew_is_the_scene_packed(sampling: str) -> None:
    before, meshes = lit_scene()
    packed = pack_scene(before, light_sampling=sampling)
    assert bool(packed.scene.features.mask & LIGHT_TREE) == (sampling == "auto")
    after = with_meshes(before, meshes)
    found, want = (
        repack_scene(after, packed.scene, packed.unmoved).scene,
        pack_scene(after, light_sampling=sampling).scene,
    )
    assert found.features.mask == want.features.mask
    for name in PackedScene._fields:
        if name != "features":
            a, b = getattr(found, name), getattr(want, name)
            assert np.shape(a) == np.shape(b), name
            assert np.array_equal(a, b, equal_nan=name != "accel" and np.asarray(a).dtype.kind == "f"), name
    changed = {
        name for name in PackedScene._fields if not np.array_equal(getattr(found, name), getattr(packed.scene, name))
    }
    assert {"primitives", "vertices", "emitter_density", "lights", "extent"} - changed <= (
        {"emitter_density"} if sampling == "auto" else set()
    )
    # Nothing that is dear to make, and dear to bring to a GPU, was made again.
    for name in ("texels", "textures", "environment", "environment_cells", "materials"):
        assert getattr(found, name) is getattr(packed.scene, name)


def test_features_follow_the_vertices() -> None:
    lamp = sphere_mesh(4, material=Material(emission=1.0), smooth=True)
    before = Scene(shapes=[lamp], environment=sky())
    packed = pack_scene(before)
    assert packed.scene.features.mask & TRIANGLE_LIGHTS
    collapsed = with_meshes(before, {lamp: attrs.evolve(lamp, vertices=lamp.vertices * 0)})
    mask = repack_scene(collapsed, packed.scene, packed.unmoved).scene.features.mask
    assert not mask & TRIANGLE_LIGHTS
    assert not mask & SMOOTH_NORMALS


def test_infinity_is_not_among_the_boxes() -> None:
    scene, meshes = scene_of_everything()
    made = refitted(scene, with_meshes(scene, meshes), "one by one").accel
    there = made.nodes.view(np.int32)[:, 48:56] != EMPTY
    assert (np.abs(made.nodes[:, :48].reshape(-1, 6, 8))[np.repeat(there[:, None], 6, axis=1)] < INF).all()
