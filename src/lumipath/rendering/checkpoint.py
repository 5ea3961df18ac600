"""Checkpoints: a film, and all that says which picture it belongs to, in one file that is always whole.

The file is a NumPy archive (.npz) without pickled objects: `header`, JSON as bytes, and the arrays of the film.
"""

from __future__ import annotations

import json
import time
import zipfile
from pathlib import Path
from typing import Any

import attrs
import numpy as np
from attrs import frozen

from .. import __version__
from ..errors import CheckpointError, LumipathError
from ..formats.files import require_file
from ..pack.camera import camera_of
from ..scene import Camera, Scene, scene_digest
from ..settings import FILTER_RADII, NOT_IN_SAMPLES, RenderSettings
from .files import claim_space, replacing, target_of, temporary_for, try_to_write
from .film import Film
from .image import SUFFIXES, Image
from .noise import worst_error

_FORMAT = 1
# More than the header of an array, less than anything that would hurt.
_SLACK = 1 << 16
# What a killed process leaves behind is taken away once nobody can be writing it any more.
_STALE_SECONDS = 600.0


@frozen
class SampleRange:
    """Samples of one seed that a film holds: `first` up to and without `stop`.

    `whole` says that every pixel has all of them; else some have only the first ones.
    """

    seed: int
    first: int
    stop: int
    whole: bool

    def __str__(self) -> str:
        return f"samples {self.first} to {self.stop - 1} of seed {self.seed}"


@frozen
class Identity:
    """What films must have in common, so that one goes on from the other or they add up."""

    version: str
    scene: str
    """Digest of the scene."""
    settings: dict[str, Any]
    """Every setting that a sample depends on, but for seed and first sample."""

    @classmethod
    def of(cls, scene: Scene, settings: RenderSettings) -> Identity:
        """The identity of a render; what the camera decides is put in."""
        camera = camera_of(scene, settings)
        width, height = settings.size(camera.image_aspect)
        left_out = (*NOT_IN_SAMPLES, "seed", "first_sample")
        values = {name: value for name, value in attrs.asdict(settings).items() if name not in left_out}
        values["width"], values["height"] = width, height
        values["crop"] = settings.crop_of(width, height)
        values["camera"], values["projection"] = _camera_values(camera), camera.projection
        for name in ("aperture", "focus", "blades", "blade_rotation"):
            values[name] = float(getattr(camera, name))
        values["filter_radius"] = float(settings.filter_radius or FILTER_RADII[settings.filter])
        # As it comes back from a file.
        return cls(__version__, scene_digest(scene), json.loads(json.dumps(values)))

    def differences(self, other: Identity) -> list[str]:
        """What differs, in words: of `other` and of this one."""
        found = []
        if self.version != other.version:
            found.append(f"version is {other.version} there and {self.version} here")
        if self.scene != other.scene:
            found.append("its scene is another one, or was changed")
        for name in sorted(self.settings.keys() | other.settings.keys()):
            here, there = self.settings.get(name), other.settings.get(name)
            if here != there:
                found.append(f"{name} is {_shown(there)} there and {_shown(here)} here")
        return found


# Fields of a camera that say which direction a pixel shows, by its projection; the first one is always named.
_PROJECTED = {
    "perspective": ("fov", "shift"),
    "orthographic": ("height", "shift"),
    "panorama": ("longitude", "latitude"),
    "fisheye": ("fisheye_fov", "shift"),
    "fisheye-equisolid": ("fisheye_fov", "shift"),
}


def _camera_values(camera: Camera) -> dict[str, Any]:
    """What a camera shows, as `Camera` takes it beside the projection; numbers are float, so that equals look alike."""
    # Where an orthographic camera has no height, it depends on what is not kept here.
    camera, plain = attrs.evolve(camera, height=camera.extent), Camera()
    first, *others = _PROJECTED[camera.projection]
    named = [name for name in others if getattr(camera, name) != getattr(plain, name)]
    values = {name: getattr(camera, name) for name in ("position", "direction", "up", first, *named)}
    return {name: float(value) if isinstance(value, int) else value for name, value in values.items()}


def _camera_matrices(settings: dict[str, Any]) -> dict[str, tuple[float, ...]]:
    """The matrices of the camera as the attributes of OpenEXR have them: for points as rows, so transposed."""
    camera = Camera(projection=settings.get("projection", "perspective"), **settings["camera"])
    to_camera = camera.world_to_camera()
    matrices = {"worldToCamera": to_camera}
    to_ndc = camera.camera_to_ndc(settings["width"], settings["height"], settings["crop"])
    if to_ndc is not None:
        matrices["worldToNDC"] = to_ndc @ to_camera
    return {name: tuple(matrix.T.ravel().tolist()) for name, matrix in matrices.items()}


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        return "(" + ", ".join(f"{name} {_shown(part)}" for name, part in value.items()) + ")"
    if isinstance(value, list):
        return " ".join(f"{part:g}" for part in value)
    return str(value)


@frozen(eq=False)
class Checkpoint:
    """A film that can be kept in a file, gone on from, and added to others.

    Attributes:
        film: sums and counts.
        identity: what must be equal to go on or to add.
        ranges: which samples the film holds.
        seconds: of rendering.
        scene_name: for people.
        device: what rendered, for people.
    """

    film: Film
    identity: Identity
    ranges: tuple[SampleRange, ...]
    seconds: float
    scene_name: str
    device: str

    @classmethod
    def load(cls, path: str | Path) -> Checkpoint:
        """Read a checkpoint file.

        Raises:
            CheckpointError: it is missing, no checkpoint, damaged, or of a newer lumipath.
        """
        path = Path(path)
        require_file(path, CheckpointError)
        try:
            with zipfile.ZipFile(path) as archive:
                return _unpacked(archive, path)
        except LumipathError:
            raise
        except MemoryError:
            raise CheckpointError(f"{path}: there is not enough memory for its film") from None
        # Whatever the bytes of a foreign or damaged file make the readers of zip, NumPy and JSON say.
        except Exception as error:
            reason = " ".join(str(error).split()) or type(error).__name__
            raise CheckpointError(f"{path} is no checkpoint, or a damaged one: {reason}") from None

    def save(self, path: str | Path) -> None:
        """Write the file: whole or not at all. An existing one is replaced once the new one is on the disk.

        Raises:
            CheckpointError: it cannot be written; an earlier file of this name is still there.
        """
        target = check_target(path)
        _remove_stale(target)
        temporary = temporary_for(target)
        arrays = _kept_arrays(self.film)
        with replacing(target, temporary, CheckpointError):
            # Else an archive that meets a full disk in its middle says something else first.
            claim_space(temporary, sum(array.nbytes for array in arrays.values()))
            with temporary.open("rb+") as file:
                np.savez(file, header=np.frombuffer(self._header().encode(), np.uint8), **arrays)

    def _header(self) -> str:
        height, width = self.film.counts.shape
        return json.dumps(
            {
                "format": _FORMAT,
                **attrs.asdict(self.identity),
                "ranges": [attrs.asdict(part) for part in self.ranges],
                "size": [width, height],
                "layers": list(self.film.layer_names),
                "rejected": self.film.rejected,
                "seconds": self.seconds,
                "scene_name": self.scene_name,
                "device": self.device,
            }
        )

    def image(self) -> Image:
        """The image of its samples, with the layers that they add to."""
        metadata: dict[str, Any] = {"samples": self.film.samples}
        if len({part.seed for part in self.ranges}) == 1:
            metadata["seed"] = self.ranges[0].seed
        fewest, most = int(self.film.counts.min()), int(self.film.counts.max())
        if fewest < most:
            metadata |= {"fewest_samples": fewest, "most_samples": most}
        noise = worst_error(self.film)
        if noise is not None:
            metadata["noise"] = noise
        metadata |= {
            "integrator": self.identity.settings["integrator"],
            "seconds": self.seconds,
            "scene": self.scene_name,
        }
        metadata |= {"version": self.identity.version, "device": self.device, "scene_hash": self.identity.scene}
        return Image(self.film.mean(), metadata | _camera_matrices(self.identity.settings), self.film.layers())

    def require_same(self, identity: Identity, path: str | Path, what: str) -> None:
        """Make sure that this checkpoint, from the file `path`, is of the same picture as `what`.

        Raises:
            CheckpointError: it is not; the message names the differences.
        """
        differences = identity.differences(self.identity)
        if differences:
            more = f" and {len(differences) - 3} more" if len(differences) > 3 else ""
            raise CheckpointError(f"{path} is of another picture than {what}: {'; '.join(differences[:3])}{more}")

    def require_start(self, seed: int, first_sample: int, path: str | Path) -> None:
        """Make sure that a render with this seed and first sample may go on from here.

        Raises:
            CheckpointError: the film holds other samples.
        """
        if len(self.ranges) != 1 or self.ranges[0].stop - self.ranges[0].first != int(self.film.counts.max()):
            raise CheckpointError(f"{path} is a sum of several renders: it can be merged further, but not resumed")
        (held,) = self.ranges
        for name, here, there in (("seed", seed, held.seed), ("first_sample", first_sample, held.first)):
            if here != there:
                raise CheckpointError(f"{path} is of another render: {name} is {there} there and {here} here")


def range_of(film: Film, seed: int, first_sample: int) -> SampleRange:
    """The samples on the film of a render."""
    most = int(film.counts.max())
    return SampleRange(seed, first_sample, first_sample + most, bool((film.counts == most).all()))


def check_target(path: str | Path) -> Path:
    """The file that a checkpoint of this name would be written to.

    Raises:
        CheckpointError: a file cannot be written there, or has the name of an image.
    """
    path = Path(path)
    if path.suffix.lower() in SUFFIXES:
        raise CheckpointError(f"{path}: the name is that of an image; call the checkpoint {path.with_suffix('.ckpt')}")
    return target_of(path, CheckpointError, "render.ckpt")


def _unpacked(archive: zipfile.ZipFile, path: Path) -> Checkpoint:
    header = json.loads(bytes(_array(archive, "header", _SLACK)))
    if header["format"] > _FORMAT:
        raise CheckpointError(f"{path} was written by lumipath {header['version']}, which is newer than this one")
    width, height = (int(side) for side in header["size"])
    if archive.getinfo("counts.npy").file_size < 4 * width * height:
        raise ValueError(f"it has no film of {width} x {height} pixels")
    names = [str(name) for name in header.get("layers", [])]
    film = Film(width, height, "squares.npy" in archive.namelist(), names)
    for name, array in _kept_arrays(film).items():
        stored = _array(archive, name, array.nbytes)
        if stored.shape != array.shape or stored.dtype != array.dtype:
            raise CheckpointError(f"{path} is damaged: {name} has the shape {stored.shape}")
        array[...] = stored
    film.rejected = int(header["rejected"])
    return Checkpoint(
        film,
        Identity(str(header["version"]), str(header["scene"]), dict(header["settings"])),
        tuple(SampleRange(**part) for part in header["ranges"]),
        float(header["seconds"]),
        str(header["scene_name"]),
        str(header["device"]),
    )


def _kept_arrays(film: Film) -> dict[str, Any]:
    """The arrays of a film that have anything in them, by name."""
    return {name: array for name, array in film.arrays._asdict().items() if array.size}


def _array(archive: zipfile.ZipFile, name: str, size: int) -> Any:
    """An array of at most `size` bytes; the archive knows a check sum of all of them."""
    member = f"{name}.npy"
    if archive.getinfo(member).file_size > size + _SLACK:
        raise ValueError(f"{name} is too large")
    with archive.open(member) as file:
        array = np.lib.format.read_array(file, allow_pickle=False)
        # The check sum is compared at the end of the file.
        if file.read(1):
            raise ValueError(f"{name} is too long")
    return array


def _remove_stale(target: Path) -> None:
    """Remove what writers of checkpoints in this folder left when they were killed."""
    for left in target.parent.glob(f".lumipath-*{target.suffix.lower()}"):
        try:
            if time.time() - left.stat().st_mtime > _STALE_SECONDS:
                left.unlink()
        except OSError:
            # Somebody else's: theirs to remove.
            continue


class CheckpointFile:
    """Where a session keeps its checkpoint, and when it is time for the next one.

    Args:
        path: the file.
        interval: seconds between checkpoints.

    Raises:
        CheckpointError: the file cannot be written.
    """

    def __init__(self, path: str | Path, interval: float) -> None:
        self.path = Path(path)
        self._interval = interval
        self._last = time.monotonic()
        self._written: object = None
        try_to_write(check_target(self.path), CheckpointError)

    @property
    def is_due(self) -> bool:
        """Whether the last one is old enough."""
        return time.monotonic() - self._last >= self._interval

    def write(self, checkpoint: Checkpoint) -> None:
        """Write it, unless it holds nothing new.

        Raises:
            CheckpointError: it cannot be written; the next try is due after another interval.
        """
        self._last = time.monotonic()
        samples = int(checkpoint.film.counts.sum(dtype=np.int64))
        if samples and self._written != (checkpoint.ranges, samples):
            checkpoint.save(self.path)
            self._written = (checkpoint.ranges, samples)
            # The time of writing does not count, or a slow disk would be all that is done.
            self._last = time.monotonic()
