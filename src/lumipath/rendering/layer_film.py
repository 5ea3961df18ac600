"""Sums of layers, and the layers made of them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..lang import i32
from ..pack.geometry import shape_numbers
from ..pack.layout import INSTANCE_MATERIAL, INSTANCE_SHAPE, MATERIAL_MASK, LayerArrays, LayerColumns, PackedScene
from ..scene import Scene
from .layers import REGISTRY, Layer, Made
from .memory import require_memory

LAYER_SAMPLES = 64
"""Samples per pixel that layers have at most: edges are smooth by then, and the first hit has hardly any noise."""


class LayerFilm:
    """Sums of the layers of one render.

    Args:
        names: of the layers.
        width: pixels across.
        height: pixels down.
        spp: samples per pixel of the render; the layers have as many, but at most `LAYER_SAMPLES`.

    Raises:
        UsageError: there is not enough memory for them.
    """

    def __init__(self, names: Sequence[str], width: int, height: int, spp: int) -> None:
        self.names = tuple(names)
        layers = [REGISTRY[name] for name in names]
        columns, channels = {}, 0
        for layer in layers:
            if not layer.is_whole:
                columns[layer.name] = i32(channels)
                channels += len(layer.channels)
        whole = len(layers) - len(columns)
        # Sums, the layers made of them, and all of them side by side in a file that is being written.
        require_memory(width, height, 12 * channels + 8 * whole + 16, f"the layers {', '.join(names)}")
        self._needs_rays = any(layer.made is not Made.FILM for layer in layers)
        self.samples = min(spp, LAYER_SAMPLES) if self._needs_rays else 0
        self.arrays = LayerArrays(
            np.zeros((height, width, max(channels, 1)), np.float32),
            np.zeros((height, width), np.uint32),
            np.zeros((height, width), np.uint32),
            np.full((height, width), -1, np.int32),
            np.full((height, width), -1, np.int32),
            LayerColumns(*(columns.get(name, i32(-1)) for name in LayerColumns._fields)),
            i32(max(channels, 1)),
        )

    @property
    def is_complete(self) -> bool:
        """Whether every pixel has all samples."""
        return bool((self.arrays.counts >= self.samples).all())

    def clear(self) -> None:
        """No samples."""
        for array in self.arrays[:3]:
            array.fill(0)
        for array in (self.arrays.primitives, self.arrays.instances):
            array.fill(-1)

    def layers(self, counts: NDArray[np.uint32], packed: PackedScene, scene: Scene) -> dict[str, NDArray[Any]]:
        """The layers of the samples so far, (H, W, C) float32 or int32 each.

        Args:
            counts: (H, W) samples of the image.
            packed: the scene, its arrays on the host.
            scene: the same.
        """
        return {name: self._layer(REGISTRY[name], counts, packed, scene) for name in self.names}

    def _layer(
        self, layer: Layer, counts: NDArray[np.uint32], packed: PackedScene, scene: Scene
    ) -> NDArray[np.float32] | NDArray[np.int32]:
        if layer.name == "samples":
            return np.minimum(counts, np.iinfo(np.int32).max).astype(np.int32)[..., None]
        if layer.name == "object_id":
            return self._by_primitive(shape_numbers(scene), packed.instances[:, INSTANCE_SHAPE])
        if layer.name == "material_id":
            own = packed.instances[:, INSTANCE_MATERIAL]
            return self._by_primitive(packed.primitives[:, 3].view(np.int32) & MATERIAL_MASK, own)
        first = int(getattr(self.arrays.columns, layer.name))
        sums = self.arrays.sums[..., first : first + len(layer.channels)]
        weights = self.arrays.hits if layer.made is Made.HITS else self.arrays.counts
        mean = sums / np.maximum(weights, 1).astype(np.float32)[..., None]
        return np.clip(mean, 0, 1) if layer.name == "albedo" else mean

    def _by_primitive(self, numbers: NDArray[np.int32], placed: NDArray[np.float32]) -> NDArray[np.int32]:
        """(H, W, 1): the number of what the middle of each pixel shows.

        Args:
            numbers: (P,) those of all primitives.
            placed: (I,) as bits those that take their place in instances; -1: none does.
        """
        primitives, instances = self.arrays.primitives, self.arrays.instances
        found = np.full(primitives.shape, -1, np.int32)
        found[primitives >= 0] = numbers[primitives[primitives >= 0]]
        is_placed = instances >= 0
        own = placed.view(np.int32)[instances[is_placed]]
        found[is_placed] = np.where(own >= 0, own, found[is_placed])
        return found[..., None]

    def metadata(self, scene: Scene, material_names: Sequence[str]) -> dict[str, Any]:
        """What readers of the layers want to know: samples, and names of objects and materials as JSON lists."""
        known: dict[str, Any] = {"layer_samples": self.samples} if self._needs_rays else {}
        if "object_id" in self.names:
            known["object_names"] = json.dumps([shape.name for shape in scene.shapes])
        if "material_id" in self.names:
            known["material_names"] = json.dumps(list(material_names))
        return known
