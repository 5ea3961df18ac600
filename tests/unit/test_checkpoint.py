"""Checkpoint files: what comes back, what is refused, and that a file is whole whatever happens."""

import json
import os
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import attrs
import numpy as np
import pytest

import lumipath
from lumipath.errors import CheckpointError
from lumipath.rendering.checkpoint import Checkpoint, CheckpointFile, Identity, SampleRange, range_of
from lumipath.rendering.film import Film
from lumipath.scene import Box, Camera, Material, Scene
from lumipath.settings import NOT_IN_SAMPLES, RenderSettings

KILLED = Path(__file__).with_name("kill_writers.py")
SOURCES = str(Path(lumipath.__path__[0]).parent)


def film_of(count, width=7, height=5):
    film = Film(width, height)
    random = np.random.default_rng(count)
    film.total[...] = random.random(film.total.shape, np.float32)
    film.lost[...] = 1e-9 * random.random(film.total.shape, np.float32)
    film.counts[...] = count
    film.rejected = 3
    return film


def checkpoint_of(film=None, scene=None, seconds=1.5, **settings):
    film, given = film or film_of(4), RenderSettings(**settings)
    ranges = (range_of(film, given.seed, given.first_sample),)
    return Checkpoint(film, Identity.of(scene or Scene(), given), ranges, seconds, "a scene", "a device")


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


class TestRoundTrip:
    def test_everything_comes_back(self, tmp_path):
        before = checkpoint_of(seed=7, crop=(0, 0, 7, 5), rr_depth=None, camera=None, first_sample=100)
        before.save(tmp_path / "a.ckpt")
        after = Checkpoint.load(tmp_path / "a.ckpt")
        for array, other in zip(before.film.arrays, after.film.arrays, strict=True):
            assert array.dtype == other.dtype
            assert array.tobytes() == other.tobytes()
        assert after.film.rejected == 3
        assert after.identity == before.identity
        assert after.ranges == (SampleRange(7, 100, 104, True),)
        assert (after.seconds, after.scene_name, after.device) == (1.5, "a scene", "a device")

    def test_layers_come_back(self, tmp_path):
        film = Film(7, 5, layer_names=("direct", "light_key"))
        film.parts[...] = np.random.default_rng(1).random(film.parts.shape)
        film.parts_lost[...] = 1e-9
        film.counts[...] = 4
        checkpoint_of(film).save(tmp_path / "a.ckpt")
        after = Checkpoint.load(tmp_path / "a.ckpt")
        assert after.film.layer_names == ("direct", "light_key")
        assert [array.tobytes() for array in after.film.arrays] == [array.tobytes() for array in film.arrays]
        assert after.image().layer_names == ("direct", "light_key")
        np.testing.assert_allclose(after.image()["light_key"], film.parts[..., 3:] / 4, rtol=1e-6)

    def test_it_is_a_plain_archive_of_arrays(self, tmp_path):
        checkpoint_of().save(tmp_path / "a.ckpt")
        with np.load(tmp_path / "a.ckpt", allow_pickle=False) as archive:
            assert set(archive) == {"header", "total", "lost", "counts"}
            assert json.loads(bytes(archive["header"]))["settings"]["max_depth"] == RenderSettings().max_depth

    def test_leaves_only_the_file(self, tmp_path):
        checkpoint_of().save(tmp_path / "a.ckpt")
        checkpoint_of().save(tmp_path / "a.ckpt")
        assert names_in(tmp_path) == ["a.ckpt"]

    def test_its_image(self, tmp_path):
        image = checkpoint_of(seed=9).image()
        np.testing.assert_allclose(image.pixels, film_of(4).total / 4, rtol=1e-6)
        assert (image.metadata["samples"], image.metadata["seed"], image.metadata["seconds"]) == (4, 9, 1.5)

    def test_uneven_counts_are_no_whole_range(self):
        film = film_of(4)
        film.counts[2, 3] = 2
        assert range_of(film, 0, 10) == SampleRange(0, 10, 14, False)


class TestIdentity:
    def test_equal_renders_are_equal(self):
        assert Identity.of(Scene(), RenderSettings()) == Identity.of(Scene(), RenderSettings())

    def test_what_the_camera_decides_may_be_given_or_not(self):
        camera = Camera(aperture=0.5, focus=3, aspect=2.0)
        given = RenderSettings(width=512, height=256, aperture=0.5, focus=3.0, camera=0, crop=(0, 0, 512, 256))
        scene = Scene(cameras=[camera])
        assert Identity.of(scene, given) == Identity.of(scene, RenderSettings())

    @pytest.mark.parametrize("name", ["spp", "exposure", "tonemap", "threads", "kernel", "checkpoint_interval"])
    def test_settings_that_no_sample_depends_on_do_not_count(self, name):
        other = {"exposure": 1.0, "tonemap": "agx", "kernel": "wavefront"}.get(name, 3)
        assert name in NOT_IN_SAMPLES
        assert Identity.of(Scene(), RenderSettings(**{name: other})) == Identity.of(Scene(), RenderSettings())

    @pytest.mark.parametrize(
        ("settings", "difference"),
        [
            ({"max_depth": 3}, "max_depth is 3 there and 12 here"),
            ({"width": 64, "height": 512}, "width is 64 there and 512 here"),
            ({"sampler": "independent"}, "sampler is independent there and sobol here"),
            ({"rr_depth": None}, "rr_depth is None there and 4 here"),
            ({"aperture": 0.5}, "aperture is 0.5 there and 0.0 here"),
        ],
    )
    def test_other_settings_are_named(self, settings, difference):
        here, there = (Identity.of(Scene(), RenderSettings(**given)) for given in ({}, settings))
        assert difference in here.differences(there)

    def test_every_other_setting_counts(self):
        names = {field.name for field in attrs.fields(RenderSettings)} - {*NOT_IN_SAMPLES, "seed", "first_sample"}
        assert set(Identity.of(Scene(), RenderSettings()).settings) == names

    def test_another_camera_is_named(self):
        scene = Scene(cameras=[Camera(), Camera(fov=20.0)])
        here, there = (Identity.of(scene, RenderSettings(camera=which)) for which in (0, 1))
        (difference,) = here.differences(there)
        assert difference.startswith("camera is (position 0 0 0, direction 0 0 -1, up 0 1 0, fov 20.0) there and (")

    def test_another_scene_is_told(self):
        here, there = (
            Identity.of(Scene(shapes=[Box(material=Material(diffuse=grey))]), RenderSettings()) for grey in (0.5, 0.6)
        )
        assert here.differences(there) == ["its scene is another one, or was changed"]


class TestRefusals:
    def test_the_differences_are_named(self):
        there = checkpoint_of(max_depth=3, sampler="independent")
        with pytest.raises(CheckpointError) as caught:
            there.require_same(Identity.of(Scene(), RenderSettings()), "a.ckpt", "this render")
        assert str(caught.value) == (
            "a.ckpt is of another picture than this render: max_depth is 3 there and 12 here; "
            "sampler is independent there and sobol here"
        )

    def test_another_version(self):
        there = attrs.evolve(checkpoint_of().identity, version="0.0.1")
        assert checkpoint_of().identity.differences(there) == [
            f"version is 0.0.1 there and {lumipath.__version__} here"
        ]

    @pytest.mark.parametrize(
        ("seed", "first", "message"),
        [(1, 0, "seed is 0 there and 1 here"), (0, 5, "first_sample is 0 there and 5 here")],
    )
    def test_other_samples(self, seed, first, message):
        with pytest.raises(CheckpointError, match=message):
            checkpoint_of().require_start(seed, first, "a.ckpt")
        checkpoint_of().require_start(0, 0, "a.ckpt")

    def test_sums_of_several_renders(self):
        two = attrs.evolve(checkpoint_of(), ranges=(SampleRange(0, 0, 2, True), SampleRange(1, 0, 2, True)))
        with pytest.raises(CheckpointError, match="not resumed"):
            two.require_start(0, 0, "a.ckpt")


class TestDamage:
    @pytest.fixture
    def path(self, tmp_path):
        checkpoint_of().save(tmp_path / "a.ckpt")
        return tmp_path / "a.ckpt"

    def test_missing(self, tmp_path):
        with pytest.raises(CheckpointError, match=r"cannot read .*No such file"):
            Checkpoint.load(tmp_path / "a.ckpt")

    @pytest.mark.parametrize("content", [b"", b"no checkpoint", b"PK\x05\x06" + bytes(18), b"\x89PNG\r\n\x1a\n"])
    def test_foreign(self, tmp_path, content):
        (tmp_path / "a.ckpt").write_bytes(content)
        with pytest.raises(CheckpointError, match=r"a\.ckpt is no checkpoint, or a damaged one") as caught:
            Checkpoint.load(tmp_path / "a.ckpt")
        assert "\n" not in str(caught.value)

    def test_truncated_anywhere(self, path):
        whole = path.read_bytes()
        for length in range(0, len(whole), 37):
            path.write_bytes(whole[:length])
            with pytest.raises(CheckpointError, match="no checkpoint, or a damaged one") as caught:
                Checkpoint.load(path)
            assert "\n" not in str(caught.value)

    def test_no_flipped_byte_changes_what_is_read(self, path):
        whole, right = path.read_bytes(), Checkpoint.load(path)
        for place in np.random.default_rng(3).integers(0, len(whole), 400):
            flipped = bytearray(whole)
            flipped[place] ^= 0x55
            path.write_bytes(flipped)
            try:
                read = Checkpoint.load(path)
            except CheckpointError:
                continue
            # Dates and the like, which nobody reads.
            assert read.identity == right.identity
            for array, other in zip(read.film.arrays, right.film.arrays, strict=True):
                assert array.tobytes() == other.tobytes()

    def test_other_archives(self, path):
        np.savez(path.open("wb"), total=np.zeros(3))
        with pytest.raises(CheckpointError, match="no checkpoint"):
            Checkpoint.load(path)

    def rewrite(self, path, change=lambda header: header, **arrays):
        with np.load(path) as archive:
            content = {**archive, **arrays}
        header = change(json.loads(bytes(content["header"])))
        content["header"] = np.frombuffer(json.dumps(header).encode(), np.uint8)
        with path.open("wb") as file:
            np.savez(file, **content)

    def test_arrays_of_another_shape(self, path):
        self.rewrite(path, total=np.zeros((5, 7), np.float32))
        with pytest.raises(CheckpointError, match="total has the shape"):
            Checkpoint.load(path)

    def test_objects(self, path):
        self.rewrite(path, total=np.array([{}], dtype=object))
        with pytest.raises(CheckpointError, match="no checkpoint, or a damaged one"):
            Checkpoint.load(path)

    @pytest.mark.parametrize("size", [[1 << 30, 1 << 30], [-1, 5], ["a", 5], [5]])
    def test_absurd_sizes(self, path, size):
        self.rewrite(path, lambda header: {**header, "size": size})
        with pytest.raises(CheckpointError, match="no checkpoint, or a damaged one"):
            Checkpoint.load(path)

    def test_a_newer_format(self, path):
        self.rewrite(path, lambda header: {**header, "format": 99, "version": "7.0"})
        with pytest.raises(CheckpointError, match=r"written by lumipath 7\.0, which is newer"):
            Checkpoint.load(path)

    def test_a_bomb_is_not_unpacked(self, path):
        with zipfile.ZipFile(path) as archive:
            header = archive.read("header.npy")
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("header.npy", header)
            archive.writestr("counts.npy", bytes(1 << 26))
        with pytest.raises(CheckpointError, match="no checkpoint, or a damaged one"):
            Checkpoint.load(path)


class TestWriting:
    def test_a_full_disk_keeps_the_earlier_file(self, tmp_path):
        # A limit on the size of files stands for the full disk; it needs a process of its own.
        code = (
            "import resource, signal, sys\n"
            f"sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
            "from test_checkpoint import checkpoint_of, film_of\n"
            "from lumipath.errors import CheckpointError\n"
            "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
            "resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))\n"
            "try:\n"
            "    checkpoint_of(film_of(8, 100, 100)).save(sys.argv[1])\n"
            "except CheckpointError as error:\n"
            "    print(error)\n"
        )
        target = tmp_path / "a.ckpt"
        checkpoint_of().save(target)
        before = target.read_bytes()
        environment = {**os.environ, "PYTHONPATH": SOURCES}
        command = [sys.executable, "-c", code, target]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, env=environment)
        assert done.stdout.startswith(f"{target}: cannot be written: "), done.stderr
        assert done.stdout.count("\n") == 1
        assert target.read_bytes() == before
        assert names_in(tmp_path) == ["a.ckpt"]

    @pytest.mark.parametrize("step", ["fsync", "replace"])
    def test_a_failure_at_any_step_keeps_the_earlier_file(self, tmp_path, monkeypatch, step):
        checkpoint_of().save(tmp_path / "a.ckpt")

        def fail(*_):
            raise OSError(5, "Input/output error")

        monkeypatch.setattr(*{"fsync": (os, "fsync"), "replace": (Path, "replace")}[step], fail)
        with pytest.raises(CheckpointError, match=r"a\.ckpt: cannot be written: Input/output error"):
            checkpoint_of(film_of(9)).save(tmp_path / "a.ckpt")
        assert int(Checkpoint.load(tmp_path / "a.ckpt").film.counts[0, 0]) == 4
        assert names_in(tmp_path) == ["a.ckpt"]

    def test_it_is_on_the_disk_before_it_takes_the_name(self, tmp_path, monkeypatch):
        steps = []
        sync, replace = os.fsync, Path.replace
        monkeypatch.setattr(os, "fsync", lambda handle: (steps.append("fsync"), sync(handle)))
        monkeypatch.setattr(Path, "replace", lambda *names: (steps.append("replace"), replace(*names)))
        checkpoint_of().save(tmp_path / "a.ckpt")
        assert steps == ["fsync", "replace", "fsync"]

    def test_full_device(self):
        with pytest.raises(CheckpointError, match="not a regular file"):
            checkpoint_of().save("/dev/full")

    @pytest.mark.parametrize("name", ["a.png", "a.EXR"])
    def test_names_of_images_are_refused(self, tmp_path, name):
        with pytest.raises(CheckpointError, match=r"call the checkpoint .*a\.ckpt"):
            checkpoint_of().save(tmp_path / name)

    def test_missing_folder(self, tmp_path):
        with pytest.raises(CheckpointError, match=r"there is no folder .*mkdir -p"):
            CheckpointFile(tmp_path / "no" / "a.ckpt", 60)

    @pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
    def test_read_only_folder(self, tmp_path):
        (tmp_path / "locked").mkdir(mode=0o500)
        with pytest.raises(CheckpointError, match="no permission to write"):
            CheckpointFile(tmp_path / "locked" / "a.ckpt", 60)

    def test_what_killed_writers_left_is_removed_when_it_is_old(self, tmp_path):
        for name, age in (("old", 3600), ("new", 1)):
            path = tmp_path / f".lumipath-{name}.ckpt"
            path.touch()
            os.utime(path, (time.time() - age, time.time() - age))
        checkpoint_of().save(tmp_path / "a.ckpt")
        assert names_in(tmp_path) == [".lumipath-new.ckpt", "a.ckpt"]


class TestCheckpointFile:
    def test_is_due_after_its_interval(self, tmp_path):
        assert not CheckpointFile(tmp_path / "a.ckpt", 1e6).is_due
        assert CheckpointFile(tmp_path / "a.ckpt", 0.0).is_due

    def test_writes_nothing_without_samples_or_twice(self, tmp_path):
        file = CheckpointFile(tmp_path / "a.ckpt", 0.0)
        file.write(checkpoint_of(film_of(0)))
        assert names_in(tmp_path) == []
        file.write(checkpoint_of())
        written = (tmp_path / "a.ckpt").stat().st_mtime_ns
        file.write(checkpoint_of())
        assert (tmp_path / "a.ckpt").stat().st_mtime_ns == written
        file.write(checkpoint_of(film_of(5)))
        assert Checkpoint.load(tmp_path / "a.ckpt").ranges[0].stop == 5


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_hundred_killed_writers_leave_a_whole_file(tmp_path):
    done = subprocess.run(
        [sys.executable, str(KILLED), str(tmp_path / "a.ckpt"), "100"],
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, "PYTHONPATH": SOURCES},
    )
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    assert facts["kills"] == 100
    assert facts["written"] > 50
    assert facts["cut_short"] > 5, "no process was killed while it wrote: the test shows nothing"
