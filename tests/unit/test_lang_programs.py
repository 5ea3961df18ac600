"""Whole programs of the kernel language: features, plain Python, what the compiler makes, the disk cache."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from kernel_calls import looped

import lumipath
from lumipath.accel import packets, trace8
from lumipath.devices import cpu_batch
from lumipath.lang import Features, f32, features_of, kernel
from lumipath.lang.cache import _CacheFile, source_hash
from lumipath.lang.kernel import _FASTMATH, _KERNEL_OPTIONS, _OUTER
from lumipath.lang.whole import whole_type
from lumipath.pack.scene import pack_scene
from lumipath.rendering.session import Session
from lumipath.scene import Scene, Sphere
from lumipath.scenes import builtin

SOURCES = Path(lumipath.__path__[0]).parent

# ---- features -------------------------------------------------------------------------------------------------------


@kernel
def neither(scene, x):
    return x


@kernel(needs=2, otherwise=neither)
def second(scene, x):
    return x + 20.0


@kernel(needs=1, otherwise=second)
def first(scene, x):
    return x + 10.0


@kernel(needs=4, otherwise=neither)
def impossible(scene, x):
    return x.there_is_no_such_field


def scene_with(mask):
    return pack_scene(Scene(shapes=[Sphere()])).scene._replace(features=Features(mask))


def test_features_choose_the_first_kernel_that_fits_and_the_rest_is_not_compiled():
    # A kernel that does not even compile is left out with what it needs.
    chosen = looped(lambda scene, x: impossible(scene, first(scene, x)), scene=True)
    for mask, expected in ((0, 1), (1, 11), (2, 21), (3, 11), (1 << 16, 1)):
        assert chosen(scene_with(mask), np.float32([1]))[0] == expected
        assert first(scene_with(mask), f32(1)) == expected


def test_features_are_values_that_hash_compare_and_pickle():
    assert Features(5) == Features(5) != Features(6)
    assert hash(Features(5)) == hash(Features(5))
    assert features_of(scene_with(12)) == 12
    assert features_of(numba.typeof(scene_with(12))) == 12
    assert numba.typeof(scene_with(1)) != numba.typeof(scene_with(2))


def test_an_alternative_of_other_parameters_is_refused():
    with pytest.raises(TypeError, match="parameters"):

        @kernel(needs=1, otherwise=neither)
        def wrong(scene, x, y):
            return x


# ---- plain Python ---------------------------------------------------------------------------------------------------

TINY = """
import numpy
from lumipath.rendering.session import render
from lumipath.scenes import builtin
options = dict(width=4, height=4, spp=2, max_depth=3, threads=1, rr_depth=None, device="cpu")
numpy.save("image.npy", numpy.asarray(render(builtin("cornell-box"), **options)))
"""


def python(code, folder, **environment):
    variables = os.environ | {"PYTHONPATH": str(SOURCES), "LUMIPATH_CACHE": str(folder / "cache")} | environment
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, env=variables, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_plain_python_renders_what_compiled_code_renders(tmp_path):
    python(TINY, tmp_path, LUMIPATH_DEBUG_PYTHON="1")
    plain = np.load(tmp_path / "image.npy")
    options = {"width": 4, "height": 4, "spp": 2, "max_depth": 3, "threads": 1, "rr_depth": None, "device": "cpu"}
    compiled = np.asarray(Session(builtin("cornell-box"), **options).run())
    assert compiled.max() > 0.1
    np.testing.assert_allclose(plain, compiled, rtol=1e-4, atol=1e-4)
    # Nothing was compiled.
    assert not list(tmp_path.rglob("*.nbc"))


# ---- what the compiler makes ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def renderer():
    """The renderer for the diffuse benchmark, freshly compiled, and the type of its scene."""
    session = Session(builtin("bench-cornell"), device="cpu", width=16, rr_depth=None)
    dispatcher = numba.njit(**_KERNEL_OPTIONS, **_OUTER, fastmath=set(_FASTMATH))(cpu_batch.render_tiles.py_func)
    device = session.device
    arguments = session._packed, session._view, session.film.arrays, device._batches[0], np.zeros(4, np.int64), 0
    dispatcher.compile(tuple(numba.typeof(argument) for argument in arguments))
    return dispatcher, whole_type(numba.typeof(session._packed))


@pytest.fixture(scope="module")
def program(renderer):
    """LLVM code of the renderer."""
    (code,) = renderer[0].inspect_llvm().values()
    # Everything is inlined into one function; the others unpack arguments for Python.
    return max(re.findall(r"^define .*?^}", code, re.M | re.S), key=len)


@pytest.mark.parametrize(
    "function",
    [
        cpu_batch.render_tile,
        cpu_batch.generate,
        cpu_batch.shade_batch,
        packets.trace_packet,
        trace8.walk8,
    ],
    ids=lambda function: function.py_func.__name__,
)
def test_no_large_kernel_is_compiled_for_types_that_it_is_not_called_with_in_the_end(renderer, function):
    # Where a caller's variable begins as int32, say, and becomes int64 in a loop, both are compiled.
    kinds = [signature for signature in function.overloads if signature[0] == renderer[1]]
    assert len(kinds) == 1


def test_the_renderer_computes_nothing_in_double_precision(program):
    arithmetic = re.findall(
        r"^.*\b(?:f(?:add|sub|mul|div|rem|neg)|fcmp|fptrunc|fpext|sitofp|fptosi)\b.*\bdouble\b.*$", program, re.M
    )
    assert arithmetic == []
    assert re.search(r"\bfmul\b.*\bfloat\b", program)


def test_the_renderer_counts_no_references_and_allocates_nothing(program):
    assert not re.search(r"NRT_|incref|decref|malloc|PyGILState", program)


def test_the_renderer_calls_nothing_but_instructions(program):
    called = set(re.findall(r"\bcall\b[^\n]*?@\"?([\w.$]+)", program))
    others = {name for name in called if not name.startswith("llvm.")}
    assert others <= {"memset", "memcpy", "memset_pattern16"}, others
    transcendental = {
        name for name in called if re.match(r"llvm\.(sin|cos|tan|exp2?|log2?|log10|powi?|atan2?)\.", name)
    }
    assert transcendental == set()


def test_the_renderer_has_vectors_of_eight_floats_at_least(program):
    assert re.search(r"<(8|16) x float>", program)


def test_shading_is_compiled_for_many_paths_at_once(renderer):
    (code,) = renderer[0].inspect_llvm().values()
    # What `store_result` stores is in a scope of that name.
    scope = re.search(r'^(!\d+) = !{!"results", !\d+}$', code, re.M)[1]
    scopes = {name for name, members in re.findall(r"^(!\d+) = !{([^}]*)}$", code, re.M) if members == scope}
    stores = re.findall(r"\bstore (<\d+ x float>|float) [^\n]*!alias\.scope (!\d+)", code)
    kinds = {kind for kind, name in stores if name in scopes}
    # Beside it there is a loop of single paths, for what is left over: nothing, as `cpu_shading` knows.
    assert kinds & {"<8 x float>", "<16 x float>"}


# ---- the disk cache -------------------------------------------------------------------------------------------------

SMALL = """
import json
from typing import NamedTuple
import numpy as np
from lumipath.lang import entry, load, store
from lumipath.lang.cache import cache_folder, when_compiling
from lumipath.pack.alias import alias_table, _fill

class Numbers(NamedTuple):
    values: np.ndarray
    factor: np.float32

@entry
def scale(numbers, out):
    store(out, 0, load(numbers.values, 0) * numbers.factor)

told, out = [], np.zeros(1, np.float32)
with when_compiling(lambda: told.append("compiling")):
    alias_table(np.ones(4))
    scale(Numbers(np.full(1, 3, np.int32), np.float32(1.5)), out)
stats = _fill.dispatcher.stats, scale.stats
print(json.dumps({"folder": str(cache_folder()), "told": told, "scaled": float(out[0]),
                  "hits": [sum(one.cache_hits.values()) for one in stats],
                  "misses": [sum(one.cache_misses.values()) for one in stats]}))
"""


def test_a_second_process_loads_what_the_first_compiled(tmp_path):
    first = json.loads(python(SMALL, tmp_path))
    files = {path: path.stat().st_mtime_ns for path in Path(first["folder"]).iterdir()}
    assert first["scaled"] == 4.5
    assert first["misses"] == [1, 1]
    assert first["told"] == ["compiling"]
    assert any(path.suffix == ".nbc" for path in files)
    again = json.loads(python(SMALL, tmp_path))
    assert again == first | {"hits": [1, 1], "misses": [0, 0], "told": []}
    assert {path: path.stat().st_mtime_ns for path in Path(first["folder"]).iterdir()} == files


def test_what_another_process_keeps_meanwhile_is_not_lost(tmp_path, monkeypatch):
    mine, theirs = (_CacheFile(str(tmp_path), "function", "stamp") for _ in range(2))
    assert mine.load("a") is None
    save_data = mine._save_data

    def save_while_the_other_does(name, data):
        theirs.save("b", "of b")
        save_data(name, data)

    monkeypatch.setattr(mine, "_save_data", save_while_the_other_does)
    mine.save("a", "of a")
    assert [mine.load(key) for key in ("a", "b", "c")] == ["of a", "of b", None]


def test_editing_a_source_changes_the_hash_and_so_the_folder(tmp_path):
    shutil.copytree(SOURCES / "lumipath", tmp_path / "src" / "lumipath", ignore=shutil.ignore_patterns("__pycache__"))
    code = "from lumipath.lang.cache import source_hash; print(source_hash())"
    environment = {"PYTHONPATH": str(tmp_path / "src")}
    hashes = [python(code, tmp_path, **environment)]
    assert hashes[0].strip() == source_hash()
    for name in (
        "kernels/path.py",
        "lang/vector.py",
        "accel/build_kernels.py",
        "pack/layout.py",
        "devices/cpu_batch.py",
    ):
        with (tmp_path / "src" / "lumipath" / name).open("a") as file:
            file.write("# edited\n")
        hashes.append(python(code, tmp_path, **environment))
    (tmp_path / "src/lumipath/kernels/more.py").write_text("")
    hashes.append(python(code, tmp_path, **environment))
    assert len(set(hashes)) == len(hashes)


def test_a_cache_that_cannot_be_written_is_replaced_by_a_temporary_one(tmp_path):
    (tmp_path / "file").write_text("")
    code = "from lumipath.lang.cache import cache_folder; print(cache_folder())"
    folder = python(code, tmp_path, LUMIPATH_CACHE=str(tmp_path / "file"), TMPDIR=str(tmp_path)).strip()
    assert Path(folder).is_dir()
    assert Path(folder).is_relative_to(tmp_path)
