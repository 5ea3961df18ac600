"""What every device can do."""

from __future__ import annotations

from collections.abc import Generator
from functools import partial
from typing import Any, Protocol

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

from ..pack.layout import TILE, FilmArrays, LayerArrays, PackedScene, View
from ..pack.scene import Packed


@frozen
class DeviceInfo:
    """A device that can render: `kind` as for --device, a name for people, threads, and details."""

    kind: str
    name: str
    threads: int
    detail: dict[str, Any] = field(factory=dict)


class Device(Protocol):
    """Something that renders."""

    kind: str
    name: str
    even_counts: bool
    """Whether a pass must find the same number of samples in every pixel that it adds to."""
    tree_options: dict[str, Any]
    """Of `build_tree`, for the trees that it walks."""

    def draft(self, packed: Packed) -> PackedScene:
        """The scene as `upload` will make it, but for the tree, which is empty: what to compile kernels for."""

    def stand_in(self, packed: Packed) -> partial[None]:
        """What calls the compiled loops that `upload` needs, for something small: see `compiled_beside`."""

    def upload(self, packed: Packed) -> PackedScene:
        """Build the tree and bring everything to where kernels read it."""

    def refit(self, packed: Packed) -> PackedScene:
        """Bring a scene whose vertices have moved since `upload`; then `compile` as after that.

        `packed.scene` is made of what `upload` or `refit` last gave back, with the tree of then. This tree is fitted to
        where the primitives are now, or built anew if that would make it too bad.
        """

    def compile(self, scene: PackedScene, view: View, film: FilmArrays) -> None:
        """Compile the kernels for this scene's features, or load them from the disk; a draft of the scene will do.

        What is there already, and fits the tree, is not compiled again.
        """

    def next_stop(self, done: int, pixels: int) -> int:
        """Up to how many samples per pixel the next pass should go after `done` of them."""

    def render(self, scene: PackedScene, view: View, film: FilmArrays, last: int) -> Generator[int, None, None]:
        """Bring every pixel of the film up to `last` samples; one whose tile has a lower goal, up to that.

        Yields several times a second the number of samples that were not finite since the last time. Closing the
        iterator, or an exception in it, stops the work and leaves the film valid: every pixel with its count.
        """

    def compile_layers(self, scene: PackedScene, view: View, layers: LayerArrays) -> None:
        """Compile the pass that fills layers, for a scene with the feature `LAYERS`, or load it from the disk."""

    def render_layers(
        self, scene: PackedScene, view: View, layers: LayerArrays, last: int
    ) -> Generator[int, None, None]:
        """Bring every pixel of the layers up to `last` samples, after `compile_layers` for the same scene.

        Like `render`, but what was done lies in the arrays of `layers` as soon as the iterator has ended.
        """

    def cancel(self) -> None:
        """End the pass that is under way early; its iterator must still be used up, and counts are then true."""

    def download(self, film: FilmArrays) -> None:
        """Bring the sums to the film's own arrays, where they are not there already."""

    def clear(self) -> None:
        """Forget sums that are not in the film's own arrays."""


def goals_of(film: FilmArrays, last: int) -> NDArray[np.int64]:
    """(H, W): how many samples each pixel has after a pass that goes up to `last`, if it has no more already."""
    height, width = film.counts.shape
    if not film.goals.size:
        return np.full((height, width), last, np.int64)
    of_pixels = film.goals.repeat(int(TILE), axis=0).repeat(int(TILE), axis=1)[:height, :width]
    return np.minimum(of_pixels, last).astype(np.int64)
