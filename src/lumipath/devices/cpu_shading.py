"""Shading of a batch: many paths at once in the lanes of the processor's vectors.

`shade` is scalar code. A loop over paths that only loads, computes and stores results that nobody loads in it is
compiled for 8 or 16 paths at once by LLVM's loop vectorizer, with all branches as masks. So shading is such a loop
over a block of paths; sorting out who goes on, who asks for a shadow ray and who has seen a lamp is another.
"""

from __future__ import annotations

from ..accel.packets import WIDTH, load_lanes, splat
from ..accel.trace8 import primitive_of
from ..kernels.emitted_layers import emitted_to_layers
from ..kernels.path import Path, Step, shade
from ..kernels.rays import Hit, Ray, no_ray
from ..kernels.sampler import Numbers, direction_numbers
from ..kernels.vectors import black
from ..lang import (
    INF,
    Vec3,
    as_float,
    as_int,
    count_bits,
    f32,
    i32,
    kernel,
    load,
    load_result,
    lowest_bit,
    store,
    store_result,
)
from ..lang.lanes import bits, bits_of_lanes, compress, store_lanes
from ..pack.layout import GROUPS, INSTANCES
from .cpu_arrays import BLOCK, LAPS, STRIDE, add_light, load_path, put_in_batch, sample_at

_W = i32(WIDTH)

# Rows of the results: the ray that goes on (6 rows from 0), its throughput (3), density, medium and whether it lives;
# the shadow ray (7), its light (3) and light group; the radiance emitted here (3) and its light group.
_THROUGHPUT, _PDF, _MEDIUM, _ALIVE, _SHADOW, _TMAX = i32(6), i32(9), i32(10), i32(11), i32(12), i32(18)
_DIRECT, _LIGHT, _EMITTED, _EMITTER = i32(19), i32(22), i32(23), i32(26)


@kernel
def hit_in_world(scene, rays, i):
    """What a ray has hit, in a scene without instances."""
    return Hit(load(rays.t, i), primitive_of(scene.accel, load(rays.slot, i)), i32(-1))


@kernel(needs=INSTANCES, otherwise=hit_in_world)
def hit_of(scene, rays, i):
    """What a ray has hit."""
    return Hit(load(rays.t, i), primitive_of(scene.accel, load(rays.slot, i)), load(rays.instance, i))


@kernel
def draw_numbers(scene, view, batch, n, depth):
    """The random numbers of all paths, in a loop of its own, which becomes SIMD code."""
    for i in range(n):
        pixel, sample = sample_at(batch, i)
        numbers = direction_numbers(scene, pixel, sample, view.seed, depth)
        store(batch.draws, i, numbers.a)
        store(batch.draws, STRIDE + i, numbers.b)
        store(batch.draws, 2 * STRIDE + i, numbers.c)
        store(batch.draws, 3 * STRIDE + i, numbers.d)


@kernel
def put_result(results, row, k, value):
    """A number into a row of the results."""
    store_result(results, row * BLOCK + k, value)


@kernel
def put_results(results, row, k, v):
    """A vector into three rows of the results."""
    put_result(results, row, k, v.x)
    put_result(results, row + 1, k, v.y)
    put_result(results, row + 2, k, v.z)


@kernel
def get_result(results, row, k):
    """A number from a row of the results."""
    return load_result(results, row * BLOCK + k)


@kernel
def get_results(results, row, k):
    """A vector from three rows of the results."""
    return Vec3(get_result(results, row, k), get_result(results, row + 1, k), get_result(results, row + 2, k))


@kernel
def put_no_groups(scene, results, k, step):
    """Nobody asks for light groups."""


@kernel(needs=GROUPS, otherwise=put_no_groups)
def put_groups(scene, results, k, step):
    """The light groups of a step into the results."""
    put_result(results, _LIGHT, k, as_float(step.light))
    put_result(results, _EMITTER, k, as_float(step.emitter))


@kernel
def no_group_result(scene, results, row, k):
    """Nobody asks for light groups."""
    return i32(0)


@kernel(needs=GROUPS, otherwise=no_group_result)
def group_result(scene, results, row, k):
    """A light group from the results."""
    return as_int(get_result(results, row, k))


@kernel
def shade_block(scene, view, batch, first, count, depth):
    """Shade `count` paths from `first` on and put what comes of them in the results."""
    results = batch.results
    draws = batch.draws
    for k in range(count):
        i = i32(first + k)
        hit = hit_of(scene, batch.rays, i)
        numbers = Numbers(
            load(draws, i), load(draws, STRIDE + i), load(draws, 2 * STRIDE + i), load(draws, 3 * STRIDE + i)
        )
        pixel, sample = sample_at(batch, i)
        step = shade(scene, view, load_path(batch, i, depth), hit, numbers, pixel, sample)
        path = step.path
        put_results(results, i32(0), k, path.ray.o)
        put_results(results, i32(3), k, path.ray.d)
        put_results(results, _THROUGHPUT, k, path.throughput)
        put_result(results, _PDF, k, path.pdf)
        put_result(results, _MEDIUM, k, as_float(path.medium))
        put_result(results, _ALIVE, k, f32(1.0) if path.alive else f32(0.0))
        put_results(results, _SHADOW, k, step.shadow.o)
        put_results(results, i32(_SHADOW + 3), k, step.shadow.d)
        put_result(results, _TMAX, k, step.shadow.tmax)
        put_results(results, _DIRECT, k, step.direct)
        put_results(results, _EMITTED, k, step.emitted)
        put_groups(scene, results, k, step)


@kernel
def lanes_of(results, row, k):
    """The numbers of some paths from a row of the results."""
    return load_lanes(results, row * BLOCK + k)


@kernel
def move(target, at, lanes, on):
    """The lanes that are on into `target`, one after the other from `at`; what follows them is overwritten."""
    store_lanes(target, at, compress(lanes, on))


@kernel
def move_results(x, y, z, at, results, row, k, on):
    """Three rows of the results, as `move`."""
    move(x, at, lanes_of(results, row, k), on)
    move(y, at, lanes_of(results, row + 1, k), on)
    move(z, at, lanes_of(results, row + 2, k), on)


@kernel
def move_ray(rays, at, results, row, k, on):
    """Origin and direction of rays, as `move`."""
    move_results(rays.ox, rays.oy, rays.oz, at, results, row, k, on)
    move_results(rays.dx, rays.dy, rays.dz, at, results, i32(row + 3), k, on)


@kernel
def move_no_groups(scene, batch, at, k, on):
    """Nobody asks for light groups."""


@kernel(needs=GROUPS, otherwise=move_no_groups)
def move_groups(scene, batch, at, k, on):
    """The light groups of shadow rays, as `move`."""
    move(batch.shadow_group, at, bits_of_lanes(lanes_of(batch.results, _LIGHT, k)), on)


@kernel
def emitting_step(scene, results, k, depth):
    """What a step said of the light that it found."""
    ray = Ray(get_results(results, i32(0), k), get_results(results, i32(3), k), INF)
    throughput = get_results(results, _THROUGHPUT, k)
    path = Path(ray, throughput, get_result(results, _PDF, k), depth, as_int(get_result(results, _MEDIUM, k)), False)
    emitted = get_results(results, _EMITTED, k)
    return Step(path, emitted, no_ray(), black(), group_result(scene, results, _EMITTER, k), i32(0))


@kernel
def gather_emission(scene, batch, first, k, left, depth):
    """Add the radiance that some paths found; `left` of them are there."""
    results = batch.results
    red, green, blue = (
        lanes_of(results, _EMITTED, k),
        lanes_of(results, _EMITTED + 1, k),
        lanes_of(results, _EMITTED + 2, k),
    )
    none = splat(f32(0.0))
    # Not "is more than 0": NaN is handed on, to be counted.
    shining = bits(~((red == none) & (green == none) & (blue == none))) & ((1 << left) - 1)
    while shining != 0:
        j = i32(k + lowest_bit(shining))
        shining &= shining - 1
        owner = load(batch.paths.owner, first + j)
        step = emitting_step(scene, results, j, depth)
        add_light(batch.gathered, owner, step.emitted)
        escaped = load(batch.rays.slot, first + j) < 0
        emitted_to_layers(scene, put_in_batch, batch, owner, depth, escaped, step, step.emitted)


@kernel
def collect(scene, batch, first, count, depth, going, shadows):
    """Sort the results of a block: radiance, shadow rays, and the paths that go on, which move to the front."""
    results, rays, paths, light = batch.results, batch.rays, batch.paths, batch.shadow_light
    none = splat(f32(0.0))
    k = i32(0)
    while k < count:
        i = i32(first + k)
        gather_emission(scene, batch, first, k, min(_W, i32(count - k)), depth)
        owner = load_lanes(paths.owner, i)
        tmax = lanes_of(results, _TMAX, k)
        lit = tmax > none
        move_ray(batch.shadows, shadows, results, _SHADOW, k, lit)
        move(batch.shadows.t, shadows, tmax, lit)
        move_results(light.red, light.green, light.blue, shadows, results, _DIRECT, k, lit)
        move(batch.shadow_owner, shadows, owner, lit)
        move_groups(scene, batch, shadows, k, lit)
        shadows = i32(shadows + count_bits(bits(lit)))
        alive = lanes_of(results, _ALIVE, k) > none
        pixel = load_lanes(batch.samples, i)
        sample = load_lanes(batch.samples, STRIDE + i)
        move_ray(rays, going, results, i32(0), k, alive)
        store_lanes(rays.t, going, splat(INF))
        move_results(paths.red, paths.green, paths.blue, going, results, _THROUGHPUT, k, alive)
        move(paths.pdf, going, lanes_of(results, _PDF, k), alive)
        move(paths.medium, going, bits_of_lanes(lanes_of(results, _MEDIUM, k)), alive)
        move(paths.owner, going, owner, alive)
        move(batch.samples, going, pixel, alive)
        move(batch.samples, i32(STRIDE + going), sample, alive)
        going = i32(going + count_bits(bits(alive)))
        k = i32(k + _W)
    return going, shadows


@kernel
def shade_batch(scene, view, batch, n, depth):
    """Shade all hits; the paths that go on move to the front. Returns how many, and the number of shadow rays."""
    draw_numbers(scene, view, batch, n, depth)
    shaded = i32((n + LAPS - 1) & -LAPS)
    for i in range(n, shaded):
        # What is nobody's path has hit nothing.
        store(batch.rays.slot, i, i32(-1))
    going = i32(0)
    shadows = i32(0)
    first = i32(0)
    while first < n:
        shade_block(scene, view, batch, first, min(BLOCK, i32(shaded - first)), depth)
        going, shadows = collect(scene, batch, first, min(BLOCK, i32(n - first)), depth, going, shadows)
        first = i32(first + BLOCK)
    return going, shadows
