"""A render that was stopped, killed or shared gives the picture of one that was not."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import lumipath
from lumipath.devices import cpu
from lumipath.errors import CheckpointError, LumipathWarning, UsageError
from lumipath.rendering.checkpoint import Checkpoint
from lumipath.rendering.merging import merge
from lumipath.rendering.session import Session, render
from lumipath.scenes import builtin

SOURCES = str(Path(lumipath.__path__[0]).parent)
RUN = "import sys; from lumipath.cli import main; sys.exit(main())"
SETTINGS = {"device": "cpu", "threads": 2, "width": 41, "height": 37, "max_depth": 5, "rr_depth": None, "spp": 32}


def bits(film):
    return [array.tobytes() for array in film.arrays]


@pytest.fixture(scope="module")
def scene():
    return builtin("cornell-box")


@pytest.fixture(scope="module")
def straight(scene):
    """The session of a render without a stop."""
    session = Session(scene, **SETTINGS)
    session.run()
    return session


def render_in_pieces(scene, path, stops):
    """A session that leaves its loop after so many steps and is resumed until it is done.

    Returns the last session, and how often pixels had different numbers of samples when the loop was left.
    """
    uneven = samples = 0
    while True:
        session = Session(scene, checkpoint=path, resume=True, **SETTINGS)
        assert session.resumed == samples
        for number, _ in enumerate(session, 1):
            if number == stops:
                break
        uneven += len(np.unique(session.film.counts)) > 1
        samples = session.film.samples
        assert bits(Checkpoint.load(path).film) == bits(session.film)
        if samples == SETTINGS["spp"]:
            return session, uneven


@pytest.mark.parametrize("stops", [1, 2, 3, 7])
def test_a_stopped_render_goes_on_to_the_same_bits(scene, straight, tmp_path, eager, stops):
    # Passes may report more often on a slow machine, and be left at their ends only.
    for attempt in range(30):
        session, uneven = render_in_pieces(scene, tmp_path / f"{attempt}.ckpt", stops)
        assert bits(session.film) == bits(straight.film)
        np.testing.assert_array_equal(session.image().pixels, straight.image().pixels)
        if uneven:
            return
    pytest.fail("no pass was left in its middle: the test shows nothing")


def test_ctrl_c_writes_the_checkpoint(scene, straight, tmp_path, eager):
    path = tmp_path / "a.ckpt"
    session = Session(scene, checkpoint=path, **SETTINGS)

    def interrupt(progress):
        if progress.samples > 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        session.run(interrupt)
    assert 4 < Checkpoint.load(path).film.samples < SETTINGS["spp"]
    again = Session(scene, checkpoint=path, resume=True, **SETTINGS)
    again.run()
    assert bits(again.film) == bits(straight.film)


def test_a_checkpoint_in_the_middle_of_a_pass_is_true(scene, straight, tmp_path, eager):
    known = {}
    for stop in (1, 4, 16, 32):
        session = Session(scene, **{**SETTINGS, "spp": stop})
        session.run()
        known[stop] = session.film
    session = Session(scene, **SETTINGS)
    uneven = 0
    for number, _ in enumerate(session):
        session.save_checkpoint(tmp_path / "a.ckpt")
        film = Checkpoint.load(tmp_path / "a.ckpt").film
        levels = np.unique(film.counts)
        uneven += len(levels) > 1
        for count in levels[levels > 0]:
            there = film.counts == count
            np.testing.assert_array_equal(film.total[there], known[int(count)].total[there])
        # Looking at the image ends a pass as well, and changes nothing either.
        if number % 2:
            session.image()
    assert uneven
    assert bits(session.film) == bits(straight.film)


def test_more_samples_may_be_asked_for(scene, straight, tmp_path):
    path = tmp_path / "a.ckpt"
    render(scene, checkpoint=path, **{**SETTINGS, "spp": 12})
    image = render(scene, checkpoint=path, resume=True, **SETTINGS)
    np.testing.assert_array_equal(image.pixels, straight.image().pixels)
    # Fewer than there are: they are all there.
    fewer = render(scene, checkpoint=path, resume=True, **{**SETTINGS, "spp": 3})
    np.testing.assert_array_equal(fewer.pixels, image.pixels)


def test_time_adds_up(scene, tmp_path):
    path = tmp_path / "a.ckpt"
    first = render(scene, checkpoint=path, **{**SETTINGS, "spp": 12})
    second = render(scene, checkpoint=path, resume=True, **SETTINGS)
    assert second.metadata["seconds"] > first.metadata["seconds"] > 0


def test_methods(scene, straight, tmp_path):
    session = Session(scene, **{**SETTINGS, "spp": 8})
    session.run()
    session.save_checkpoint(tmp_path / "a.ckpt")
    other = Session(scene, **SETTINGS)
    other.load_checkpoint(tmp_path / "a.ckpt")
    assert other.resumed == 8
    other.run()
    assert bits(other.film) == bits(straight.film)
    other.restart(1)
    with pytest.raises(CheckpointError, match="seed is 0 there and 1 here"):
        other.load_checkpoint(tmp_path / "a.ckpt")


def test_a_device_that_needs_even_counts_gets_them(scene, straight, tmp_path, eager, monkeypatch):
    session = Session(scene, **SETTINGS)
    for progress in session:
        if progress.samples > 4 and session.film.counts.min() < session.film.counts.max():
            break
    session.save_checkpoint(tmp_path / "a.ckpt")
    assert len(np.unique(session.film.counts)) == 2
    monkeypatch.setattr(cpu.CpuDevice, "even_counts", True)
    other = Session(scene, **SETTINGS)
    other.load_checkpoint(tmp_path / "a.ckpt")
    assert len(np.unique(other.film.counts)) == 1
    other.run()
    np.testing.assert_array_equal(other.film.counts, straight.film.counts)
    np.testing.assert_allclose(other.film.mean(), straight.film.mean(), rtol=1e-6, atol=1e-9)


def test_ranges_of_samples_merge_into_the_whole_picture(scene, straight, tmp_path):
    for name, first, count in (("a", 0, 10), ("b", 10, 22)):
        render(scene, checkpoint=tmp_path / f"{name}.ckpt", **{**SETTINGS, "first_sample": first, "spp": count})
    merged = merge([tmp_path / "a.ckpt", tmp_path / "b.ckpt"])
    np.testing.assert_array_equal(merged.film.counts, straight.film.counts)
    np.testing.assert_allclose(merged.image().pixels, straight.image().pixels, rtol=2e-7, atol=1e-9)


def test_counts_past_two_to_the_24(scene):
    session = Session(scene, **{**SETTINGS, "spp": (1 << 24) + 20})
    session.film.counts[...] = 1 << 24
    session.film.total[...] = 0.25 * (1 << 24)
    session.run()
    assert (session.film.counts == (1 << 24) + 20).all()
    # The 20 samples are in the sums, to the last digit, though each is less than half a unit of the last place.
    apart = Session(scene, **{**SETTINGS, "first_sample": 1 << 24, "spp": 20})
    apart.run()
    added = session.film.total.astype(np.float64) + session.film.lost - 0.25 * (1 << 24)
    np.testing.assert_allclose(added, apart.film.total.astype(np.float64) + apart.film.lost, rtol=1e-5, atol=1e-6)


class TestRefusals:
    def test_a_checkpoint_that_is_there_is_not_lost(self, scene, tmp_path):
        path = tmp_path / "a.ckpt"
        path.write_bytes(b"earlier")
        with pytest.raises(UsageError, match="is there already: resume it, delete it, or name another"):
            Session(scene, checkpoint=path, **SETTINGS)
        assert path.read_bytes() == b"earlier"

    def test_resume_without_a_file(self, scene):
        with pytest.raises(UsageError, match="resume needs a checkpoint"):
            Session(scene, resume=True, **SETTINGS)

    @pytest.mark.parametrize("change", [{"max_depth": 4}, {"seed": 3}, {"first_sample": 8}, {"crop": (0, 0, 8, 8)}])
    def test_another_render(self, scene, straight, tmp_path, change):
        straight.save_checkpoint(tmp_path / "a.ckpt")
        (name,) = change
        with pytest.raises(CheckpointError, match=f"{name} is .* there and .* here"):
            Session(scene, checkpoint=tmp_path / "a.ckpt", resume=True, **{**SETTINGS, **change})

    def test_another_scene(self, straight, tmp_path):
        straight.save_checkpoint(tmp_path / "a.ckpt")
        with pytest.raises(CheckpointError, match="its scene is another one, or was changed"):
            Session(builtin("bench-cornell"), checkpoint=tmp_path / "a.ckpt", resume=True, **SETTINGS)


def test_a_full_disk_does_not_end_the_render(scene, straight, tmp_path, monkeypatch):
    path = tmp_path / "a.ckpt"
    session = Session(scene, checkpoint=path, checkpoint_interval=0.0, **SETTINGS)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.warns(LumipathWarning, match=r"no checkpoint: .*a\.ckpt: cannot be written: No space left"):
        session.run()
    assert bits(session.film) == bits(straight.film)
    assert list(tmp_path.iterdir()) == []


def test_killed_processes_lose_nothing(scene, tmp_path):
    settings = {**SETTINGS, "width": 160, "height": 120, "spp": 480, "checkpoint_interval": 0.0}
    path, counts = tmp_path / "a.ckpt", []
    code = (
        "import sys, lumipath\n"
        f"session = lumipath.Session(lumipath.builtin('cornell-box'), checkpoint={str(path)!r}, resume=True, "
        f"**{settings!r})\n"
        "for number, _ in enumerate(session):\n"
        "    if number == 0:\n"
        "        print('rendering', flush=True)\n"
    )
    for _ in range(4):
        process = subprocess.Popen(
            [sys.executable, "-c", code],
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": SOURCES},
        )
        assert process.stdout.readline() == "rendering\n"
        time.sleep(random.uniform(0.02, 0.1))
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=60)
        counts.append(Checkpoint.load(path).film.samples if path.exists() else 0)
    assert counts == sorted(counts)
    assert counts[0] < settings["spp"], "the first process was done before it was killed"
    image = render(scene, checkpoint=path, resume=True, **settings)
    np.testing.assert_array_equal(image.pixels, render(scene, **settings).pixels)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_the_command_line_stops_in_order_and_goes_on(tmp_path, number, code):
    flags = ["--size", "160x120", "-s", "96", "-r", "5", "--rr-depth", "off", "--device", "cpu", "--threads", "2"]
    kept = ["-o", "a.exr", "--checkpoint", "a.ckpt", "--resume"]
    environment = {**os.environ, "PYTHONPATH": SOURCES}

    def start(*arguments):
        # A shell that starts tests in the background has them ignore Ctrl-C.
        program = f"import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n{RUN}"
        argv = [sys.executable, "-c", program, "render", "cornell-box", *flags, "--progress", "json", *arguments]
        return subprocess.Popen(argv, stderr=subprocess.PIPE, text=True, cwd=tmp_path, env=environment)

    process = start(*kept)
    while '"progress"' not in process.stderr.readline():
        pass
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    assert process.returncode == code, err
    samples = Checkpoint.load(tmp_path / "a.ckpt").film.samples
    assert 0 < samples < 96
    assert lumipath.Image.load(tmp_path / "a.exr").metadata["samples"] == pytest.approx(samples)
    for arguments in (kept, ["-o", "b.exr"]):
        process = start(*arguments)
        _, err = process.communicate(timeout=120)
        assert process.returncode == 0, err
    a, b = (lumipath.Image.load(tmp_path / name) for name in ("a.exr", "b.exr"))
    np.testing.assert_array_equal(a.pixels, b.pixels)
