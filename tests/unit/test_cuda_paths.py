"""The GPU's kernel for layers of light, thread by thread in plain Python, against the CPU's scheduler."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lumipath

pytest.importorskip("numba_cuda", reason="needs the extra 'cuda'")

PROGRAM = """
import json, sys
from types import SimpleNamespace

import numpy as np

from lumipath.accel.bvh4 import MAX_LEAF, gpu_tree
from lumipath.accel.two_level import build_trees
from lumipath.devices.cuda import paths, work
from lumipath.lang import Features, i32, u32
from lumipath.pack.scene import film_layers, pack_scene, pack_view, settings_features
from lumipath.rendering.film import Film
from lumipath.rendering.session import Session
from lumipath.scene import Camera, DirectionalLight, Material, PointLight, Scene, Sphere, Square
from lumipath.settings import RenderSettings

WIDTH, HEIGHT, SAMPLES = 5, 3, 4
mirror = Square(transform=np.diag([9.0, 9, 1, 1]), material=Material(diffuse=0.4, specular=0.5))
lift = np.diag([0.5, 0.5, 0.5, 1.0])
lift[2, 3] = 1.5
lamp = Sphere(transform=lift, material=Material(emission=2, group="lamp", diffuse=0.3))
lying = np.array([(9.0, 0, 0, 0), (0, 0, 1, -1), (0, -9, 0, 0), (0, 0, 0, 1)])
floor = Square(transform=lying, material=Material(diffuse=0.6))
# Behind the camera, one within the other.
suns = [DirectionalLight(colour=0.2, angle=60, group="sun"), DirectionalLight(colour=0.1, angle=90)]
lights = [PointLight(position=(1, 1, 3)), *suns]
scene = Scene(shapes=[mirror, lamp, floor], lights=lights, cameras=[Camera(position=(0, 0, 5))])
aov = ("direct", "light_groups", "variance")
settings = RenderSettings(
    width=WIDTH, height=HEIGHT, spp=SAMPLES, max_depth=3, threads=1, aov=aov, first_sample=3, rr_depth=1
)
session = Session(scene, settings, device="cpu")
session.run()

packed, view = pack_scene(scene), pack_view(scene.camera(), settings)
geometry = packed.geometry
trees = build_trees(*geometry.bounds(), geometry.instancing, max_leaf=MAX_LEAF, block=1)
accel, roots, _ = gpu_tree(trees, geometry.vertices, geometry.faces, geometry.two_sided, geometry.solid(), wide=False)
mask = packed.scene.features.mask | settings_features(settings, scene.camera())
on_gpu = packed.with_tree(accel, roots)._replace(features=Features(mask))

# Two planes of sums, each with half of the samples, as for small pictures.
film = Film(WIDTH, 2 * HEIGHT, layer_names=film_layers(settings, scene))
warps = work.item_count(WIDTH, HEIGHT) // work.WARP
launch = work.Work(np.zeros(work.COUNTERS, np.uint32), u32(warps), u32(SAMPLES // 2), u32(3), u32(3 + SAMPLES))
for thread in range(2 * warps * work.WARP):
    cuda = SimpleNamespace(grid=lambda _: thread, laneid=thread % 32)
    paths.cuda = work.cuda = cuda
    paths.make_paths(64)(on_gpu, view, film.arrays, launch)

both = Film(WIDTH, HEIGHT, layer_names=film.layer_names)
for name in ("total", "lost", "parts", "parts_lost"):
    planes = getattr(film, name)
    getattr(both, name)[...] = planes[:HEIGHT] + planes[HEIGHT:]
both.counts[...] = SAMPLES
made = [{"image": each.mean(), **each.layers()} for each in (session.film, both)]
json.dump([{name: layer.tolist() for name, layer in layers.items()} for layers in made], sys.stdout)
"""


def test_it_gives_what_the_cpu_gives():
    sources = str(Path(lumipath.__path__[0]).parent)
    environment = {**os.environ, "PYTHONPATH": sources, "LUMIPATH_DEBUG_PYTHON": "1"}
    done = subprocess.run([sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    expected, found = json.loads(done.stdout)
    groups = ["light_default", "light_lamp", "light_sun"]
    assert list(found) == ["image", "emission", "direct", "indirect", *groups, "variance"]
    for name, layer in expected.items():
        assert np.any(layer), name
        np.testing.assert_allclose(found[name], layer, rtol=1e-3, atol=1e-5, err_msg=name)
