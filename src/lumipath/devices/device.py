"""What every device can do."""

from __future__ import annotations

from typing import Any, Protocol

from attrs import field, frozen

from ..pack.layout import FilmArrays, PackedScene, View
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

    def upload(self, packed: Packed) -> PackedScene:
        """Build the tree and bring everything to where kernels read it."""

    def compile(self, scene: PackedScene, view: View, film: FilmArrays) -> None:
        """Compile the kernels for this scene's features, or load them from the disk."""

    def render(self, scene: PackedScene, view: View, film: FilmArrays, last: int) -> int:
        """Bring every pixel of the film up to `last` samples; returns how many were not finite.

        On KeyboardInterrupt the film stays valid.
        """

    def download(self, film: FilmArrays) -> None:
        """Bring the sums to the film's own arrays, where they are not there already."""
