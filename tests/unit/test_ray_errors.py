"""What is wrong in a .ray file is told in one line, with the place of the culprit and what to do."""

from pathlib import Path

import pytest

from lumipath.errors import SceneError
from lumipath.formats.ray import parse_ray, read_ray

HEAD = "SBT-raytracer 1.0\n"
TRIANGLE = "points = ((0,0,0),(1,0,0),(0,1,0));"


def error_of(text):
    with pytest.raises(SceneError) as caught:
        parse_ray(text, Path("a.ray"))
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 400
    return caught.value


def check(marked, *parts):
    """The text is wrong at the mark «, and the message has all these parts."""
    before, after = marked.split("«")
    error = error_of(before + after)
    line = before.count("\n") + 1
    assert (str(error.path), error.line, error.column) == ("a.ray", line, len(before) - before.rfind("\n"))
    for part in parts:
        assert part in error.message


@pytest.mark.parametrize(
    ("marked", "part"),
    [
        ("«", "the file is empty"),
        (" // only a comment\n«", "the file ends here"),
        ("«hello", "found 'hello', expected \"SBT-raytracer 1.0\""),
        ("«%PDF-1.7", "'%'"),
        ("\x00«\x01".replace("\x00«", "«\x00"), "'\\x00'"),
        ("SBT-raytracer «camera { }", "found 'camera', expected a number"),
        ("SBT-raytracer«", "expected a number"),
        ("SBT-raytracer «1.2", "version 1.2"),
        ("SBT-raytracer «-1", "version -1"),
        ("SBT-raytracer «1.0.0", "'1.0.0' is not a number"),
        ("SBT-raytracer 1.0\n«SBT-raytracer 1.0", "'SBT-raytracer'"),
    ],
)
def test_header(marked, part):
    check(marked, part)


@pytest.mark.parametrize(
    ("marked", "parts"),
    [
        ("«torus { }", ("'torus'", "sphere", "polymesh")),
        ("«gennormals", ("'gennormals' is not known here",)),
        ('«map("x")', ("'map' is not known",)),
        ("sphere { «radius = 2 }", ("sphere has no 'radius'", "material, name")),
        ("camera { fov = 40;\n  «position_ = (0,0,0) }", ("camera has no 'position_'", "aspectratio")),
        ("sphere { material = { «colour = 1 } }", ("a material has no 'colour'", "diffuse")),
        ("box { material = {}; «material = {} }", ("box has 'material' twice",)),
        ("camera { fov 40 «fov 40 }", ("camera has 'fov' twice",)),
        ("ambient_light { colour = 1; «color = 1 }", ("ambient_light has 'color' twice",)),
        ("«camera = 1", ("camera needs a block",)),
        ("«sphere;", ("sphere needs a block",)),
        ("translate(1,2,3, «camera { })", ("camera cannot stand in a group",)),
        ("{ «point_light { position = (0,0,0) } }", ("point_light cannot stand in a group",)),
        ("sphere { «{ } }", ("found a group",)),
    ],
)
def test_keywords(marked, parts):
    check(HEAD + marked, *parts)


@pytest.mark.parametrize(
    ("marked", "parts"),
    [
        ("sphere {«", ("the file ends too early", "'{' of line 2", "cut off")),
        ("sphere {\n material = {\n diffuse = (1,1«", ("'(' of line 4",)),
        (f"polymesh {{ {TRIANGLE} faces = ((0,1,2),(0,1«", ("the file ends too early",)),
        ("sphere { name =«", ("the file ends too early",)),
        ("material =«", ("the file ends here, expected a number",)),
        ("sphere { } «}", ("found '}'",)),
        ("sphere { name = «; }", ("found ';', expected a number, a name, a string",)),
        ("camera { position = (1,2,3«; }", ("found ';'", "')'")),
        ("camera { position = (1,2(,3) «}", ("found '}'",)),
        ("sphere { /* ** / «".replace(" /*", " «/*").replace("/ «", "/ "), ("comment is never closed",)),
        (f"polymesh {{ {TRIANGLE} faces = ((0,1,2), «/* (1,2) ) }}", ("comment is never closed",)),
        ('sphere { name = «"x\n" }', ("string is never closed",)),
        ("sphere { «@ }", ("'@'",)),
        ("sphere { «/ }", ("'/'",)),
        ("sphere { «é = 1 }", ("'é'",)),
        ("translate(1,2,3, sphere { }«;)", ("found ';'",)),
        ("translate(1,«,2,3, sphere { })", ("found ','",)),
    ],
)
def test_syntax(marked, parts):
    check(HEAD + marked, *parts)


@pytest.mark.parametrize(
    ("marked", "parts"),
    [
        ("camera { fov = «wide }", ("fov: found 'wide', expected a number",)),
        ("camera { fov = «(1,2,3) }", ("fov: found '(1,2,3)', expected a number",)),
        ("camera { fov = «1.2.3 }", ("'1.2.3' is not a number", "write it like")),
        ("camera { fov = «-- }", ("'--' is not a number",)),
        ("camera { fov = «1_0 }", ("'1_0'",)),
        ("camera { fov = «0x }", ("'0x'",)),
        ("camera { fov = «4e38 }", ("'4e38' is too large",)),
        ("camera { fov = «0x1p999999 }", ("too large",)),
        ("camera { fov = «-1e999 }", ("too large",)),
        ("camera { fov = «nan }", ("found 'nan'",)),
        ("camera { fov = «-inf }", ("'-inf' is not a number",)),
        ("camera { «fov; }", ("fov: found nothing, expected a number",)),
        ("«camera { fov = 180 }", ("camera: fov is 180.0", "179.9")),
        ("«camera { viewdir = (0,1,0) }", ("must point in different ways",)),
        ("«camera { quaternian = (0,0,0,0) }", ("must point in different ways",)),
        ("«camera { quaternian = (0,0,0,1); updir = (0,1,0) }", ("keep one",)),
        ("camera { quaternian = «(0,0,1) }", ("quaternian has 3 numbers: give 4, (x, y, z, w)",)),
        ("camera { position = «(1,2) }", ("position has 2 numbers: give 3, (x, y, z)",)),
        ("camera { position = «() }", ("found '()', expected 3 numbers",)),
        ("camera { position = «((1,2,3)) }", ("expected 3 numbers",)),
        ("camera { position = (1,«y,3) }", ("position: found 'y', expected 3 numbers",)),
        ("camera { position = (1,\n«{},3) }", ("found a group",)),
        ("camera { position = (1, 2«, ,3) }".replace("«, ,", ", «,"), ("found ','", "nothing before it")),
        ("camera { position = («,1,2,3) }", ("found ','",)),
        ("camera { position = (1, «2..5, 3) }", ("'2..5' is not a number",)),
        ("camera { position = «7 }", ("position: found '7'",)),
        ("«point_light { colour = 1 }", ("point_light has no position",)),
        ("«point_light { position = (0,0,0); quadratic_attenuation_coeff = 0 }", ("all three attenuation",)),
        ("point_light { position = (0,0,0); colour = «(1,-1,0) }", ("must be from 0",)),
        ("«directional_light { direction = (0,0,0) }", ("must point somewhere",)),
        ('ambient_light { colour = «"red" }', ('colour: found "red"', "a colour")),
        ("«cone { height = -1 }", ("height is -1.0",)),
        ("«cone { bottom_radius = 0 }", ("both radii are 0",)),
        ("cone { capped = «maybe }", ("true or false",)),
        ("box { name = «5 }", ("name: found '5', expected a string",)),
    ],
)
def test_values(marked, parts):
    check(HEAD + marked, *parts)


@pytest.mark.parametrize(
    ("marked", "parts"),
    [
        ("sphere { material = { diffuse = «(1,-1,0) } }", ("diffuse is", "must be from 0")),
        ("sphere { material = { diffuse = «-1 } }", ("diffuse is",)),
        ("sphere { material = { diffuse = (1,«{},0) } }", ("found a group",)),
        ("sphere { material = { index = «(1,2,1) } }", ("give one number",)),
        ("sphere { material = «{ index = 0 } }", ("index is 0.0",)),
        ("sphere { material = «5 }", ("expected a material { ... } or the name of one",)),
        ("sphere { «material; }", ("found nothing",)),
        ("sphere { material = «red }", ("no material 'red'", "known: none")),
        ('material = { name "a" } material = { name "b" }\nsphere { material = «"red" }', ("known: a, b",)),
        ('sphere { material = { name "a" } }\nsphere { material = «{ name "a" } }', ("defined already, in line 2",)),
        ('sphere { material = { diffuse = map(«"missing.png") } }', ("missing.png", "No such file")),
        ('sphere { material = { diffuse = map(«"/") } }', ("is a folder",)),
        ("sphere { material = { diffuse = «map(5) } }", ('expected map("image file")',)),
        ('sphere { material = { diffuse = «image("a.png") } }', ("found image(...)",)),
    ],
)
def test_materials(marked, parts):
    check(HEAD + marked, *parts)


def test_an_unreadable_map(tmp_path):
    (tmp_path / "text.png").write_text("hello")
    with pytest.raises(SceneError, match=r"^2:\d+: .*text\.png: no image that can be read: Not a PNG file") as caught:
        parse_ray(HEAD + 'sphere { material = { diffuse = map("text.png") } }', None, tmp_path)
    assert caught.value.column == 37


@pytest.mark.parametrize(
    ("marked", "parts"),
    [
        ("«translate(1,2,3)", ("translate needs geometry",)),
        ("«rotate;", ("rotate needs geometry: rotate(axis x",)),
        ("«scale()", ("needs geometry",)),
        ("scale(«red)", ("found 'red', expected geometry",)),
        ("«translate(1,2, sphere { })", ("found 2 arguments and geometry", "translate(x, y, z, geometry)")),
        ("translate(1,2,«sphere { }, sphere { })", ("expected a number",)),
        ("translate(1,2,«(3), sphere { })", ("expected a number",)),
        ("translate(1,2,3,«red { })", ("'red' is not known",)),
        ("scale(2, «scale(0, sphere { }))", ("singular", "scale other than 0")),
        ("«rotate(0,0,0,1, sphere { })", ("axis is (0, 0, 0)",)),
        ("«transform((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,2), sphere { })", ("last row",)),
        ("transform((1,0,0,0),«(0,1,0),(0,0,1,0),(0,0,0,1), sphere { })", ("has 3 numbers: give 4",)),
        ("scale(1e8, scale(1e8, «sphere { }))", ("transform[0, 0] is 1e+16",)),
    ],
)
def test_transforms(marked, parts):
    check(HEAD + marked, *parts)


@pytest.mark.parametrize(
    ("marked", "parts"),
    [
        ("«polymesh { faces = ((0,1,2)) }", ("polymesh has no points",)),
        ("«trimesh { points = ((0,1,2)) }", ("trimesh has no faces",)),
        ("polymesh { points = «(0,0,0); }", ("expected a list of tuples",)),
        ("polymesh { points = «5 }", ("points: found '5'",)),
        ("polymesh { «points; }", ("found nothing",)),
        (
            "polymesh { points = ((0,0,0),\n(1,1,1),\n  «(1,2),(3,4,5)) faces = () }",
            ("points[2] has 2 numbers: give 3",),
        ),
        ("polymesh { points = ((0,0,0), «(1)) faces = () }", ("points[1] has 1 number",)),
        ("polymesh { points = ((0,0,0), (1,«nan,2)) faces = () }", ("'nan' is not a number",)),
        ("polymesh { points = ((0,0,0), (1,«-inf,2)) faces = () }", ("'-inf'",)),
        ("polymesh { points = ((0,0,0), /* ,( */ (1,«1e39,2)) faces = () }", ("too large",)),
        ("polymesh { points = ((0,0,0), (1,2,«3-4)) faces = () }", ("'3-4'",)),
        ("polymesh { points = ((0,0,0), («,1,2,3)) faces = () }", ("','",)),
        ("polymesh { points = ((0,0,0), «,(1,2,3)) faces = () }", ("','",)),
        ("polymesh { points = ((0,0,0), «7, (1,2,3)) faces = () }", ("points: found",)),
        ('polymesh { points = ((0,0,0), (1,«"a",3)) faces = () }', ("points: found",)),
        ("polymesh { points = ((0,0,0), (1,2,3«; faces = () }", ("found ';'",)),
        ("«polymesh { points = ((0,0,1e30)) faces = () }", ("mesh: vertices[0, 2] is 1e+30",)),
        (f"polymesh {{ {TRIANGLE} faces = ((0,1,2), (0,1,«3)) }}", ("faces[1] names the point 3", "3 points (0 to 2)")),
        (f"polymesh {{ {TRIANGLE} faces = (\n (0,«-1,2)) }}", ("faces[0] names the point -1",)),
        (
            f"polymesh {{ {TRIANGLE} faces = ((0,1,2,0), (0,«1.5,2)) }}",
            ("faces[1] has the corner 1.5", "whole numbers"),
        ),
        (f"polymesh {{ {TRIANGLE} faces = ((0,1,2), /* ( */ «(0,1)) }}", ("faces[1] has 2 corners",)),
        (f"polymesh {{ {TRIANGLE} faces = («()) }}", ("faces[0] has 0 corners",)),
        ("polymesh { points = () faces = ((«0,1,2)) }", ("there are no points",)),
        (f"polymesh {{ {TRIANGLE} faces = () normals = «((0,0,1)) }}", ("1 normal for 3 points", "gennormals")),
        (f"polymesh {{ {TRIANGLE} faces = () normals = ((0,0,1),«(0,1),(1,0,0)) }}", ("normals[1] has 2 numbers",)),
        (f"polymesh {{ {TRIANGLE} faces = () materials = «({{}}, {{}}) }}", ("2 materials for 3 points",)),
        (f"polymesh {{ {TRIANGLE} faces = () materials = ({{}}, «red) }}", ("no material 'red'",)),
        (f"polymesh {{ {TRIANGLE} faces = () materials = ({{}}, «5) }}", ("found '5', expected a material",)),
        (f"polymesh {{ {TRIANGLE} faces = () materials = «red }}", ("expected a list of materials",)),
    ],
)
def test_meshes(marked, parts):
    check(HEAD + marked, *parts)


def test_place_in_a_long_list():
    points = ",\n".join(f"({i},0,0)" for i in range(20_000))
    check(
        f"{HEAD}polymesh {{ points = (\n{points.replace('(15000,0,0)', '«(15000,0)')}); faces = () }}",
        "points[15000] has",
    )
    check(f"{HEAD}polymesh {{ points = (\n{points.replace('(15000,0,0)', '(15000,«0.0.,0)')}); faces = () }}", "'0.0.'")
    check(
        f"{HEAD}polymesh {{ faces = (\n{points.replace('(15000,0,0)', '(15000,«20001,0)')}); points = ({points}) }}",
        "20001",
    )


def test_bad_bytes_are_placed(tmp_path):
    file = tmp_path / "latin.ray"
    file.write_bytes(HEAD.encode() + 'sphere { name = "é'.encode() + b'\xe9" }')
    with pytest.raises(SceneError, match="0xe9") as caught:
        read_ray(file)
    assert (caught.value.line, caught.value.column) == (2, 19)


def test_crlf_lines_are_counted_once():
    check(HEAD.replace("\n", "\r\n") + "// a\r\nsphere {\r\n  «bad }", "sphere has no 'bad'")


@pytest.mark.parametrize(
    "text",
    [
        HEAD + "{" * 100_000,
        HEAD + "translate(1,2,3," * 100_000,
        HEAD + "a = " + "(" * 100_000,
        HEAD + "a = " + "((" * 50_000 + "1" + "),)" * 50_000,
        HEAD + "material = { name = (" * 5_000,
    ],
)
def test_deep_nesting_is_an_error(text):
    error_of(text)


@pytest.mark.parametrize(
    "piece",
    ["(1,2 ", "((1,2) ", "(()) ", "/*", "* /", '"', "(1,(", "-", "9", "a", "((1 2 3),", " ,", "( /**/", "//\n(("],
)
@pytest.mark.parametrize(
    "start", [HEAD, HEAD + "polymesh { points = (", HEAD + "polymesh { points = ((", HEAD + "a {("]
)
def test_long_garbage_of_any_kind_ends_in_an_error(piece, start):
    # A regular expression that tries everything would never come back from this.
    error_of(start + piece * (100_000 // len(piece)))
