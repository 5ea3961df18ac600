"""Kill processes that write checkpoints, at random moments, and look at the file after each: FILE KILLS."""

import json
import os
import random
import signal
import sys
import time
from pathlib import Path

import numpy as np

from lumipath.rendering.checkpoint import Checkpoint, Identity, range_of
from lumipath.rendering.film import Film
from lumipath.scene import Scene
from lumipath.settings import RenderSettings

WIDTH, HEIGHT = 160, 120


def film_with(count):
    """A film whose every number says how many samples it has."""
    film = Film(WIDTH, HEIGHT)
    for array in film.arrays:
        array[...] = count
    return film


def write(path, count):
    identity = Identity.of(Scene(), RenderSettings(width=WIDTH, height=HEIGHT))
    film = film_with(count)
    Checkpoint(film, identity, (range_of(film, 0, 0),), 0.0, "scene", "device").save(path)


def write_for_ever(path, count):
    while True:
        count += 1
        write(path, count)


def seconds_of_a_writer(path):
    """What a process takes to write one file: on a busy machine a fixed time would be over before it had begun."""
    start = time.perf_counter()
    child = os.fork()
    if child == 0:
        write(path, 1)
        os._exit(0)
    os.waitpid(child, 0)
    return time.perf_counter() - start


def last_count(path):
    """The count that the file holds; fails unless every number in it is of one writing."""
    if not path.exists():
        return 0
    film = Checkpoint.load(path).film
    count = int(film.counts[0, 0])
    assert all(np.all(array == count) for array in film.arrays), "a file of two halves"
    return count


def main(path, kills):
    random.seed(11)
    span, count, cut_short = seconds_of_a_writer(path), 1, 0
    for _ in range(kills):
        child = os.fork()
        if child == 0:
            write_for_ever(path, count)
        time.sleep(random.uniform(0.0, 4 * span))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        left = list(path.parent.glob(".lumipath-*"))
        cut_short += bool(left)
        for name in left:
            name.unlink()
        after = last_count(path)
        assert after >= count, f"{after} samples after {count}"
        count = after
    print(json.dumps({"kills": kills, "written": count, "cut_short": cut_short}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
