"""One kernel for whole paths, in which the lanes of a warp take turns at what most of them need.

`vote` suits large scenes: each turn the warp votes on whether to shade, to test triangles, or to test boxes.
`refill` suits tiny scenes: traversal runs to its end, and lanes that are done wait until enough of them can shade.

A warp renders a tile of 8 x 4 pixels. It deals the samples of the tile to its lanes as they become free, so that none
is idle while others still work, and all of them stay close together.
"""

from __future__ import annotations

from typing import Any

from numba import cuda, float32

from ...accel.walk import DONE, IDLE, go_on, idle, leaf_step, node_step, start_walk
from ...kernels.adaptive import add_square, square_of, takes
from ...kernels.path import no_path, shade, start_path
from ...kernels.rays import Hit, no_ray
from ...kernels.sampler import (
    CAMERA_SEQUENCE,
    LENS_SEQUENCE,
    SampleNumber,
    direction_sequence,
    four_numbers,
    sample_number,
    sequence_before,
)
from ...kernels.vectors import black
from ...lang import Vec3, i32, kernel, stack_ints, struct, u32
from ...lang.cuda import cuda_entry
from ...pack.layout import ADAPTIVE
from .film import add_samples
from .work import ALL_LANES, BLOCK, finite_or_counted, is_on_film, lanes_before, place_in_tile, tile_of

_WARP = i32(32)
_SUMS = BLOCK * 3
# Behind the sums of light lie those of squares, where there are any.
_ALL_SUMS = BLOCK * 4


@struct
class Lane:
    """The sample that a lane works on."""

    number: SampleNumber
    which: i32  # number of the pixel in the tile; -1: no sample
    light: Vec3


@kernel
def sample_of_turn(tile, turn):
    """The sample that is dealt in a turn: in turn 0 the first one of the first pixel, in turn 1 that of the second."""
    return u32(tile.first + (turn >> u32(5)))


@kernel
def deal(scene, view, tile, turn):
    """The lane that takes the sample of a turn."""
    which = i32(turn & u32(31))
    column = i32(view.left + tile.column + (which & 7))
    row = i32(view.top + tile.row + (which >> 3))
    number = sample_number(scene, view, column, row, sample_of_turn(tile, turn))
    return Lane(number, which if is_on_film(view, tile, which) else i32(-1), black())


@kernel
def bank_no_square(scene, sums, which, light):
    """Nobody asks for the noise."""


@kernel(needs=ADAPTIVE, otherwise=bank_no_square)
def bank_square(scene, sums, which, light):
    """Add the square of a sample to the squares of its pixel."""
    cuda.atomic.add(sums, _SUMS + which, square_of(scene, light))


@kernel
def bank(scene, work, sums, lane):
    """Add what a sample has gathered to the sum of its pixel, if it is finite."""
    if lane.which >= 0:
        light = finite_or_counted(work.counters, lane.light)
        which = (i32(cuda.threadIdx.x) & i32(-32)) + lane.which
        i = which * 3
        cuda.atomic.add(sums, i, light.x)
        cuda.atomic.add(sums, i + 1, light.y)
        cuda.atomic.add(sums, i + 2, light.z)
        bank_square(scene, sums, which, light)


@kernel
def camera_path(scene, view, tile, lane, numbers):
    """The path with which a lane's sample begins."""
    column = i32(view.left + tile.column + (lane.which & 7))
    row = i32(view.top + tile.row + (lane.which >> 3))
    return start_path(scene, view, column, row, numbers)


@kernel
def halt(walk):
    """The walk of a lane that waits for shading."""
    return go_on(walk, DONE, i32(0))


@kernel
def lit(lane, light):
    """The lane with more light."""
    return Lane(lane.number, lane.which, lane.light + light)


@kernel
def shade_lane(scene, view, work, tile, sums, turn, walk, path, lane):
    """Shade what a walk has found; where the path has ended already, begin the sample of the lane's turn.

    Both draw their random numbers together, so that the lanes of a warp part as late as possible.

    Returns the walk to do next, the path, the lane, whether the walk is a shadow ray's, and the light that it brings.
    """
    if not path.alive:
        bank(scene, work, sums, lane)
        lane = deal(scene, view, tile, turn)
    before = sequence_before(path.depth) if path.alive else LENS_SEQUENCE
    sequence = direction_sequence(path.depth) if path.alive else CAMERA_SEQUENCE
    numbers = four_numbers(scene, lane.number.pixel, lane.number.sample, view.seed, before, sequence)
    if not path.alive:
        if sample_of_turn(tile, turn) >= tile.last:
            return idle(walk), path, lane, False, black()
        if lane.which < 0:
            return walk, path, lane, False, black()
        path = camera_path(scene, view, tile, lane, numbers)
        return start_walk(path.ray), path, lane, False, black()
    hit = Hit(walk.ray.tmax, walk.primitive, walk.instance)
    step = shade(scene, view, path, hit, numbers, lane.number.pixel, lane.number.sample)
    shadow = step.shadow.tmax > 0.0
    walk = start_walk(step.shadow if shadow else step.path.ray)
    walk = walk if shadow | step.path.alive else halt(walk)
    return walk, step.path, lit(lane, step.emitted), shadow, step.direct


@kernel
def end_shadow(walk, path, lane, direct):
    """A shadow ray has ended: gather its light if it hit nothing; next is the path's own ray, if the path goes on."""
    if walk.primitive < 0:
        lane = lit(lane, direct)
    walk = start_walk(path.ray)
    return (walk if path.alive else halt(walk)), lane


@kernel
def clear_no_square(scene, sums):
    """Nobody asks for the noise."""


@kernel(needs=ADAPTIVE, otherwise=clear_no_square)
def clear_square(scene, sums):
    """Set the squares of the lane's pixel to 0."""
    sums[_SUMS + cuda.threadIdx.x] = 0.0


@kernel
def clear_sums(scene, sums):
    """Set the sums of the lane's pixel to 0."""
    for channel in range(3):
        sums[cuda.threadIdx.x * 3 + channel] = 0.0
    clear_square(scene, sums)
    cuda.syncwarp()


@kernel
def develop_no_square(scene, film, place, sums):
    """Nobody asks for the noise."""


@kernel(needs=ADAPTIVE, otherwise=develop_no_square)
def develop_square(scene, film, place, sums):
    """Add the squares of the lane's pixel to the film."""
    add_square(scene, film, place, sums[_SUMS + cuda.threadIdx.x])


@kernel
def develop(scene, view, film, tile, sums):
    """Add the sums of the lane's pixel to the film."""
    cuda.syncwarp()
    which = i32(cuda.laneid)
    if (tile.first < tile.last) & is_on_film(view, tile, which):
        place = place_in_tile(view, tile, which)
        i = cuda.threadIdx.x * 3
        add_samples(film, place, Vec3(sums[i], sums[i + 1], sums[i + 2]))
        develop_square(scene, film, place, sums)


def make_vote(stack_size: int, shade_at: int, leaf_at: int, node_steps: int, adaptive: bool = False) -> Any:
    """The voting kernel: shade once `shade_at` lanes wait for it, test a triangle once `leaf_at` do, else boxes."""
    size = _ALL_SUMS if adaptive else _SUMS

    def vote(scene, view, film, work):
        sums = cuda.shared.array(size, float32)
        clear_sums(scene, sums)
        tile = tile_of(view, work, u32(u32(cuda.grid(1)) >> u32(5)))
        # The whole warp: it has one tile.
        if not takes(scene, view, film, tile.column, tile.row, work.first):
            return
        lane = Lane(SampleNumber(u32(0), u32(0)), i32(-1), black())
        path = no_path()
        walk = halt(start_walk(no_ray()))
        dealt = u32(0)
        direct = black()
        shadow = False
        stack = stack_ints(stack_size)
        while True:
            at_node = walk.link >= 0
            at_leaf = (walk.link < 0) & (walk.link > IDLE)
            at_end = walk.link == DONE
            nodes = cuda.popc(cuda.ballot_sync(ALL_LANES, at_node))
            leaves = cuda.popc(cuda.ballot_sync(ALL_LANES, at_leaf))
            ends = cuda.popc(cuda.ballot_sync(ALL_LANES, at_end))
            if nodes + leaves + ends == 0:
                break
            if ends >= shade_at or nodes + leaves == 0:
                dead = u32(cuda.ballot_sync(ALL_LANES, at_end and not path.alive))
                if at_end:
                    turn = u32(dealt + u32(cuda.popc(u32(dead & lanes_before()))))
                    walk, path, lane, shadow, direct = shade_lane(scene, view, work, tile, sums, turn, walk, path, lane)
                dealt = u32(dealt + u32(cuda.popc(dead)))
            else:
                if leaves >= leaf_at or nodes < leaves:
                    if at_leaf:
                        walk = leaf_step(scene, walk, stack, shadow)
                else:
                    for _ in range(node_steps):
                        if walk.link >= 0:
                            walk = node_step(scene, walk, stack)
                if shadow and walk.link == DONE:
                    walk, lane = end_shadow(walk, path, lane, direct)
                    shadow = False
            cuda.syncwarp()
        develop(scene, view, film, tile, sums)

    return cuda_entry(vote)


def make_refill(stack_size: int, threshold: int, adaptive: bool = False) -> Any:
    """The refilling kernel: shade when fewer than `threshold` lanes still walk."""
    size = _ALL_SUMS if adaptive else _SUMS

    def refill(scene, view, film, work):
        sums = cuda.shared.array(size, float32)
        clear_sums(scene, sums)
        tile = tile_of(view, work, u32(u32(cuda.grid(1)) >> u32(5)))
        # The whole warp: it has one tile.
        if not takes(scene, view, film, tile.column, tile.row, work.first):
            return
        lane = Lane(SampleNumber(u32(0), u32(0)), i32(-1), black())
        path = no_path()
        walk = halt(start_walk(no_ray()))
        dealt = u32(0)
        direct = black()
        shadow = False
        stack = stack_ints(stack_size)
        while True:
            walkers = cuda.popc(cuda.ballot_sync(ALL_LANES, walk.link > IDLE))
            waiting = walk.link == DONE
            waiters = cuda.popc(cuda.ballot_sync(ALL_LANES, waiting))
            if walkers + waiters == 0:
                break
            if waiters != 0 and walkers < threshold:
                dead = u32(cuda.ballot_sync(ALL_LANES, waiting and not path.alive))
                if waiting:
                    turn = u32(dealt + u32(cuda.popc(u32(dead & lanes_before()))))
                    walk, path, lane, shadow, direct = shade_lane(scene, view, work, tile, sums, turn, walk, path, lane)
                dealt = u32(dealt + u32(cuda.popc(dead)))
            elif walk.link > IDLE:
                while walk.link >= 0:
                    walk = node_step(scene, walk, stack)
                while (walk.link < 0) & (walk.link > IDLE):
                    walk = leaf_step(scene, walk, stack, shadow)
                if shadow and walk.link == DONE:
                    walk, lane = end_shadow(walk, path, lane, direct)
                    shadow = False
            cuda.syncwarp()
        develop(scene, view, film, tile, sums)

    return cuda_entry(refill)
