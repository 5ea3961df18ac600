"""Images to pixels, textures, environments and cubemaps."""

import numpy as np
import OpenImageIO
import pytest

from lumipath.errors import ImageError, SceneError
from lumipath.formats import cubemap, files
from lumipath.formats.images import read_cubemap, read_environment, read_pixels, read_texture


def write(path, pixels, kind=None, names=None, **attributes):
    pixels = np.asarray(pixels)
    spec = OpenImageIO.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind or pixels.dtype.name)
    if names:
        spec.channelnames = names
    for name, value in attributes.items():
        spec.attribute("oiio:" + name, value)
    file = OpenImageIO.ImageOutput.create(str(path))
    assert file.open(str(path), spec)
    assert file.write_image(pixels)
    file.close()
    return path


def srgb_to_linear(value):
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def test_whole_numbers_are_srgb(tmp_path):
    values = np.array([[(0, 5, 10), (11, 128, 255)], [(1, 2, 3), (200, 100, 50)]], np.uint8)
    pixels = read_pixels(write(tmp_path / "a.png", values))
    assert (pixels.dtype, pixels.shape) == (np.float32, (2, 2, 3))
    np.testing.assert_allclose(pixels, np.vectorize(srgb_to_linear)(values / 255), rtol=1e-6)


def test_sixteen_bits(tmp_path):
    values = np.array([[(0, 1000, 65535)]], np.uint16)
    pixels = read_pixels(write(tmp_path / "a.png", values))
    np.testing.assert_allclose(pixels, np.vectorize(srgb_to_linear)(values / 65535), rtol=1e-6)


@pytest.mark.parametrize(
    ("name", "kind"), [("a.exr", "float"), ("a.exr", "half"), ("a.hdr", "float"), ("a.tif", "float")]
)
def test_floats_are_linear(tmp_path, name, kind):
    values = np.array([[(0.5, 1, 2), (32, 48, 64)]], np.float32)
    np.testing.assert_allclose(read_pixels(write(tmp_path / name, values, kind)), values, rtol=0.02)


def test_jpeg(tmp_path):
    pixels = read_pixels(write(tmp_path / "a.jpg", np.full((8, 8, 3), 128, np.uint8)))
    np.testing.assert_allclose(pixels, srgb_to_linear(128 / 255), rtol=0.05)


def test_alpha_is_dropped_and_grey_replicated(tmp_path):
    alpha = {"UnassociatedAlpha": 1}
    colour = write(tmp_path / "rgba.png", np.array([[(255, 128, 0, 10), (255, 0, 255, 0)]], np.uint8), **alpha)
    np.testing.assert_allclose(read_pixels(colour), [[(1, srgb_to_linear(128 / 255), 0), (1, 0, 1)]], rtol=1e-6)
    grey = write(tmp_path / "y.png", np.array([[(255,), (0,)]], np.uint8))
    assert read_pixels(grey).tolist() == [[[1, 1, 1], [0, 0, 0]]]
    grey_alpha = write(tmp_path / "ya.png", np.array([[(255, 3), (0, 255)]], np.uint8), names=("Y", "A"), **alpha)
    assert read_pixels(grey_alpha).tolist() == [[[1, 1, 1], [0, 0, 0]]]


def test_layers_of_an_exr_are_told_by_name(tmp_path):
    names = ("Z", "depth", "B", "G", "R", "A")
    file = write(tmp_path / "layers.exr", np.arange(6, dtype=np.float32).reshape(1, 1, 6), names=names)
    assert read_pixels(file).tolist() == [[[4, 3, 2]]]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"hello", "Not a PNG file"),
        (b"", "Not a PNG file"),
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "no image that can be read"),
    ],
)
def test_no_image(tmp_path, content, message):
    (tmp_path / "a.png").write_bytes(content)
    with pytest.raises(ImageError, match=message) as caught:
        read_pixels(tmp_path / "a.png")
    assert "\n" not in str(caught.value)


def test_damaged(tmp_path):
    noise = np.random.default_rng(1).integers(0, 255, (64, 64, 3), dtype=np.uint8)
    file = write(tmp_path / "a.png", noise)
    file.write_bytes(file.read_bytes()[:5000])
    with pytest.raises(ImageError, match=r"a\.png: the image is damaged: ") as caught:
        read_pixels(file)
    assert "\n" not in str(caught.value)


def test_missing_folder_and_unreadable(tmp_path, monkeypatch):
    with pytest.raises(ImageError, match=r"missing\.png': No such file"):
        read_pixels(tmp_path / "missing.png")
    with pytest.raises(ImageError, match="is a folder"):
        read_texture(tmp_path)
    with pytest.raises(ImageError, match="null"):
        read_pixels("a\0b.png")
    with pytest.raises(ImageError, match="cannot read"):
        read_pixels("a" * 5000)

    def refuse(*args):
        raise PermissionError(13, "Permission denied")

    file = write(tmp_path / "a.png", np.zeros((1, 1, 3), np.uint8))
    monkeypatch.setattr(files.Path, "open", refuse)
    with pytest.raises(ImageError, match=r"a\.png': Permission denied; check"):
        read_pixels(file)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_numbers_that_are_not_finite(tmp_path, value):
    values = np.ones((2, 3, 3), np.float32)
    values[1, 2, 0] = value
    with pytest.raises(ImageError, match="column 2, row 1 is not finite"):
        read_pixels(write(tmp_path / "a.exr", values))


def test_texture_and_environment(tmp_path):
    file = write(tmp_path / "a.exr", np.full((2, 4, 3), 2, np.float32))
    assert (read_texture(file).name, read_texture(file).mean()) == ("a.exr", (2, 2, 2))
    assert (read_environment(file).name, read_environment(file).image.shape) == ("a.exr", (2, 4, 3))
    negative = write(tmp_path / "b.exr", np.full((2, 4, 3), -1, np.float32))
    with pytest.raises(SceneError, match=r"texture b\.exr has negative"):
        read_texture(negative)
    with pytest.raises(SceneError, match=r"environment b\.exr has negative"):
        read_environment(negative)


def along(image, direction):
    """The pixel of an equirectangular image in a direction, by the words of `Environment`'s docstring."""
    height, width, _ = image.shape
    x, y, z = np.asarray(direction, float) / np.linalg.norm(direction)
    column = (0.5 + np.arctan2(x, -z) / (2 * np.pi)) * width
    row = np.arccos(y) / np.pi * height
    return image[min(int(row), height - 1), int(column) % width]


AXES = {
    "posx": (1, 0, 0),
    "negx": (-1, 0, 0),
    "posy": (0, 1, 0),
    "negy": (0, -1, 0),
    "posz": (0, 0, 1),
    "negz": (0, 0, -1),
}
# What lies to the right and upwards in each face, for someone inside who turns their head from straight ahead, -z.
RIGHT = {
    "posx": (0, 0, 1),
    "negx": (0, 0, -1),
    "posy": (1, 0, 0),
    "negy": (1, 0, 0),
    "posz": (-1, 0, 0),
    "negz": (1, 0, 0),
}
UP = {"posx": (0, 1, 0), "negx": (0, 1, 0), "posy": (0, 0, 1), "negy": (0, 0, -1), "posz": (0, 1, 0), "negz": (0, 1, 0)}


def write_faces(folder, faces, pattern="{}.exr"):
    return {face: write(folder / pattern.format(face), np.asarray(image, np.float32)) for face, image in faces.items()}


def test_flat_faces_lie_in_their_directions(tmp_path):
    colours = {face: np.full((8, 8, 3), np.add(direction, 1)) for face, direction in AXES.items()}
    image = read_cubemap(write_faces(tmp_path, colours)["negy"]).image
    assert image.shape == (16, 32, 3)
    for face, direction in AXES.items():
        np.testing.assert_allclose(along(image, direction), colours[face][0, 0])


def test_faces_are_neither_mirrored_nor_turned(tmp_path):
    # Someone upright inside a right-handed world has this on the right.
    assert all(tuple(np.cross(AXES[face], UP[face])) == RIGHT[face] for face in AXES)
    size = 64
    down, across = np.mgrid[0:size, 0:size] / size
    faces = {face: np.stack([across, down, np.full_like(down, index)], axis=-1) for index, face in enumerate(AXES)}
    image = read_cubemap(write_faces(tmp_path, faces)["posx"]).image
    for index, face in enumerate(AXES):
        for right, up in ((0.5, 0.2), (-0.5, 0.2), (0.3, -0.6), (-0.7, -0.4)):
            direction = AXES[face] + right * np.array(RIGHT[face]) + up * np.array(UP[face])
            wanted = ((1 + right) / 2, (1 - up) / 2, index)
            np.testing.assert_allclose(along(image, direction), wanted, atol=0.03)


def test_a_continuous_sky_stays_continuous(tmp_path):
    """Colours that are a smooth function of the direction come back as this function: no seams, no wrong turns."""
    size = 32
    steps = (np.arange(size) + 0.5) / size * 2 - 1
    faces = {}
    for face, axis in AXES.items():
        points = axis + steps[None, :, None] * np.array(RIGHT[face]) - steps[:, None, None] * np.array(UP[face])
        faces[face] = 1 + points / np.linalg.norm(points, axis=-1, keepdims=True)
    image = read_cubemap(write_faces(tmp_path, faces)["posx"]).image
    height, width, _ = image.shape
    polar = (np.arange(height)[:, None] + 0.5) / height * np.pi
    angle = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
    wanted = np.stack(
        [np.sin(polar) * np.sin(angle), np.cos(polar) + 0 * angle, -np.sin(polar) * np.cos(angle)], axis=-1
    )
    np.testing.assert_allclose(image, 1 + wanted, atol=0.04)


def test_one_pixel_faces_and_very_large_ones(monkeypatch):
    faces = np.arange(6, dtype=np.float32)[:, None, None, None] * np.ones((1, 1, 3), np.float32)
    assert cubemap.equirectangular(faces).shape == (2, 4, 3)
    monkeypatch.setattr(cubemap, "MAX_WIDTH", 8)
    assert cubemap.equirectangular(np.zeros((6, 50, 50, 3), np.float32)).shape == (4, 8, 3)


@pytest.mark.parametrize(
    ("name", "face"),
    [
        ("posx.jpg", "posx"), ("sky_neg_y.png", "negy"), ("PosZ.PNG", "posz"), ("Sky-Negative-X.exr", "negx"),
        ("x.jpg", None), ("pos.jpg", None), ("front.png", None), ("posa.x", None),
    ],
)  # fmt: skip
def test_names_of_faces(name, face):
    assert cubemap.face_of(cubemap.Path(name)) == face


@pytest.fixture
def faces(tmp_path):
    flat = {face: np.ones((2, 2, 3)) for face in AXES}
    (tmp_path / "posx.txt").write_text("no image, so not a second posx")
    (tmp_path / "readme.png").write_text("no face")
    (tmp_path / "._Sky_posx.exr").write_text("hidden, so not a second posx")
    return write_faces(tmp_path, flat, "Sky_{}.exr")


def test_cubemap_by_any_face(faces):
    for file in faces.values():
        assert read_cubemap(file).name == file.name


def test_missing_faces(faces):
    faces["negz"].unlink()
    faces["posy"].unlink()
    with pytest.raises(ImageError, match=r"Sky_posx\.exr: its folder has no posy, negz; a cubemap needs"):
        read_cubemap(faces["posx"])


def test_doubled_faces(faces):
    faces["negx"].with_name("old_NegX.png").write_bytes(b"")
    with pytest.raises(ImageError, match=r"face twice: Sky_negx\.exr, old_NegX\.png; keep one"):
        read_cubemap(faces["posx"])


@pytest.mark.parametrize(
    ("shape", "message"),
    [((2, 3, 3), r"Sky_negx\.exr: .* square, not 3 x 2"), ((4, 4, 3), r"negx\.exr: 4 x 4 .*Sky_posx\.exr has 2 x 2")],
)
def test_sizes_of_faces(faces, shape, message):
    write(faces["negx"], np.ones(shape, np.float32))
    with pytest.raises(ImageError, match=message):
        read_cubemap(faces["posz"])


def test_no_cubemap(tmp_path, faces):
    with pytest.raises(ImageError, match="must contain pos or neg"):
        read_cubemap(tmp_path / "readme.png")
    with pytest.raises(ImageError, match="No such file"):
        read_cubemap(tmp_path / "none" / "posx.png")
    faces["negy"].write_text("hello")
    with pytest.raises(ImageError, match=r"Sky_negy\.exr: no image"):
        read_cubemap(faces["posx"])
