"""The polymesh of the .ray language."""

import numpy as np
import pytest

from lumipath.errors import LumipathWarning
from lumipath.formats.ray import parse_ray
from lumipath.formats.ray.polygons import triangulate
from lumipath.scene import Texture, smooth_normals

QUAD = "points = ((0,0,0),(1,0,0),(1,1,0),(0,1,0)); faces = ((0,1,2,3));"


def mesh_of(body, around="@", base=None):
    text = "SBT-raytracer 1.0\n" + around.replace("@", f"polymesh {{ {body} }}")
    (mesh,) = parse_ray(text, None, *([] if base is None else [base])).shapes
    return mesh


@pytest.mark.parametrize("keyword", ["polymesh", "trimesh"])
@pytest.mark.parametrize(
    "points",
    [
        "((0,0,0),(1,0,0),(1,1,0))",
        "( (0, 0,0,), (1 0 0) /* ) */\n(1.0f,1,0),)",
        "((0,0,0)\r\n,(1,0,0), // (9\r\n(1,1,0) )",
    ],
)
def test_lists(keyword, points):
    lists = f"points = {points}; faces ((2,1,0),(0x0,1.0,+2),); normals={points}"
    (mesh,) = parse_ray(f'SBT-raytracer 1.0 {keyword} {{ name="m"; {lists} }}').shapes
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
    assert mesh.faces.tolist() == [[2, 1, 0], [0, 1, 2]]
    assert mesh.name == "m"
    np.testing.assert_allclose(mesh.normals[2], (0.5**0.5, 0.5**0.5, 0), atol=1e-7)


def test_no_faces_and_no_points():
    assert mesh_of("points=(); faces=()").faces.shape == (0, 3)


def test_gennormals_override_normals():
    body = "points=((0,0,0),(1,0,0),(0,1,0),(0,0,1)); faces=((0,2,1),(0,1,3),(0,3,2),(1,2,3));"
    mesh = mesh_of(body + "gennormals; normals=((1,0,0),(1,0,0),(1,0,0),(1,0,0))")
    np.testing.assert_allclose(mesh.normals, smooth_normals(mesh.vertices, mesh.faces), atol=1e-6)
    assert mesh_of(body).normals is None
    assert mesh_of(body + "gennormals = false").normals is None


@pytest.mark.parametrize("around", ["scale(-1,2,3,@)", "rotate(1,2,3,4,scale(1,1,-5,@))", "scale(0.5,@)"])
def test_generated_normals_follow_the_transform(around):
    body = "points=((0,0,0),(1,0,0),(0,1,0),(0,0,1)); faces=((0,2,1),(0,1,3),(0,3,2),(1,2,3)); gennormals"
    mesh = mesh_of(body, around)
    np.testing.assert_allclose(mesh.normals, smooth_normals(mesh.vertices, mesh.faces), atol=1e-5)


def test_mirroring_keeps_fronts_and_given_normals():
    mesh = mesh_of(QUAD + "normals = ((0,0,1),(0,0,1),(0,0,1),(0,0,1))", "scale(-1,1,1,@)")
    a, b, c = mesh.vertices[mesh.faces[0]]
    assert np.cross(b - a, c - a)[2] > 0
    assert mesh.normals.tolist() == [[0, 0, 1]] * 4


@pytest.mark.parametrize(
    ("material", "two_sided"),
    [
        ("diffuse=1", False),
        ("transmissive=0.5", True),
        ("reflective=(0,0,.1)", True),
        ("specular=1; emissive=2", False),
    ],
)
def test_sidedness(material, two_sided):
    assert mesh_of(QUAD + f"material = {{ {material} }}").two_sided is two_sided


def test_vertex_materials():
    around = 'material = { name "red"; diffuse = (1,0,0) } @'
    mesh = mesh_of(QUAD + 'materials = (red, { transmissive = 1 }, "red", {},);', around)
    assert [material.diffuse for material in mesh.vertex_materials] == [(1, 0, 0), (0, 0, 0), (1, 0, 0), (0, 0, 0)]
    assert mesh.vertex_materials[0] is mesh.vertex_materials[2] is mesh.material
    assert mesh.two_sided
    assert not mesh_of(QUAD + "materials (red, red, red, red)", around).two_sided


def area(mesh):
    a, b, c = mesh.vertices[mesh.faces].astype(float).transpose(1, 0, 2)
    return np.cross(b - a, c - a).sum(axis=0) / 2


def test_convex_polygons_become_fans():
    mesh = mesh_of("points=((0,0,0),(1,0,0),(2,1,0),(1,2,0),(0,2,0)); faces=((0,1,2,3,4),(2,1,0),(4,3,2,1))")
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [2, 1, 0], [4, 3, 2], [4, 2, 1]]


OUTLINES = {
    "arrow": [(0, 0), (2, 1), (0, 2), (0.5, 1)],
    "comb": [(0, 0), (7, 0), (7, 3), (6, 3), (6, 1), (5, 1), (5, 3), (4, 3), (4, 1), (3, 1), (3, 3), (0, 3)],
    "spiral": [(0, 0), (5, 0), (5, 5), (1, 5), (1, 2), (3, 2), (3, 3), (2, 3), (2, 4), (4, 4), (4, 1), (0, 1)],
    "straight corners": [(0, 0), (1, 0), (2, 0), (2, 2), (1, 1), (0, 2), (0, 1)],
}


@pytest.mark.parametrize("name", OUTLINES)
@pytest.mark.parametrize("turns", range(4))
@pytest.mark.parametrize("reverse", [False, True])
def test_other_polygons_lose_their_ears(name, turns, reverse):
    outline = np.roll(np.array(OUTLINES[name], float), turns, axis=0)[:: -1 if reverse else 1]
    x, y = outline.T
    signed = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    # A tilted plane, so that no axis is special.
    points = outline @ np.array([(0.0, 0.8, 0.6), (1.0, 0.0, 0.0)])
    count = len(points)
    triangles = triangulate(points, np.arange(count), np.array([count]))
    a, b, c = outline[triangles].transpose(1, 0, 2)
    areas = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert triangles.shape == (count - 2, 3)
    assert (areas * np.sign(signed) >= 0).all()
    assert areas.sum() == pytest.approx(signed)


def test_strange_polygons_end():
    crossing = np.array([(0, 0, 0), (1, 1, 0), (1, 0, 0), (0, 1, 0), (0.5, -1, 0)], float)
    assert triangulate(crossing, np.array([0, 1, 2, 3, 4, 0, 0, 0, 0]), np.array([5, 4])).shape == (5, 3)


@pytest.fixture
def picture(tmp_path):
    import OpenImageIO

    file = OpenImageIO.ImageOutput.create(str(tmp_path / "red.png"))
    file.open(str(tmp_path / "red.png"), OpenImageIO.ImageSpec(2, 1, 3, "uint8"))
    file.write_image(np.array([[(255, 0, 0), (0, 0, 0)]], np.uint8))
    file.close()
    return tmp_path


def test_maps_lie_on_every_triangle(picture):
    body = QUAD + 'gennormals; material = { diffuse = map("red.png"); emissive = map("red.png") }'
    mesh = mesh_of(body, "translate(1,0,0,@)", picture)
    assert isinstance(mesh.material.diffuse, Texture)
    assert mesh.material.diffuse is mesh.material.emission
    assert mesh.material.diffuse.image.tolist() == [[[255, 0, 0], [0, 0, 0]]]
    assert mesh.faces.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert mesh.uvs.tolist() == [[0, 0], [1, 0], [0, 1]] * 2
    assert mesh.vertices[3:].tolist() == [[1, 0, 0], [2, 1, 0], [1, 1, 0]]
    assert mesh.normals.tolist() == [[0, 0, 1]] * 6


def test_a_mirrored_map_keeps_its_corners(picture):
    body = QUAD + 'materials = ({ diffuse = map("red.png") }, {}, {}, {})'
    mesh = mesh_of(body, "scale(-1,1,1,@)", picture)
    assert mesh.faces.tolist() == [[2, 1, 0], [5, 4, 3]]
    assert mesh.uvs.tolist() == [[0, 0], [1, 0], [0, 1]] * 2
    assert len(mesh.vertex_materials) == 6
    assert mesh.vertex_materials[0] is mesh.vertex_materials[3]


def test_meshes_without_maps_share_vertices():
    mesh = mesh_of(QUAD)
    assert (mesh.uvs, len(mesh.vertices)) == (None, 4)


def test_a_map_for_a_number_counts_with_its_mean(picture):
    with pytest.warns(LumipathWarning, match=r"2:.*index cannot vary.*0\.1667"):
        mesh = mesh_of(QUAD + 'material = { index = map("red.png") }', base=picture)
    assert mesh.material.index == pytest.approx(1 / 6)
