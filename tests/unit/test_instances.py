"""Instances: rays find in them what they find in copies, and surfaces are those of copies."""

from __future__ import annotations

import attrs
import numpy as np
import pytest
from parts import moved, scaled, sphere_mesh
from reference_geometry import rotation
from tracing import METHODS, gpu_scene, hits, upload

from lumipath.devices.cpu import CpuDevice
from lumipath.errors import SceneError
from lumipath.pack import layout
from lumipath.pack.geometry import shape_numbers
from lumipath.pack.instances import arrange
from lumipath.pack.scene import pack_scene
from lumipath.scene import Cone, Cylinder, Group, Instance, Material, Mesh, Scene, Sphere, scene_digest
from lumipath.scenes import builtin

WAYS = [*METHODS, "binary", "wide"]


def unit(v):
    v = np.asarray(v, np.float64)
    return (v / np.linalg.norm(v, axis=-1, keepdims=True)).astype(np.float32)


def soup(count, seed, size=0.3):
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1, 1, (count, 1, 3)) + rng.normal(0, size, (count, 3, 3))
    return Mesh(vertices=corners.reshape(-1, 3), faces=np.arange(3 * count).reshape(-1, 3))


def sheared(x=0.5, y=-0.3):
    matrix = np.eye(4)
    matrix[0, 1], matrix[1, 2] = x, y
    return matrix


def mirrored():
    return scaled(-1.0, 1.0, 1.0)


def as_copies(shapes):
    """The shapes, copies in place of instances, and for each the number of its instance among the instances, or -1."""
    pairs, instance = [], 0
    for shape in shapes:
        placed = isinstance(shape, Instance)
        pairs += [(copy, instance) for copy in shape.copies()] if placed else [(shape, -1)]
        instance += placed
    return [shape for shape, _ in pairs], np.array([owner for _, owner in pairs])


def traced(shapes, way, *arguments, **options):
    """Distances, primitives and instances of rays."""
    if way in METHODS:
        return hits(upload(*shapes), *arguments, **options, method=way)
    return hits(gpu_scene(*shapes, wide=way == "wide"), *arguments, **options)


def middles(shapes, primitive, instance):
    """(N, 3): where in the world the middles of primitives lie; 0 for quadrics."""
    geometry = pack_scene(Scene(shapes=shapes)).geometry
    placed = [shape.transform for shape in shapes if isinstance(shape, Instance)]
    corners = geometry.vertices[geometry.faces].astype(np.float64).mean(axis=1)
    corners = np.concatenate([corners.reshape(-1, 3), np.zeros((len(geometry.quadrics), 3))])
    transforms = np.array([*placed, np.eye(4)])[instance]
    found = np.einsum("nij,nj->ni", transforms[:, :3, :3], corners[primitive]) + transforms[:, :3, 3]
    return np.where((primitive < len(geometry.faces))[:, None], found, 0.0)


def assert_same_as_copies(shapes, o, d, way, *, agreeing=0.998, tolerance=2e-5):
    """Check that rays find in instances what they find in copies, but for those few that rounding decides.

    Distances may differ by `tolerance` times themselves plus the coordinates of the origin.
    """
    copies, owners = as_copies(shapes)
    t, primitive, instance = traced(shapes, way, o, d)
    want_t, want, _ = traced(copies, way, o, d)
    assert (want >= 0).mean() > 0.1, "the rays show too little"
    assert ((primitive >= 0) == (want >= 0)).mean() >= agreeing
    hit = (primitive >= 0) & (want >= 0)
    reach = want_t[hit] + np.abs(o[hit]).max(axis=1)
    assert (np.abs(t[hit] - want_t[hit]) <= tolerance * reach).mean() >= agreeing
    numbers = shape_numbers(Scene(shapes=copies))
    assert (instance[hit] == owners[numbers[want[hit]]]).mean() >= agreeing
    found, wanted = middles(shapes, primitive[hit], instance[hit]), middles(copies, want[hit], np.full(hit.sum(), -1))
    assert (np.abs(found - wanted).max(axis=1) <= 1e-4 * reach).mean() >= agreeing
    blocked, want_blocked = (
        traced(all_of, way, o, d, 0.3 * reach.max(), any_hit=True)[1] >= 0 for all_of in (shapes, copies)
    )
    assert (blocked == want_blocked).mean() >= agreeing


def rays_at(targets, count, seed, far=1.0):
    """(count, 3) origins about the targets, at distances of about `far`, and unit directions to points near them."""
    rng = np.random.default_rng(seed)
    aim = np.asarray(targets, np.float64)[rng.integers(0, len(targets), count)] + rng.normal(0, 0.4 * far, (count, 3))
    o = (aim + unit(rng.normal(size=(count, 3))) * far * rng.uniform(0.5, 4.0, (count, 1))).astype(np.float32)
    return o, unit(aim - o)


def scattered(shape, count, seed, of=lambda rng: np.eye(4), **options):
    """Instances of a shape at random places and turns."""
    rng = np.random.default_rng(seed)
    return [
        Instance(shape, transform=moved(*rng.uniform(-4, 4, 3)) @ rotation(rng) @ of(rng), **options)
        for _ in range(count)
    ]


def places(shapes):
    return [shape.transform[:3, 3] for shape in shapes if isinstance(shape, Instance)]


TRANSFORMS = {
    "turned": lambda rng: np.eye(4),
    "scaled": lambda rng: scaled(*rng.uniform(0.3, 2.0, 3)),
    "mirrored": lambda rng: scaled(-1.0, 1.0, 1.0),
    "sheared": lambda rng: sheared(*rng.uniform(-1, 1, 2)),
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", TRANSFORMS)
def test_rays_find_in_instances_what_they_find_in_copies(kind, way):
    shapes = [soup(50, 1), *scattered(soup(200, 2), 12, 3, TRANSFORMS[kind]), *scattered(soup(3, 4, 1.0), 5, 5)]
    assert_same_as_copies(shapes, *rays_at(places(shapes), 4000, 6), way)


@pytest.mark.parametrize("way", WAYS)
def test_groups_of_meshes_and_quadrics_are_placed_as_one(way):
    tree = Group(
        [
            soup(40, 11),
            Sphere(transform=moved(0.5, 0, 0) @ scaled(0.4)),
            Cone(transform=moved(-0.5, 0, 0), height=0.7, bottom_radius=0.4),
            Cylinder(transform=moved(0, 0.4, 0) @ scaled(0.2)),
        ]
    )
    shapes = [Sphere(transform=scaled(0.7)), *scattered(tree, 9, 12, TRANSFORMS["sheared"]), soup(20, 13)]
    assert_same_as_copies(shapes, *rays_at(places(shapes), 4000, 14), way, tolerance=2e-4)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_huge_and_tiny_instances(scale, way):
    shapes = [
        Instance(shape.shape, transform=scaled(scale) @ shape.transform) for shape in scattered(soup(100, 21), 8, 22)
    ]
    o, d = rays_at(np.array(places(shapes)) / scale, 3000, 23)
    assert_same_as_copies(shapes, o * np.float32(scale), d, way)


@pytest.mark.parametrize("way", WAYS)
def test_packets_of_a_camera_go_through_instances(way):
    shapes = [soup(30, 31), *scattered(soup(300, 32), 20, 33)]
    o = np.tile(np.float32((0.3, 0.2, 9.0)), (8000, 1))
    d = unit(np.random.default_rng(34).uniform(-4, 4, (8000, 3)) * (1, 1, 0.2) - o)
    assert_same_as_copies(shapes, o, d, way)


@pytest.mark.parametrize("way", WAYS)
def test_one_sided_faces_of_mirrored_instances_keep_their_fronts(way):
    ball = attrs.evolve(sphere_mesh(12), two_sided=False)
    places = [moved(-2, 0, 0) @ mirrored(), moved(2, 0, 0) @ sheared() @ mirrored()]
    shapes = [Instance(ball, transform=place) for place in places]
    rng = np.random.default_rng(41)
    for place in places:
        inside = (rng.uniform(-0.3, 0.3, (500, 3)) + place[:3, 3]).astype(np.float32)
        d = unit(rng.normal(size=(500, 3)))
        t, _, _ = traced(shapes, way, inside, d)
        # From inside there is at most the other ball.
        assert (t > 1.0).all()
        assert (traced(shapes, way, inside - 10 * d, d)[1] >= 0).all()


@pytest.mark.parametrize("way", METHODS)
def test_a_closed_mesh_in_an_instance_does_not_leak(way):
    ball = sphere_mesh(24)
    matrix = moved(3, -2, 1) @ rotation(np.random.default_rng(51)) @ scaled(2.0, 0.5, 1.0) @ sheared()
    shapes = [Instance(ball, transform=matrix), Instance(ball, transform=moved(50, 0, 0))]
    rng = np.random.default_rng(52)
    inside = rng.uniform(-0.3, 0.3, (30_000, 3))
    corners = ball.vertices[ball.faces[rng.integers(0, len(ball.faces), 30_000)]].astype(np.float64)
    part = rng.integers(0, 2, (30_000, 1)) * rng.random((30_000, 1))
    aim = corners[:, 0] * (1 - part) + corners[:, 1] * part
    o = (inside @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32)
    d = unit(aim @ matrix[:3, :3].T + matrix[:3, 3] - o)
    assert (traced(shapes, way, o, d)[2] == 0).all()


@pytest.mark.parametrize("way", WAYS)
def test_rays_go_through_many_instances_at_one_place(way):
    target = soup(60, 61, 0.1)
    turns = [rotation(np.random.default_rng(k)) @ scaled(0.5 + 0.2 * k) for k in range(12)]
    shapes = [Instance(target, transform=turn) for turn in turns]
    assert_same_as_copies(shapes, *rays_at([(0.0, 0.0, 0.0)], 4000, 62, far=2.0), way)


@pytest.mark.parametrize("way", WAYS)
def test_a_thousand_instances_of_a_hundred_targets(way):
    targets = [soup(1 + k % 30, 100 + k) for k in range(100)]
    rng = np.random.default_rng(71)
    shapes = [
        Instance(target, transform=moved(*rng.uniform(-15, 15, 3)) @ rotation(rng))
        for target in targets
        for _ in range(10)
    ]
    assert_same_as_copies(shapes, *rays_at(places(shapes), 3000, 72, far=3.0), way)


# ---- what is packed --------------------------------------------------------------------------------------------------

LAMP, DULL = Material(emission=3.0), Material(diffuse=0.5)


def packed_of(*shapes):
    return pack_scene(Scene(shapes=list(shapes)))


def test_a_target_is_stored_once():
    mesh = soup(100, 81)
    packed = packed_of(soup(10, 82), *scattered(mesh, 30, 83))
    assert len(packed.scene.primitives) == 110
    assert packed.scene.instances.shape == (30, layout.INSTANCE_SIZE)
    assert packed.scene.features.mask & layout.INSTANCES
    assert len(packed.geometry.instancing.members) == 1


def test_a_hundred_million_triangles_take_little_memory():
    scene = builtin("forest")
    uploaded = CpuDevice(2).upload(pack_scene(scene))
    arrays = [value for value in (*uploaded, *uploaded.accel) if isinstance(value, np.ndarray)]
    assert scene.triangle_count > 99e6
    assert sum(array.nbytes for array in arrays) < 150e6


def test_equal_groups_share_what_is_stored():
    trunk, leaves = soup(10, 84), soup(20, 85)
    shapes = [Instance([trunk, leaves], transform=moved(k, 0, 0)) for k in range(5)]
    shapes += [Instance(Group([trunk, leaves], name="tree"), transform=moved(k, 5, 0)) for k in range(5)]
    assert len(packed_of(*shapes).scene.primitives) == 30


def test_what_stands_at_one_place_only_is_a_shape_of_its_own():
    mesh = soup(10, 86)
    packed = packed_of(Instance(mesh, transform=moved(1, 2, 3)))
    assert not packed.scene.features.mask & layout.INSTANCES
    np.testing.assert_allclose(packed.geometry.vertices, mesh.vertices + np.float32((1, 2, 3)))


def test_a_scene_without_instances_has_no_records_of_them():
    packed = packed_of(soup(10, 87), Sphere())
    assert not packed.scene.features.mask & layout.INSTANCES
    assert packed.geometry.instancing is None
    assert arrange(Scene(shapes=[Sphere()])).targets == []


def test_emissive_parts_become_shapes_of_their_own():
    post, bulb = soup(10, 88), attrs.evolve(soup(4, 89), material=LAMP)
    packed = packed_of(*(Instance([post, bulb], transform=moved(k, 0, 0)) for k in range(3)))
    assert len(packed.scene.primitives) == 10 + 3 * 4
    assert packed.scene.light_count == 12
    assert (packed.scene.emitter_density > 0).sum() == 12
    # The material of an instance decides.
    dark = packed_of(*(Instance(bulb, transform=moved(k, 0, 0), material=DULL) for k in range(3)))
    assert dark.scene.light_count == 0
    assert len(dark.scene.primitives) == 4
    lit = packed_of(*(Instance(post, transform=moved(k, 0, 0), material=LAMP if k else None) for k in range(3)))
    assert lit.scene.light_count == 20


def test_the_box_of_an_instance_holds_it_and_little_more():
    rng = np.random.default_rng(90)
    points = unit(rng.normal(size=(3000, 3)))
    ball = Mesh(vertices=points, faces=np.arange(3000).reshape(-1, 3))
    shapes = scattered(ball, 40, 91, TRANSFORMS["sheared"])
    boxes = packed_of(*shapes).geometry.instancing.boxes
    for shape, (lower, upper) in zip(shapes, boxes, strict=True):
        (copy,) = shape.copies()
        low, high = copy.vertices.min(axis=0), copy.vertices.max(axis=0)
        assert (lower <= low).all()
        assert (high <= upper).all()
        assert (upper - lower < 1.35 * (high - low)).all()


def test_shape_numbers_name_instances_by_their_records():
    mesh, bulb = soup(5, 92), attrs.evolve(soup(2, 93), material=LAMP)
    shapes = [Sphere(), *(Instance([mesh, bulb], transform=moved(k, 0, 0)) for k in range(2)), soup(3, 94)]
    scene = Scene(shapes=shapes)
    assert shape_numbers(scene).tolist() == [1] * 2 + [2] * 2 + [3] * 3 + [-1] * 5 + [0]
    packed = pack_scene(scene)
    assert packed.scene.instances.view(np.int32)[:, layout.INSTANCE_SHAPE].tolist() == [1, 2]


# ---- what a scene says -----------------------------------------------------------------------------------------------


def test_triangles_are_counted_as_seen_and_as_stored():
    mesh = soup(100, 95)
    scene = Scene(shapes=[mesh, soup(7, 96), *scattered(mesh, 9, 97)])
    assert scene.triangle_count == 1007
    assert scene.stored_triangle_count == 107


def test_digests_know_place_material_and_shape_of_instances():
    mesh, other = soup(5, 98), soup(5, 99)

    def digest(*instances):
        return scene_digest(Scene(shapes=list(instances)))

    first = Instance(mesh, transform=moved(1, 0, 0))
    digests = {
        digest(first),
        digest(first, first),
        digest(Instance(mesh, transform=moved(2, 0, 0))),
        digest(Instance(other, transform=moved(1, 0, 0))),
        digest(Instance([mesh], transform=moved(1, 0, 0))),
        digest(Instance(mesh, transform=moved(1, 0, 0), material=DULL)),
        digest(*first.copies()),
    }
    assert len(digests) == 7
    assert digest(first) == digest(Instance(soup(5, 98), transform=moved(1, 0, 0), name="named"))


def test_a_digest_reads_a_shared_mesh_once(monkeypatch):
    from lumipath.scene import digest as module

    hashed = []
    original = module._hashed
    monkeypatch.setattr(module, "_hashed", lambda kind, content: hashed.append(kind) or original(kind, content))
    mesh = soup(1000, 101)
    scene_digest(Scene(shapes=scattered(mesh, 200, 102)))
    assert sum("(3000, 3)" in kind for kind in hashed) == 1


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Instance(Sphere(), transform=scaled(1, 1, 0)), "transform of an instance is singular"),
        (lambda: Instance(Sphere(), transform=np.eye(3)), "transform of an instance must have the shape 4 x 4"),
        (lambda: Instance(Sphere(), transform=np.full((4, 4), np.nan)), "must be finite"),
        (lambda: Instance(Instance(Sphere())), "an instance of an instance is not possible"),
        (lambda: Instance("tree"), "made of a Mesh, Sphere, Cone or Group, not of a str"),
        (lambda: Instance(Sphere(), material=0.5), "a material is 0.5; it must be"),
        (lambda: Instance([Sphere(), Instance(Sphere())]), "item 1 of a group is an Instance: groups do not nest"),
        (lambda: Group([Group([])]), "item 0 of a group is a Group: groups do not nest"),
        (lambda: Group([None]), "item 0 of a group is a NoneType"),
        (lambda: Group(3), "made of a list of shapes, not of an int"),
        (lambda: Scene(shapes=[Group([Sphere()])]), "item 0 is a Group; it must be .* or an Instance"),
        (lambda: packed_of(Instance(soup(1, 1), transform=scaled(1e12))), "it must be finite and at most 1e"),
    ],
)
def test_what_cannot_be_placed_is_named(make, message):
    with pytest.raises(SceneError, match=message):
        make()


def test_an_instance_of_nothing_is_nothing():
    empty = Mesh(vertices=np.zeros((0, 3)), faces=np.zeros((0, 3), int))
    with pytest.warns(match="has no shapes"):
        packed = packed_of(Instance([]), Instance([]), Instance(empty), Instance(empty))
    assert len(packed.geometry.faces) == 0
