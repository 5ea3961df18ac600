"""Many renders in one process, and the tools that watch a GPU's memory."""

import gc
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lumipath import builtin, render

RENDERS = 200
SCENES = ["bench-cornell", "primitives", "bench-blob100k"]
SANITIZER = shutil.which("compute-sanitizer") or shutil.which("compute-sanitizer", path="/usr/local/cuda/bin")


def free_memory():
    from cuda.bindings import driver

    error, free, _ = driver.cuMemGetInfo()
    assert error == driver.CUresult.CUDA_SUCCESS
    return free


def test_two_hundred_renders_leave_no_memory_behind(gpu):
    scenes = [builtin(name) for name in SCENES]
    kernels = ("megakernel", "wavefront")

    def renders(count):
        for number in range(count):
            render(scenes[number % 3], device=gpu, kernel=kernels[number % 2], width=64, spp=2, seed=number)
        gc.collect()

    # What stays once: the context, and the driver's own pools.
    renders(12)
    left_behind = []
    # Other processes use the GPU as well, those of other tests for instance: what this one leaves, it leaves each time.
    for _ in range(3):
        before = free_memory()
        renders(RENDERS)
        left_behind.append(before - free_memory())
        if left_behind[-1] <= 16 << 20:
            break
    assert min(left_behind) <= 16 << 20


def test_a_script_that_ends_with_a_session_at_hand_says_nothing(gpu):
    script = (
        "from lumipath import Session, builtin\n"
        "session = Session(builtin('bench-cornell'), width=32, spp=2, device='cuda:0')\n"
        "image = session.run()\n"
    )
    ended = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        check=False,
    )
    assert (ended.returncode, ended.stderr) == (0, "")


@pytest.mark.skipif(not SANITIZER, reason="compute-sanitizer is not installed")
@pytest.mark.parametrize("tool", ["memcheck", "racecheck"])
@pytest.mark.parametrize("kernel", ["megakernel", "wavefront"])
def test_the_sanitizer_finds_nothing(gpu, tool, kernel):
    script = (
        "from lumipath import builtin, render\n"
        "for name in ('bench-cornell', 'primitives', 'materials', 'knot40k'):\n"
        f"    render(builtin(name), device='cuda:0', kernel='{kernel}', width=24, spp=2, max_depth=4)\n"
    )
    found = subprocess.run(
        [str(SANITIZER), "--tool", tool, "--error-exitcode", "9", sys.executable, "-c", script],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        cwd=Path(__file__).parent,
        check=False,
    )
    assert found.returncode == 0, found.stdout[-2000:] + found.stderr[-2000:]
