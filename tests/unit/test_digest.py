"""Digests of scenes: equal for equal scenes, other for others."""

import subprocess
import sys
from pathlib import Path

import attrs
import numpy as np
import pytest

import lumipath
from lumipath.scene import (
    Box,
    Camera,
    Cone,
    DirectionalLight,
    Environment,
    Material,
    Mesh,
    PointLight,
    Scene,
    Sphere,
    Texture,
    scene_digest,
)
from lumipath.scenes import builtin, names

MESH = Mesh(vertices=[(0, 0, 0), (1, 0, 0), (0, 1, 0)], faces=[(0, 1, 2)])
IMAGE = np.arange(12.0).reshape(2, 2, 3)
BASE = {"shapes": [MESH, Sphere()], "lights": [PointLight(position=(0, 1, 0))]}


def test_equal_scenes_are_equal():
    assert scene_digest(Scene(**BASE)) == scene_digest(Scene(**BASE))
    assert scene_digest(builtin("primitives")) == scene_digest(builtin("primitives"))


def test_it_is_the_same_in_another_process():
    code = "import lumipath; from lumipath.scene import scene_digest; print(scene_digest(lumipath.builtin('textures')))"
    sources = str(Path(lumipath.__path__[0]).parent)
    command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {sources!r}); {code}"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == scene_digest(builtin("textures"))


def test_built_in_scenes_differ():
    small = [name for name in names() if not name.startswith("bench-blob")]
    assert len({scene_digest(builtin(name)) for name in small}) == len(small)


@pytest.mark.parametrize(
    "change",
    [
        {"shapes": [MESH]},
        {"shapes": [Sphere(), MESH]},
        {"shapes": [attrs.evolve(MESH, vertices=[(0, 0, 0), (1, 0, 0), (0, 1, 1e-6)]), Sphere()]},
        {"shapes": [attrs.evolve(MESH, two_sided=False), Sphere()]},
        {"shapes": [attrs.evolve(MESH, material=Material(diffuse=0.3)), Sphere()]},
        {"shapes": [attrs.evolve(MESH, vertex_materials=(Material(),) * 3), Sphere()]},
        {"shapes": [MESH, Cone()]},
        {"lights": []},
        {"lights": [DirectionalLight()]},
        {"lights": [PointLight(position=(0, 1, 0), colour=0.5)]},
        {"environment": Environment(image=IMAGE)},
    ],
    ids=range(11),
)
def test_every_part_counts(change):
    assert scene_digest(Scene(**{**BASE, **change})) != scene_digest(Scene(**BASE))


def test_textures_count_by_their_texels():
    one, same, other = (
        Scene(shapes=[Box(material=Material(diffuse=Texture(image=image / 12)))])
        for image in (IMAGE, IMAGE.copy(), IMAGE[::-1])
    )
    assert scene_digest(one) == scene_digest(same) != scene_digest(other)


@pytest.mark.parametrize("change", [{"name": "other"}, {"cameras": [Camera(fov=20.0)]}])
def test_names_and_cameras_do_not_count(change):
    assert scene_digest(Scene(**{**BASE, **change})) == scene_digest(Scene(**BASE))


def test_whole_numbers_are_numbers():
    assert scene_digest(Scene(shapes=[Cone(height=2)])) == scene_digest(Scene(shapes=[Cone(height=2.0)]))
