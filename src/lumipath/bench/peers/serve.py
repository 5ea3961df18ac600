"""What the scripts of other renderers share: requests come as JSON lines on stdin, answers go as such to stdout."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from typing import Any


def serve(make: Callable[[Any, list[str]], tuple[str, Callable[[int, int], tuple[Any, float]]]]) -> None:
    """Answer requests until stdin ends. Command line: the file of the scene, then options.

    Args:
        make: called with the arrays of the scene and the options; returns the renderer's name with its version, and a
            function of samples per pixel and seed that renders and returns linear RGB (H, W, 3) and the seconds taken.
    """
    import numpy as np

    # Renderers write to stdout as they like: answers get a stream of their own, and the rest goes to stderr.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)

    def answer(**facts: Any) -> None:
        answers.write(json.dumps(facts) + "\n")
        answers.flush()

    try:
        name, render = make(np.load(sys.argv[1]), sys.argv[2:])
        answer(name=name)
        for line in sys.stdin:
            request = json.loads(line)
            pixels, seconds = render(request["spp"], request["seed"])
            np.save(request["file"], np.ascontiguousarray(pixels, np.float32))
            answer(seconds=seconds)
    except Exception as error:
        answer(error=f"{type(error).__name__}: {error}")
        raise SystemExit(1) from None


def meshes(arrays: Any) -> list[tuple[Any, Any, Any, Any]]:
    """Vertices, faces, albedo and emission of each mesh."""
    count = sum(name.startswith("vertices_") for name in arrays.files)
    parts = ("vertices", "faces", "albedo", "emission")
    return [tuple(arrays[f"{part}_{k}"] for part in parts) for k in range(count)]  # type: ignore[misc]
