"""Random numbers as a function of pixel, sample, dimension and seed, so that an image depends on nothing else.

Two samplers. `sobol`: pairs of dimensions from the (0, 2)-sequence of Sobol, each pair shuffled and Owen-scrambled by
hashes (Burley 2020, Practical Hash-based Owen Scrambling). `independent`: the hash pcg4d (Jarzynski and Olano 2020,
Hash Functions for GPU Rendering).
"""

from __future__ import annotations

from ..lang import f32, i32, kernel, reverse_bits, struct, u32
from ..pack.layout import INDEPENDENT_SAMPLER


@struct
class Numbers:
    """Four numbers in [0, 1)."""

    a: f32
    b: f32
    c: f32
    d: f32


@kernel
def unit_float(x):
    """32 random bits as a float32 in [0, 1): the upper 24 bits."""
    return f32(i32(x >> u32(8))) * 5.9604645e-08


@kernel
def hash32(x):
    """A well-mixing permutation of 32 bits (Wellons 2018, triple-round-free variant lowbias32)."""
    x = u32(x ^ (x >> u32(16)))
    x = u32(x * u32(0x7FEB352D))
    x = u32(x ^ (x >> u32(15)))
    x = u32(x * u32(0x846CA68B))
    return u32(x ^ (x >> u32(16)))


@kernel
def pcg4d(x, y, z, w):
    """Four hashed words of four words."""
    x = u32(x * u32(1664525) + u32(1013904223))
    y = u32(y * u32(1664525) + u32(1013904223))
    z = u32(z * u32(1664525) + u32(1013904223))
    w = u32(w * u32(1664525) + u32(1013904223))
    x = u32(x + y * w)
    y = u32(y + z * x)
    z = u32(z + x * y)
    w = u32(w + y * z)
    x = u32(x ^ (x >> u32(16)))
    y = u32(y ^ (y >> u32(16)))
    z = u32(z ^ (z >> u32(16)))
    w = u32(w ^ (w >> u32(16)))
    x = u32(x + y * w)
    y = u32(y + z * x)
    z = u32(z + x * y)
    w = u32(w + y * z)
    return Numbers(unit_float(x), unit_float(y), unit_float(z), unit_float(w))


@kernel
def laine_karras(x, seed):
    """Owen scrambling of a number whose bits are reversed (Laine and Karras 2011; constants by Vegdahl 2021)."""
    x = u32(x ^ u32(x * u32(0x3D20ADEA)))
    x = u32(x + seed)
    x = u32(x * u32((seed >> u32(16)) | u32(1)))
    x = u32(x ^ u32(x * u32(0x05526C56)))
    return u32(x ^ u32(x * u32(0x53A22864)))


@kernel
def sobol_second(i):
    """The second Sobol dimension of point i, its bits reversed: Pascal's triangle modulo 2, by five butterflies."""
    i = u32(i ^ ((i >> u32(1)) & u32(0x55555555)))
    i = u32(i ^ ((i >> u32(2)) & u32(0x33333333)))
    i = u32(i ^ ((i >> u32(4)) & u32(0x0F0F0F0F)))
    i = u32(i ^ ((i >> u32(8)) & u32(0x00FF00FF)))
    return u32(i ^ (i >> u32(16)))


@struct
class Pair:
    """Two numbers in [0, 1)."""

    a: f32
    b: f32


@kernel
def sobol_pair(reversed_sample, key):
    """Point of a scrambled (0, 2)-sequence; each key has its own order and its own scrambling."""
    # The shuffled number of the point; bit-reversed it is the first dimension, so that reversal cancels below.
    i = reverse_bits(laine_karras(reversed_sample, key))
    scramble = hash32(key ^ u32(0xA511E9B3))
    first = reverse_bits(laine_karras(i, scramble))
    second = reverse_bits(laine_karras(sobol_second(i), u32(u32(scramble * u32(0x85EBCA6B)) + u32(1))))
    return Pair(unit_float(first), unit_float(second))


@kernel
def sobol_single(reversed_sample, key):
    """Point of a scrambled van der Corput sequence; each key has its own order and its own scrambling."""
    i = reverse_bits(laine_karras(reversed_sample, key))
    return unit_float(reverse_bits(laine_karras(i, hash32(key ^ u32(0xA511E9B3)))))


@kernel
def sequence_key(pixel, seed, sequence):
    """Key of one of the sequences of a pixel."""
    return hash32(u32(hash32(u32(pixel + u32(seed * u32(0x9E3779B9)))) + u32(sequence * u32(0x85EBCA6B))))


@kernel
def four_sobol(scene, pixel, sample, seed, sequence):
    """Two pairs."""
    reversed_sample = reverse_bits(sample)
    first = sobol_pair(reversed_sample, sequence_key(pixel, seed, sequence))
    second = sobol_pair(reversed_sample, sequence_key(pixel, seed, u32(sequence + u32(1))))
    return Numbers(first.a, first.b, second.a, second.b)


@kernel(needs=INDEPENDENT_SAMPLER, otherwise=four_sobol)
def four_numbers(scene, pixel, sample, seed, sequence):
    """Four numbers: (a, b) and (c, d) are each well spread over the samples of a pixel."""
    return pcg4d(pixel, sample, sequence, seed)


@kernel
def three_sobol(scene, pixel, sample, seed, sequence):
    """Two single sequences and a hash."""
    reversed_sample = reverse_bits(sample)
    first = sobol_single(reversed_sample, sequence_key(pixel, seed, sequence))
    second = sobol_single(reversed_sample, sequence_key(pixel, seed, u32(sequence + u32(1))))
    third = unit_float(hash32(u32(sequence_key(pixel, seed, sequence) ^ hash32(u32(sample + u32(0x27D4EB2F))))))
    return Numbers(first, second, third, 0.0)


@kernel(needs=INDEPENDENT_SAMPLER, otherwise=three_sobol)
def three_numbers(scene, pixel, sample, seed, sequence):
    """Three numbers for discrete choices: (a) and (b) each well spread, (c) not."""
    return pcg4d(pixel, sample, sequence, seed)


# A path draws from sequences 0 and 1 for the camera, then from eight for each bounce.
CAMERA_SEQUENCE = u32(0)
_PER_BOUNCE = u32(8)


@kernel
def camera_numbers(scene, pixel, sample, seed):
    """(a, b): position in the pixel; (c, d): position on the lens."""
    return four_numbers(scene, pixel, sample, seed, CAMERA_SEQUENCE)


@kernel
def direction_sequence(depth):
    """The sequence of `direction_numbers`."""
    return u32(u32(depth) * _PER_BOUNCE + u32(2))


@kernel
def direction_numbers(scene, pixel, sample, seed, depth):
    """(a, b): point on a light; (c, d): direction of the path."""
    return four_numbers(scene, pixel, sample, seed, direction_sequence(depth))


@kernel
def choice_numbers(scene, pixel, sample, seed, depth):
    """(a): which light; (b): which lobe; (c): roulette."""
    return three_numbers(scene, pixel, sample, seed, u32(u32(depth) * _PER_BOUNCE + u32(4)))


@kernel
def dielectric_number(scene, pixel, sample, seed, depth):
    """Whether to reflect or to refract."""
    return three_numbers(scene, pixel, sample, seed, u32(u32(depth) * _PER_BOUNCE + u32(6))).a


@kernel
def surface_numbers(scene, pixel, sample, seed, depth):
    """(a): which material of a mix; (c): which step of textures."""
    return three_numbers(scene, pixel, sample, seed, u32(u32(depth) * _PER_BOUNCE + u32(8)))
