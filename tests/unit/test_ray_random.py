"""Random .ray files: what is written is what is read, and nothing but a SceneError ever comes out of a wrong file."""

import random
import warnings

import numpy as np
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from lumipath.errors import SceneError
from lumipath.formats.ray import parse_ray, read_ray
from lumipath.scene import Camera, Cone, Cylinder, Material, Mesh, PointLight, Scene, Sphere, Square

COMMENTS = ('// } ( ; "\n', "/* ; ) // */", "/***/", "/* \n\n */")
FEW = settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))


class Writer:
    """Writes scenes in random spellings."""

    def __init__(self, seed):
        self.random = random.Random(seed)

    def gap(self, needed=False):
        blanks = [" ", "\n", "\t", "\r\n", *COMMENTS]
        count = self.random.choice((0, 0, 0, 1, 2))
        return "".join(self.random.choices(blanks, k=max(count, needed)))

    def number(self, value):
        spellings = [
            repr(value),
            f"{value:.17e}",
            value.hex(),
            repr(value) + self.random.choice("fFlL"),
            f"{value!r:0>5}",
        ]
        if value == int(value):
            spellings += [f"{value:.0f}.", f"{value:.0f}"]
        if repr(value).startswith("0."):
            spellings.append(repr(value)[1:])
        word = self.random.choice(spellings if value >= 0 else spellings[:4])
        return self.random.choice(("", "+")) + word if value >= 0 else word

    def items(self, words):
        comma = self.random.choice(("", ","))
        between = [self.gap() + "," + self.gap() for _ in words[1:]] + [comma]
        return (
            "(" + "".join(self.gap() + word + gap for word, gap in zip(words, between, strict=True)) + self.gap() + ")"
        )

    def tuple(self, values):
        return self.items([self.number(float(value)) for value in values])

    def list(self, rows):
        return self.items([self.tuple(row) for row in rows]) if len(rows) else "()"

    def block(self, keyword, *pairs):
        pairs = list(pairs)
        self.random.shuffle(pairs)
        texts = []
        for key, value in pairs:
            between = self.random.choice(("=", "= ", " = ", self.gap() + "=" + self.gap()))
            texts.append(key + between + value + self.gap() + self.random.choice((";", self.gap(needed=True))))
        return keyword + self.gap() + "{" + self.gap() + "".join(texts) + self.gap() + "}"

    def colour(self, value):
        if len(set(value)) == 1 and self.random.random() < 0.5:
            return self.number(value[0])
        return self.tuple(value)

    def material(self, material):
        keys = {"emissive": material.emission, "diffuse": material.diffuse, "transmissive": material.transmissive}
        keys |= {"specular": material.specular, "reflective": material.reflective, "ambient": material.ambient}
        pairs = [(key, self.colour(value)) for key, value in keys.items() if value is not None]
        pairs += [("index", self.number(material.index)), ("shininess", self.number(material.shininess))]
        return self.block("", *pairs)

    def placed(self, transform, text):
        rows = [self.tuple(row) for row in transform]
        return "transform" + self.items([*rows, self.random.choice((text, "{" + text + "}"))])

    def shape(self, shape):
        pairs = [("material", self.material(shape.material)), ("name", f'"{shape.name}"')]
        if isinstance(shape, Sphere):
            return self.placed(shape.transform, self.block("sphere", *pairs))
        if isinstance(shape, Cone):
            sizes = [(key, self.number(getattr(shape, key))) for key in ("bottom_radius", "top_radius", "height")]
            capped = ("capped", "true" if shape.capped else "false")
            return self.placed(shape.transform, self.block("cone", *pairs, *sizes, capped))
        lists = [("points", self.list(shape.vertices)), ("faces", self.list(shape.faces))]
        if shape.normals is not None:
            lists.append(("normals", self.list(shape.normals)))
        return self.block(self.random.choice(("polymesh", "trimesh")), *pairs, *lists)

    def scene(self, scene):
        texts = []
        for camera in scene.cameras:
            vectors = {"position": camera.position, "viewdir": camera.direction, "updir": camera.up}
            numbers = {"fov": camera.fov, "aspectratio": camera.aspect}
            pairs = [(key, self.tuple(value)) for key, value in vectors.items()]
            texts.append(self.block("camera", *pairs, *((key, self.number(value)) for key, value in numbers.items())))
        for light in scene.lights:
            colour = self.random.choice(("color", "colour"))
            kinds = zip(("constant", "linear", "quadratic"), light.attenuation, strict=True)
            pairs = [(f"{kind}_attenuation_coeff", self.number(value)) for kind, value in kinds]
            position = ("position", self.tuple(light.position))
            texts.append(self.block("point_light", *pairs, position, (colour, self.colour(light.colour))))
        texts += [self.shape(shape) for shape in scene.shapes]
        return f"{self.gap()}SBT-raytracer {self.number(1.0)} " + self.gap().join(texts) + self.gap()


def number(low, high):
    return st.floats(low, high, width=32).map(lambda value: value + 0.0)


vectors = st.tuples(*[number(-1e6, 1e6)] * 3)
colours = number(0, 100) | st.tuples(*[number(0, 100)] * 3)
materials = st.builds(
    Material, emission=colours, diffuse=colours, transmissive=colours, ambient=colours,
    specular=st.none() | colours, reflective=st.none() | colours, index=number(0.5, 4), shininess=number(0, 200),
)  # fmt: skip
names = st.text(st.characters(exclude_categories=["Cc", "Cs", "Zl", "Zp"], exclude_characters='"'), max_size=8)


@st.composite
def transforms(draw):
    matrix = np.eye(4)
    matrix[:3, 3] = draw(vectors)
    matrix[:3, :3] += np.triu(np.array(draw(st.lists(number(0, 9), min_size=9, max_size=9))).reshape(3, 3))
    return matrix


@st.composite
def meshes(draw):
    vertices = np.array(draw(st.lists(vectors, min_size=1, max_size=6)), np.float32)
    index = st.integers(0, len(vertices) - 1)
    faces = np.array(draw(st.lists(st.tuples(index, index, index), max_size=6)), np.int32).reshape(-1, 3)
    normals = draw(st.sampled_from((None, np.tile((0.0, 0.0, 1.0), (len(vertices), 1)))))
    material = draw(materials)
    two_sided = not material.is_one_sided
    return Mesh(
        vertices=vertices, faces=faces, normals=normals, material=material, two_sided=two_sided, name=draw(names)
    )


cones = st.builds(
    Cone, transform=transforms(), material=materials, name=names, bottom_radius=number(0.5, 9), top_radius=number(0, 9),
    height=number(0.125, 9), capped=st.booleans(),
)  # fmt: skip
spheres = st.builds(Sphere, transform=transforms(), material=materials, name=names)
# Never along the direction, whose parts are all positive.
ups = st.tuples(number(-9, -5), number(5, 9), number(-9, -5))
cameras = st.builds(
    Camera, position=vectors, direction=st.tuples(*[number(1, 2)] * 3), up=ups, fov=number(1, 170),
    aspect=number(0.125, 8),
)  # fmt: skip
lights = st.builds(PointLight, position=vectors, colour=colours, attenuation=st.tuples(*[number(0.125, 9)] * 3))
scenes = st.builds(
    Scene, shapes=st.lists(meshes() | cones | spheres, max_size=3), lights=st.lists(lights, max_size=2),
    cameras=st.lists(cameras, max_size=2),
)  # fmt: skip


def plain(value):
    """A value as nested lists, so that equal scenes have equal ones."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if hasattr(value, "__attrs_attrs__"):
        return [type(value).__name__, *(plain(getattr(value, one.name)) for one in value.__attrs_attrs__)]
    return value


@given(scenes, st.integers(0, 2**32))
@FEW
def test_what_is_written_is_read(scene, seed):
    assert plain(parse_ray(Writer(seed).scene(scene))) == plain(scene)


def may_only_raise_scene_errors(read):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        error = None
        try:
            read()
        except SceneError as caught:
            error = caught
    if error is not None:
        assert "\n" not in str(error)
        assert error.line is not None
        assert error.column is not None


@given(st.text())
@example("\ud800")
@FEW
def test_any_text(text):
    may_only_raise_scene_errors(lambda: parse_ray(text))
    may_only_raise_scene_errors(lambda: parse_ray("SBT-raytracer 1.0 " + text))


@given(st.binary())
@FEW
def test_any_bytes(tmp_path_factory, data):
    file = tmp_path_factory.getbasetemp() / "any.ray"
    for start in (b"", b"SBT-raytracer 1.0\n"):
        file.write_bytes(start + data)
        may_only_raise_scene_errors(lambda: read_ray(file))


_WORDS = """
    { } ( ) = , ; " // /* */ camera point_light directional_light ambient_light sphere box square cylinder cone polymesh
    trimesh translate rotate scale transform material name position fov quaternian aspectratio viewdir updir colour
    direction emissive diffuse specular transmissive index shininess map points faces normals materials gennormals
    capped height 0 1 2 -1 0.5 1.5 1e30 1e-30 -1e38 nan "x" (1,2,3) (0,0,0) (0,0,0,1)
    (1,0,0,0) () ((0,0,0),(1,0,0),(0,1,0))
    ((0,1,2)) ((0,1,2,1)) map("x") material={} {diffuse=1} {name"x"} (x,x,x) =(1,2,3) =1 ={ ="x" red true
"""
WORDS = _WORDS.split()


@given(st.lists(st.sampled_from(WORDS), max_size=40), st.sampled_from(["", "\n"]))
@settings(FEW, max_examples=200)
def test_any_words(words, end):
    may_only_raise_scene_errors(lambda: parse_ray("SBT-raytracer 1.0 " + " ".join(words) + end))


VALID = """SBT-raytracer 1.0
camera { position=(0,0,3); fov = 40; quaternian=(0,0,0,1) } point_light { position=(1,2,3); color=(1,1,1) }
material = { name "red"; diffuse = (1,0,0); index 1.5 };
translate(1,2,3, rotate(0,1,0,1.5, scale(2, { sphere { material = red } cone { capped = true; height=2 } })));
transform((1,0,0,0),(0,1,0,0),(0,0,1,0),(0,0,0,1), box { name = "b" })
polymesh { points = ((0,0,0),(1,0,0),(1,1,0),(.2,.1,0)); faces = ((0,1,2,3),(0,1,2)); gennormals;
           normals = ((0,0,1),(0,0,1),(0,0,1),(0,0,1)); materials = (red, {specular=1}, "red", {}) }
"""


def test_the_valid_text_is_valid():
    assert len(parse_ray(VALID).shapes) == 4


@given(st.integers(0, len(VALID)), st.integers(0, 12), st.sampled_from(WORDS) | st.text(max_size=3))
@settings(FEW, max_examples=200)
def test_damaged_texts(place, length, inserted):
    may_only_raise_scene_errors(lambda: parse_ray(VALID[:place] + inserted + VALID[place + length :]))


def test_every_cut_off_text():
    for end in range(len(VALID)):
        may_only_raise_scene_errors(lambda end=end: parse_ray(VALID[:end]))


def test_cylinders_and_squares_round_trip():
    scene = parse_ray("SBT-raytracer 1.0 cylinder { } scale(2, square { })")
    assert plain(scene.shapes) == plain([Cylinder(), Square(transform=np.diag((2.0, 2, 2, 1)))])
