"""Compiling in a second process beside this one, and the tree builder as what is compiled so."""

import json
import os
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numba
import pytest
from parts import moved, sphere_mesh

import lumipath
from lumipath.devices.cpu import CpuDevice, renderer_of
from lumipath.lang import beside
from lumipath.lang.beside import compiled_beside
from lumipath.pack.scene import pack_scene
from lumipath.rendering.session import Session
from lumipath.scene import Instance, Scene, Sphere
from lumipath.scenes import builtin

SOURCES = Path(lumipath.__path__[0]).parent

PLACED = [Instance(sphere_mesh(4), transform=moved(3 * k, 0, 0)) for k in range(3)]
SCENES = {
    "triangles": builtin("cornell-box"),
    "quadrics": Scene(shapes=[Sphere()]),
    "instances": Scene(shapes=[sphere_mesh(3), Sphere(transform=moved(0, 3, 0)), *PLACED]),
    "only instances": Scene(shapes=PLACED),
    "many": Scene(shapes=[sphere_mesh(80)]),
}


# ---- the second process ----------------------------------------------------------------------------------------------


@pytest.fixture
def started(monkeypatch):
    """Children that were started; nothing is on disk, and there are two cores."""
    children = []

    def start(work):
        children.append(true_start(work))
        return children[-1]

    true_start = beside._start
    monkeypatch.setattr(beside, "_start", start)
    monkeypatch.setattr(beside, "is_on_disk", lambda work: False)
    monkeypatch.setattr(beside, "usable_cores", lambda: 2)
    return children


def test_the_work_is_done_at_the_end_of_the_block(started, tmp_path):
    with compiled_beside(partial(os.mkdir, tmp_path / "made")):
        pass
    assert (tmp_path / "made").is_dir()
    assert [child.returncode for child in started] == [0]


def test_the_child_sees_the_same_modules_and_none_of_the_folder_that_it_runs_in(started, tmp_path, monkeypatch):
    (tmp_path / "modules").mkdir()
    (tmp_path / "modules" / "only_here.py").write_text("import pathlib\ndef work(to):\n pathlib.Path(to).touch()\n")
    (tmp_path / "pickle.py").write_text("raise SystemExit(7)\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path / "modules"))
    import only_here

    with compiled_beside(partial(only_here.work, str(tmp_path / "made"))):
        pass
    assert [child.returncode for child in started] == [0]
    assert (tmp_path / "made").exists()


def test_a_child_that_fails_says_nothing_and_does_no_harm(started, capfd):
    done = []
    with compiled_beside(partial(os.rmdir, "/there/is/no/such/folder")):
        done.append(True)
    assert done == [True]
    assert started[0].returncode == 1
    assert capfd.readouterr() == ("", "")


def test_a_child_that_never_ends_is_not_waited_for(started, monkeypatch):
    monkeypatch.setattr(beside, "_PATIENCE_SECONDS", 0.1)
    with compiled_beside(partial(time.sleep, 3600)):
        pass
    assert started[0].returncode not in (0, None)


@pytest.mark.parametrize("kind", [KeyboardInterrupt, ValueError])
def test_a_child_ends_with_the_block_that_is_broken_off(started, kind):
    with pytest.raises(kind), compiled_beside(partial(time.sleep, 3600)):
        raise kind
    assert started[0].returncode not in (0, None)


@pytest.mark.parametrize("program", [None, "", "/usr/bin/uwsgi", "/nowhere/python3"])
def test_without_a_python_to_start_this_process_goes_on_alone(started, monkeypatch, program):
    monkeypatch.setattr(sys, "executable", program)
    done = []
    with compiled_beside(partial(time.sleep, 3600)):
        done.append(True)
    assert done == [True]
    assert started == [None]


def test_a_frozen_program_goes_on_alone(started, monkeypatch):
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    with compiled_beside(partial(time.sleep, 3600)):
        pass
    assert started == [None]


@pytest.mark.parametrize(("cores", "threads"), [(1, None), (1, 8), (2, 1)])
def test_one_thread_alone_starts_no_other(started, monkeypatch, cores, threads):
    monkeypatch.setattr(beside, "usable_cores", lambda: cores)
    with compiled_beside(partial(time.sleep, 3600), threads):
        pass
    assert started == []


# ---- the tree builder ------------------------------------------------------------------------------------------------

COLD = """
import json
from lumipath.accel import build_kernels, bvh8
from lumipath.lang import beside, when_compiling
from lumipath.rendering.session import Session
from lumipath.scenes import builtin
beside.usable_cores = lambda: 2
told = []
with when_compiling(lambda: told.append(True)):
    Session(builtin("cornell-box"), device="cpu", width=8, integrator="depth")
builder = [build_kernels.load, build_kernels.measure, build_kernels.build_subtree, bvh8._widen]
print(json.dumps([told, *(sum(function.dispatcher.stats.cache_misses.values()) for function in builder)]))
"""


STAND_INS = """
import json
from functools import partial
from test_compiling_beside import SCENES
from lumipath.accel.bvh4 import MAX_LEAF, gpu_tree
from lumipath.accel.stand_in import LARGE, build_for_cpu, build_for_gpu
from lumipath.accel.two_level import build_trees
from lumipath.devices.cpu import with_cpu_tree
from lumipath.lang.cache import is_on_disk
from lumipath.pack.scene import pack_scene

def on_gpu(packed, wide):
    shapes = packed.geometry
    trees = build_trees(*shapes.bounds(), shapes.instancing, max_leaf=MAX_LEAF, block=1, threads=1)
    gpu_tree(trees, shapes.vertices, shapes.faces, shapes.two_sided, shapes.solid(), wide=wide)

missing = []
# The smallest first: what is loaded for one is there for the next.
for name in sorted(SCENES, key=lambda name: SCENES[name].triangle_count):
    packed = pack_scene(SCENES[name])
    large = len(packed.scene.primitives) > LARGE
    assert large == (name == "many")
    build_for_cpu(large)
    if not is_on_disk(partial(with_cpu_tree, packed, 1)):
        missing.append([name, "cpu"])
    for wide in (False, True):
        build_for_gpu(large, wide)
        # A tree that is a single leaf is rare enough to be compiled when it comes.
        if name != "quadrics" and not is_on_disk(partial(on_gpu, packed, wide)):
            missing.append([name, wide])
print(json.dumps([missing]))
"""


def run(code, folder):
    paths = [str(SOURCES), str(Path(__file__).parent), str(Path(__file__).parents[1] / "physics")]
    variables = os.environ | {"PYTHONPATH": os.pathsep.join(paths), "LUMIPATH_CACHE": str(folder / "cache")}
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, env=variables, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_session_compiles_the_renderer_only_while_a_child_compiles_the_builder(tmp_path):
    assert run(COLD, tmp_path) == [[True], 0, 0, 0, 0]
    assert run(COLD.replace("beside.usable_cores", "beside._start"), tmp_path) == [[], 0, 0, 0, 0]


def test_the_stand_ins_call_all_that_the_builders_call(tmp_path):
    (missing,) = run(STAND_INS, tmp_path)
    assert missing == []


@pytest.mark.parametrize("name", SCENES)
def test_a_draft_has_the_types_of_the_scene(name):
    device, packed = CpuDevice(2), pack_scene(SCENES[name])
    assert numba.typeof(device.draft(packed)) == numba.typeof(device.upload(packed))


def test_rendering_compiles_nothing_that_the_session_has_not_compiled():
    session = Session(builtin("cornell-box"), device="cpu", width=8, spp=1, integrator="depth")
    renderer = renderer_of(session._packed)
    compiled = list(renderer.overloads)
    session.run()
    assert list(renderer.overloads) == compiled
