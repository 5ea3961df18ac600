"""Layers beside the image (AOVs): what there is, and what each is called in files."""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum

from attrs import frozen


class Made(Enum):
    """How a layer comes about."""

    SAMPLES = "mean of all samples; those that hit nothing count as 0"
    HITS = "mean of the samples that hit something, 0 where none did"
    MIDDLE = "what the middle of the pixel shows, -1 for nothing"
    PATHS = "made of all samples of the image, with whole paths"
    FILM = "a fact of the film"


@frozen
class Layer:
    """A layer: its name, one letter for each channel in EXR files, unit, and how it is made.

    Whole ones are int32, others float32.
    """

    name: str
    channels: str
    unit: str
    made: Made

    @property
    def is_whole(self) -> bool:
        """Whether its values are whole numbers."""
        return self.made in (Made.MIDDLE, Made.FILM)

    @property
    def channel_names(self) -> list[str]:
        """Its channels in EXR files, such as `normal.X`."""
        return [f"{self.name}.{channel}" for channel in self.channels]


def layer_names(asked: Iterable[str], there: Iterable[str]) -> list[str]:
    """The names of layers that an `aov` stands for, of those that are there; `light_groups` stands for all groups."""
    groups = [name for name in there if name.startswith("light_")]
    return [name for given in asked for name in (groups if given == "light_groups" else [given])]


REGISTRY = {
    layer.name: layer
    for layer in (
        Layer("albedo", "RGB", "fraction", Made.SAMPLES),
        Layer("normal", "XYZ", "unit vector", Made.SAMPLES),
        Layer("geometric_normal", "XYZ", "unit vector", Made.SAMPLES),
        Layer("depth", "Z", "metres", Made.HITS),
        Layer("position", "XYZ", "metres", Made.HITS),
        Layer("uv", "UV", "", Made.HITS),
        Layer("emission", "RGB", "W/(m^2 sr)", Made.SAMPLES),
        Layer("direct", "RGB", "W/(m^2 sr)", Made.PATHS),
        Layer("indirect", "RGB", "W/(m^2 sr)", Made.PATHS),
        Layer("variance", "RGB", "W^2/(m^4 sr^2)", Made.PATHS),
        Layer("object_id", "I", "", Made.MIDDLE),
        Layer("material_id", "I", "", Made.MIDDLE),
        Layer("samples", "I", "", Made.FILM),
    )
}
