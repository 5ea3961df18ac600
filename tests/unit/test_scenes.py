import subprocess
import sys

import numpy as np
import pytest

from lumipath.cli._summary import scene_bounds
from lumipath.errors import SceneError
from lumipath.pack import layout
from lumipath.pack.scene import pack_scene
from lumipath.scene import (
    AmbientLight,
    Camera,
    Conductor,
    Cone,
    Dielectric,
    DirectionalLight,
    Instance,
    Material,
    Mesh,
    PointLight,
    Principled,
    Scene,
    Sphere,
    Texture,
)
from lumipath.scenes import DEFAULT, builtin, names
from lumipath.scenes.forest import forest

TRIANGLES = {
    "cornell-box": 32,
    "cornell-box-specular": 32,
    "cornell-box-transmissive": 34,
    "knot40k": 40_012,
    "forest": 99_138_050,
    "bench-cornell": 36,
    "bench-blob100k": 99_236,
    "bench-blob1m": 998_012,
    "bench-materials-cornell": 36,
    "bench-materials-blob100k": 99_236,
    "bench-materials-blob1m": 998_012,
}
# Metres from the origin that scenes reach at most, if it is more than ten.
LARGE = {"forest": 160}
BOXES = ["cornell-box", "cornell-box-specular", "cornell-box-transmissive", "bench-cornell"]


def face_normals_and_centres(mesh):
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), corners.mean(axis=1)


def part(scene, name):
    return next(shape for shape in scene.shapes if shape.name == name)


@pytest.mark.parametrize("name", names())
class TestEveryScene:
    def test_loads_with_a_camera_and_light(self, name):
        scene = builtin(name)
        assert scene.name == name
        assert len(scene.cameras) == 1
        assert scene.environment or scene.lights or any(shape.material.is_emissive for shape in scene.shapes)

    def test_lies_within_a_few_metres_and_in_view(self, name):
        scene = builtin(name)
        low, high = scene_bounds(scene)
        assert np.abs([low, high]).max() <= LARGE.get(name, 10)
        camera = scene.camera()
        centre = (low + high) / 2
        assert np.dot(centre - camera.position, camera.direction) > 0

    def test_no_face_is_degenerate(self, name):
        for mesh in builtin(name).shapes:
            if isinstance(mesh, Mesh):
                normals, _ = face_normals_and_centres(mesh)
                assert (np.linalg.norm(normals, axis=1) > 0).all()

    def test_is_new_each_time(self, name):
        assert builtin(name).shapes[0] is not builtin(name).shapes[0]


@pytest.mark.parametrize(("name", "count"), TRIANGLES.items())
def test_triangle_counts(name, count):
    assert builtin(name).triangle_count == count


def test_together_they_use_all_that_a_scene_can_have():
    scenes = [builtin(name) for name in names() if "blob" not in name]
    used = 0
    for scene in scenes:
        used |= pack_scene(scene).scene.features.mask
    # The bits of layout below MANY_LIGHTS are those of every scene; the rest belong to settings, trees and BSDFs.
    assert used & (layout.MANY_LIGHTS - 1) == layout.MANY_LIGHTS - 1
    for bit in (layout.INSTANCES, layout.LIGHT_TREE, layout.ROUND_LIGHTS, layout.SUNS):
        assert used & bit
    assert {type(light) for scene in scenes for light in scene.lights} == {PointLight, DirectionalLight, AmbientLight}
    assert {camera.blades > 0 for scene in scenes for camera in scene.cameras if camera.aperture > 0} == {True, False}


def test_there_are_a_thousand_lamps_and_the_brightest_is_far_brighter():
    lamps = [shape for shape in builtin("many-lamps").shapes if shape.material.is_emissive]
    power = [max(lamp.material.emission) * lamp.transform[0, 0] ** 2 for lamp in lamps]
    assert len(lamps) == 1000
    assert max(power) > 1000 * min(power)


def test_every_kind_of_shape_has_a_texture():
    scene = builtin("textured-primitives")
    plain = {shape.name for shape in scene.shapes if not any(isinstance(lobe, Texture) for lobe in lobes_of(shape))}
    assert plain == {"floor"}
    assert {type(shape) for shape in scene.shapes} == {Mesh, Sphere, Cone}


def lobes_of(shape):
    return (shape.material.diffuse, shape.material.specular, shape.material.emission)


def test_the_room_of_the_cubemap_has_its_sides_where_they_belong():
    environment = builtin("cubemap").environment
    height, width, _ = environment.image.shape
    # Above the middle, where the windows have a bar.
    middle = environment.image[height // 2 - 24 : height // 2 - 8]
    # Ahead is blue, the left green, and on the right the window is bright.
    assert middle[:, width // 2 - 8 : width // 2 + 8].mean(axis=(0, 1)).argmax() == 2
    assert middle[:, width // 4 - 8 : width // 4 + 8].mean(axis=(0, 1)).argmax() == 1
    assert middle[:, 3 * width // 4 + 8 : 3 * width // 4 + 24].min() > 4


def test_descriptions_are_one_line():
    assert all(text and "\n" not in text for text in names().values())
    assert DEFAULT in names()


def test_unknown_name_suggests_near_ones():
    with pytest.raises(SceneError, match="did you mean cornell-box"):
        builtin("cornel-box")
    with pytest.raises(SceneError, match="there are cornell-box, "):
        builtin("qqqq")


def test_listing_imports_no_numpy():
    code = "import sys, lumipath.scenes as s; s.names(); sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == 0


@pytest.mark.parametrize("name", [*BOXES, "cornell-box-glass", "knot40k", "bench-blob100k"])
def test_walls_and_lamp_face_into_the_room(name):
    scene = builtin(name)
    low, high = scene_bounds(scene)
    for wall in ("floor", "ceiling", "back wall", "left wall", "right wall", "lamp"):
        normals, centres = face_normals_and_centres(part(scene, wall))
        assert (np.einsum("ij,ij->i", normals, (low + high) / 2 - centres) > 0).all(), wall


@pytest.mark.parametrize("name", BOXES)
@pytest.mark.parametrize("block", ["short block", "tall block"])
def test_blocks_face_outwards(name, block):
    mesh = part(builtin(name), block)
    normals, centres = face_normals_and_centres(mesh)
    assert (np.einsum("ij,ij->i", normals, centres - mesh.vertices.mean(axis=0)) > 0).all()


@pytest.mark.parametrize("name", [*BOXES, "knot40k"])
def test_only_the_lamp_is_one_sided(name):
    assert [shape.name for shape in builtin(name).shapes if not shape.two_sided] == ["lamp"]


def assert_closed(mesh):
    """Every edge, by its ends in space, belongs to two faces that run along it in opposite directions."""
    _, vertex = np.unique(mesh.vertices, axis=0, return_inverse=True)
    faces = vertex.reshape(-1)[mesh.faces]
    edges = np.concatenate([faces[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    there, back = (set(map(tuple, pairs)) for pairs in (edges, edges[:, ::-1]))
    assert len(there) == len(edges)
    assert there == back


def test_the_glass_block_is_closed_and_clear_of_the_floor():
    block = part(builtin("cornell-box-transmissive"), "tall block")
    assert block.material.is_dielectric
    assert_closed(block)
    assert block.vertices[:, 1].min() > 5e-4


class TestKnot:
    def test_is_closed_and_faces_outwards(self):
        knot = part(builtin("knot40k"), "knot")
        assert len(knot.faces) == 40_000
        assert_closed(knot)
        corners = knot.vertices[knot.faces].astype(np.float64)
        # Cubic metres; below 0 where faces look inwards.
        volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
        assert 0.005 < volume < 0.01

    def test_normals_are_those_of_the_surface(self):
        knot = part(builtin("knot40k"), "knot")
        faces, _ = face_normals_and_centres(knot)
        faces /= np.linalg.norm(faces, axis=1, keepdims=True)
        assert np.einsum("ij,ij->i", faces, knot.normals[knot.faces[:, 0]]).min() > 0.7

    def test_hangs_clear_of_the_walls(self):
        scene = builtin("knot40k")
        knot = part(scene, "knot")
        assert knot.vertices.min() > 0.02
        assert (knot.vertices.max(axis=0) < np.array([0.54, 0.53, 0.54])).all()


def test_cornell_box_is_in_metres_and_red_is_left():
    scene = builtin("cornell-box")
    _, high = scene_bounds(scene)
    np.testing.assert_allclose(high, (0.556, 0.5488, 0.5592), atol=1e-6)
    right, _, _ = scene.camera().axes()
    red = part(scene, "left wall")
    assert red.material.diffuse[0] > 5 * red.material.diffuse[1]
    assert np.dot(red.vertices.mean(axis=0) - scene.camera().position, right) < 0


def test_benchmark_scenes_keep_their_values():
    # Published figures depend on them; sums in float64 change with the smallest edit.
    blob = part(builtin("bench-blob100k"), "blob")
    assert blob.vertices.shape == (49_928, 3)
    np.testing.assert_allclose(np.abs(blob.vertices).sum(axis=0, dtype=np.float64), BLOB_SUMS, rtol=1e-6)
    assert blob.faces[0].tolist() == [0, 316, 1]
    assert blob.faces[-1].tolist() == [49_296, 49_927, 49_612]
    tall = part(builtin("bench-cornell"), "tall block")
    np.testing.assert_allclose(tall.vertices[0], (-0.7102571, -1.0, -0.5779450), atol=1e-6)
    camera = builtin("bench-cornell").camera()
    assert (camera.position, camera.direction, camera.fov) == (
        pytest.approx((0, 0, 3.9)),
        (0.0, 0.0, -1.0),
        pytest.approx(39.3077),
    )
    assert part(builtin("bench-cornell"), "lamp").material.emission == pytest.approx((18.387, 13.9873, 6.75357))


@pytest.mark.parametrize("size", ["cornell", "blob100k"])
def test_benchmark_scenes_of_all_materials_have_all_of_them(size):
    scene, plain = builtin(f"bench-materials-{size}"), builtin(f"bench-{size}")
    kinds = {type(shape.material) for shape in scene.shapes}
    assert kinds == {Material, Principled, Conductor, Dielectric}
    features = pack_scene(scene).scene.features.mask
    assert features & layout.TEXTURES
    assert features & layout.ENVIRONMENT
    assert bool(features & layout.SMOOTH_NORMALS) == (size != "cornell")
    for shape, before in zip(scene.shapes, plain.shapes):
        np.testing.assert_array_equal(shape.vertices, before.vertices)


def test_the_grid_is_over_roughness_and_metallic_and_its_glass_over_the_index():
    balls = [shape.material for shape in builtin("material-grid").shapes if isinstance(shape, Sphere)]
    glass = [ball.ior for ball in balls if isinstance(ball, Dielectric)]
    assert glass == pytest.approx([1.1, 1.3, 1.5, 1.7, 1.9, 2.1, 2.3])
    grid = {(ball.metallic, ball.roughness) for ball in balls if isinstance(ball, Principled)}
    shares = {metallic for metallic, _ in grid}, {roughness for _, roughness in grid}
    assert [len(share) for share in shares] == [4, 7]
    assert all((min(share), max(share)) == (0.0, 1.0) for share in shares)
    assert len(grid) == 28


def test_the_studio_shows_every_part_of_the_principled_material():
    features = pack_scene(builtin("materials")).scene.features.mask
    for part_of_it in (layout.CLEARCOAT, layout.SHEEN, layout.IRIDESCENCE, layout.TRANSMISSION):
        assert features & part_of_it


BLOB_SUMS = (12071.191604, 21571.726491, 12071.191604)


class TestForest:
    def test_has_a_thousand_trees_of_some_100000_triangles_that_are_stored_once(self):
        scene = builtin("forest")
        trees = [shape for shape in scene.shapes if isinstance(shape, Instance)]
        kinds = {id(tree.shape): tree.shape for tree in trees}.values()
        assert len(trees) == 1000
        assert [sum(len(part.faces) for part in kind.shapes) for kind in kinds] == [99_120] * 3
        assert scene.stored_triangle_count < 320_000

    def test_trees_stand_on_the_ground_and_apart(self):
        scene = forest(trees=60, twigs=1)
        roots = np.array([shape.transform[:3, 3] for shape in scene.shapes[1:]])
        ground = scene.shapes[0].vertices.astype(np.float64)
        nearest = np.linalg.norm(ground[:, None, ::2] - roots[None, :, ::2], axis=2).argmin(axis=0)
        assert np.abs(ground[nearest, 1] - roots[:, 1]).max() < 0.8
        apart = np.linalg.norm(roots[:, None] - roots, axis=2) + 1e3 * np.eye(60)
        assert apart.min() > 0.8

    def test_small_ones_are_cheap(self):
        scene = forest(trees=3, twigs=1)
        assert scene.stored_triangle_count < 100_000
        for part in scene.parts():
            normals, _ = face_normals_and_centres(part)
            assert (np.linalg.norm(normals, axis=1) > 0).all()


class TestBounds:
    def test_instances_are_bounded_where_they_stand(self):
        transform = np.diag([2.0, 2.0, -2.0, 1.0])
        transform[:3, 3] = (5, 0, 0)
        low, high = scene_bounds(Scene(shapes=[Instance(Sphere(), transform=transform), Instance([Sphere()])]))
        np.testing.assert_allclose(low, (-1, -2, -2))
        np.testing.assert_allclose(high, (7, 2, 2))

    def test_sphere_under_a_shear(self):
        transform = np.eye(4)
        transform[0, 1] = 2.0
        transform[:3, 3] = (1, 2, 3)
        low, high = scene_bounds(Scene(shapes=[Sphere(transform=transform)]))
        np.testing.assert_allclose(high - (1, 2, 3), (np.sqrt(5), 1, 1))
        np.testing.assert_allclose(low - (1, 2, 3), (-np.sqrt(5), -1, -1))

    @pytest.mark.parametrize(("bottom", "top"), [(1.0, 0.0), (0.25, 2.0)])
    def test_cone_contains_its_points_tightly(self, bottom, top):
        rng = np.random.default_rng(3)
        transform = np.eye(4)
        transform[:3] = rng.normal(size=(3, 4))
        cone = Cone(bottom_radius=bottom, top_radius=top, height=1.5, transform=transform)
        angle = np.linspace(0, 2 * np.pi, 10_000)
        rims = [
            np.stack([r * np.cos(angle), r * np.sin(angle), np.full_like(angle, z)], 1)
            for r, z in ((bottom, 0), (top, 1.5))
        ]
        points = np.concatenate(rims) @ transform[:3, :3].T + transform[:3, 3]
        low, high = scene_bounds(Scene(shapes=[cone]))
        np.testing.assert_allclose(low, points.min(axis=0), atol=1e-5)
        np.testing.assert_allclose(high, points.max(axis=0), atol=1e-5)

    def test_nothing_has_no_bounds(self):
        assert scene_bounds(Scene(cameras=[Camera()])) is None


def test_water_and_glass_overlap_without_reaching_through():
    scene = builtin("glass-of-water")
    glass, water = part(scene, "tumbler"), part(scene, "water")
    for mesh in (glass, water):
        normals, _ = face_normals_and_centres(mesh)
        # Closed, and turned outwards: the volume is positive, and the areas of all faces cancel.
        corners = mesh.vertices[mesh.faces].astype(np.float64)
        assert np.einsum("ij,ij->", normals, corners[:, 0]) > 0
        np.testing.assert_allclose(normals.sum(axis=0), 0, atol=1e-9)
    assert glass.material.priority > water.material.priority
    # Between the outer side of the glass and its inner one, wherever the water is.
    assert water.vertices[:, 1].max() < glass.vertices[:, 1].max()
    assert np.hypot(*water.vertices[:, [0, 2]].T).max() < np.hypot(*glass.vertices[:, [0, 2]].T).max() - 0.001
    assert water.vertices[:, 1].min() > glass.vertices[:, 1].min() + 0.01
