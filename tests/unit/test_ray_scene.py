"""Every construct of the .ray language, by example."""

import math

import numpy as np
import pytest

from lumipath.formats.ray import parse_ray, read_ray
from lumipath.scene import AmbientLight, Camera, Cone, DirectionalLight, Mesh, PointLight, Sphere


def scene_of(body):
    return parse_ray("SBT-raytracer 1.0\n" + body)


def shape_of(body):
    (shape,) = scene_of(body).shapes
    return shape


def material_of(body):
    return shape_of(f"sphere {{ material = {{ {body} }} }}").material


@pytest.mark.parametrize(
    "header", ["SBT-raytracer 1.0", "\ufeffSBT-raytracer 1.1", "/* a */ // b\n SBT-raytracer 0.9f"]
)
def test_header(header, tmp_path):
    file = tmp_path / "small.ray"
    file.write_text(header + "\r\n", encoding="utf-8")
    scene = read_ray(file)
    assert (scene.shapes, scene.lights, scene.cameras, scene.name) == ([], [], [], "small")


def test_camera():
    camera = scene_of(
        "camera { position = (1,2,3); viewdir=(0,0,2) updir = (0,1,1); fov=40 aspectratio = 1.5; name = main }"
    ).cameras[0]
    assert (camera.position, camera.fov, camera.aspect, camera.name) == ((1, 2, 3), 40, 1.5, "main")
    right, up, backward = camera.axes()
    np.testing.assert_allclose([right, up, backward], [(-1, 0, 0), (0, 1, 0), (0, 0, -1)], atol=1e-7)


def test_default_camera():
    camera = scene_of("camera { }").cameras[0]
    assert camera == Camera()


def test_all_cameras_are_listed():
    cameras = scene_of('camera { fov 30; name "a" } camera { fov 50; name "b" }').cameras
    assert [(camera.name, camera.fov) for camera in cameras] == [("a", 30), ("b", 50)]


@pytest.mark.parametrize(
    ("axis", "angle", "direction", "up"),
    [
        ((0, 1, 0), 90, (-1, 0, 0), (0, 1, 0)),  # a turn to the left
        ((1, 0, 0), 90, (0, 1, 0), (0, 0, 1)),  # a look upwards
        ((0, 0, 1), 90, (0, 0, -1), (-1, 0, 0)),  # a roll
        ((0, 0, 1), 0, (0, 0, -1), (0, 1, 0)),
    ],
)
@pytest.mark.parametrize("spelling", ["quaternian", "quaternion"])
def test_quaternian(axis, angle, direction, up, spelling):
    half = math.radians(angle) / 2
    x, y, z = (3 * math.sin(half) * part for part in axis)
    camera = scene_of(f"camera {{ {spelling} = ({x},{y},{z},{3 * math.cos(half)}); }}").cameras[0]
    np.testing.assert_allclose(camera.direction, direction, atol=1e-7)
    np.testing.assert_allclose(camera.up, up, atol=1e-7)


def test_lights():
    point, plain, sun, ambient = scene_of("""
        point_light { position = (1,2,3); color = (1,.5,0); constant_attenuation_coeff = 0.25
                      linear_attenuation_coeff 0.5; quadratic_attenuation_coeff=0 }
        point_light { position (0,0,0) }
        directional_light { direction = (0,-2,0); colour = 3 };
        ambient_light { color = (.25,.5,1.0) }
    """).lights
    assert isinstance(point, PointLight)
    assert (point.position, point.colour, point.attenuation) == ((1, 2, 3), (1, 0.5, 0), (0.25, 0.5, 0))
    assert (plain.colour, plain.attenuation) == ((1, 1, 1), (0, 0, 1))
    assert isinstance(sun, DirectionalLight)
    assert (sun.direction, sun.colour) == ((0, -1, 0), (3, 3, 3))
    assert isinstance(ambient, AmbientLight)
    assert ambient.colour == (0.25, 0.5, 1)


def test_light_groups():
    scene = scene_of(
        'point_light { position = (0, 1, 0); group = "key"; } directional_light { group = back; }'
        "sphere { material = { emissive = 1; group = lamp; } }"
    )
    assert scene.light_groups == ("default", "back", "key", "lamp")


def test_primitives():
    sphere, box, square, cylinder, cone, open_cone = scene_of("""
        sphere { name = "s" } box { } square { name "q"; } cylinder { }
        cone { } cone { capped = false; bottom_radius = 2; top_radius = .5; height = 3 }
    """).shapes
    assert isinstance(sphere, Sphere)
    assert sphere.name == "s"
    assert isinstance(box, Mesh)
    assert (len(box.faces), box.two_sided, box.vertices.min(), box.vertices.max()) == (12, True, -0.5, 0.5)
    assert (len(square.faces), square.two_sided, square.name) == (2, True, "q")
    assert isinstance(cylinder, Cone)
    assert (cylinder.bottom_radius, cylinder.top_radius, cylinder.height, cylinder.capped) == (1, 1, 1, True)
    assert (cone.bottom_radius, cone.top_radius, cone.height, cone.capped) == (1, 0, 1, True)
    assert (open_cone.bottom_radius, open_cone.top_radius, open_cone.height, open_cone.capped) == (2, 0.5, 3, False)


@pytest.mark.parametrize(
    ("value", "capped"), [("", True), ("= true", True), ("= no", False), ("0", False), ("=1", True)]
)
def test_capped(value, capped):
    assert shape_of(f"cone {{ capped {value}; }}").capped is capped


QUARTER = math.pi / 2


@pytest.mark.parametrize(
    ("text", "point"),
    [
        ("translate(10, 20, 30, @)", (11, 22, 33)),
        ("scale(2, @)", (2, 4, 6)),
        ("scale(2, 3, 4, @);", (2, 6, 12)),
        (f"rotate(0, 0, 5, {QUARTER}, @)", (-2, 1, 3)),
        (f"rotate(1, 0, 0, {QUARTER}, {{ @ }})", (1, -3, 2)),
        (f"rotate(0, 1, 0, {QUARTER}, @)", (3, 2, -1)),
        ("transform((0,1,0,7),(1,0,0,8),(0,0,-1,9),(0,0,0,1), @)", (9, 9, 6)),
        ("translate(1,0,0, scale(10, @))", (11, 20, 30)),
        ("scale(10, { translate(1,0,0, @) })", (20, 20, 30)),
        ("translate(1,0,0,\n// comment\nscale(2,2,2,@,),)", (3, 4, 6)),
        ("translate(1 0 0 @)", (2, 2, 3)),
    ],
)
def test_transforms(text, point):
    sphere = shape_of(text.replace("@", "sphere { }"))
    np.testing.assert_allclose(sphere.transform @ (1, 2, 3, 1), (*point, 1), atol=1e-12)
    mesh = shape_of(text.replace("@", "polymesh { points=((1,2,3),(0,0,0),(0,1,0)); faces=((0,1,2)) }"))
    assert {tuple(vertex) for vertex in mesh.vertices.round(4).tolist()} >= {point}


def test_groups_do_not_leak_transforms():
    first, second = scene_of("translate(5,0,0, { sphere { } { } }) { { sphere { } } }").shapes
    assert (first.transform[0, 3], second.transform[0, 3]) == (5, 0)


def test_deep_nesting_is_read():
    depth = 3000
    shape = shape_of("translate(1,0,0," * depth + "{" * depth + "sphere{}" + "}" * depth + ")" * depth)
    assert shape.transform[0, 3] == depth


def test_material_values():
    material = material_of("""
        emissive = (1, 2, 3); ambient = 0.5; specular 0.25; reflective = (0.1, 0.2, 0.3);
        diffuse=(.5,.5,1.); transmissive = 0.75; shininess = 96.0; index = (1.5, 1.5, 1.5); name "glass";
    """)
    assert (material.emission, material.ambient, material.specular) == ((1, 2, 3), (0.5,) * 3, (0.25,) * 3)
    assert material.reflective == pytest.approx((0.1, 0.2, 0.3))
    assert (material.diffuse, material.transmissive) == ((0.5, 0.5, 1), (0.75,) * 3)
    assert (material.shininess, material.index, material.name) == (96, 1.5, "glass")


def test_specular_and_reflective_are_none_unless_given():
    assert (material_of("").specular, material_of("").reflective) == (None, None)
    assert (material_of("specular=0").specular, material_of("reflective=(0,0,0)").reflective) == ((0, 0, 0),) * 2


def test_named_materials_are_shared():
    a, b, c, d = scene_of("""
        material = { name = "dark-red_1"; diffuse = (1,0,0) };
        sphere { material = { name "blue"; diffuse = (0,0,1) } }
        { sphere { material = "dark-red_1" } }
        sphere { material = dark-red_1; }
        sphere { material "blue" }
    """).shapes
    assert (b.material.name, a.material.name) == ("dark-red_1", "blue")
    assert b.material is c.material
    assert a.material is d.material


def test_material_is_the_default_of_what_follows_in_its_group():
    shapes = scene_of("""
        sphere { }
        material = { diffuse = 0.125 }
        sphere { }
        { sphere { } material { diffuse = 0.25 }; sphere { }
          scale(2, { material = { diffuse=0.5 } box { } }) square { } }
        sphere { } sphere { material = { diffuse = 1 } }
    """).shapes
    assert [shape.material.diffuse[0] for shape in shapes] == [0, 0.125, 0.125, 0.25, 0.5, 0.25, 0.125, 1]


def test_comments_strings_and_separators():
    first, second = scene_of("""
        // } a brace in a comment /* and no comment in it
        ;; /* ; { "
        ***/ sphere { name = "// no /* comment */ { ; " ; ; } ;
        /**/box{/***/name="";/*/ * /*/}//last""").shapes
    assert (first.name, second.name) == ("// no /* comment */ { ; ", "")


@pytest.mark.parametrize(
    ("word", "value"),
    [
        ("1", 1), ("+1", 1), ("1.5f", 1.5), (".5", 0.5), ("5.", 5), ("1e-3", 1e-3), ("1.e+2F", 100), ("007", 7),
        ("0x1.8p3", 12), ("0X.8P1f", 1), ("0xAp0L", 10), ("0x10", 16), ("1E2l", 100), ("1e-400", 0), ("+.5e0", 0.5),
    ],
)  # fmt: skip
def test_number_spellings(word, value):
    assert (
        shape_of(f"cone {{ height = {word if value else 3}; bottom_radius={word}; top_radius = 1 }}").bottom_radius
        == value
    )
    assert shape_of(f"polymesh {{ points = (({word} , {word}/**/,{word})) faces=() }}").vertices.tolist() == [
        [np.float32(value)] * 3
    ]
