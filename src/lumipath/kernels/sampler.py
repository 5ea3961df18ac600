"""Random numbers as a function of pixel, sample, dimension and seed, so that an image depends on nothing else.

Three samplers. `sobol`: the first four dimensions of Sobol's sequence, again and again, each time shuffled and
Owen-scrambled by hashes (Burley 2020, Practical Hash-based Owen Scrambling). `blue-noise`: the same, with one sequence
for all pixels along a Z-order curve, so that pixels near each other repel like samples of one pixel do (Ahmed and Wonka
2020, Screen-Space Blue-Noise Diffusion of Monte Carlo Sampling Error via Hierarchical Ordering of Pixels).
`independent`: the hash pcg4d (Jarzynski and Olano 2020, Hash Functions for GPU Rendering).
"""

from __future__ import annotations

from ..lang import f32, i32, kernel, reverse_bits, struct, u32
from ..pack.layout import BLUE_NOISE, INDEPENDENT_SAMPLER

# Of a point's number, in the third and fourth dimension.
_BITS = 16


@struct
class Numbers:
    """Four numbers in [0, 1)."""

    a: f32
    b: f32
    c: f32
    d: f32


@struct
class SampleNumber:
    """What random numbers know of a sample."""

    pixel: u32  # which sequences
    sample: u32  # which of their points


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
def every_other_bit(x):
    """The lower 16 bits of x on the even places, zeros between them."""
    x = u32((x | (x << u32(8))) & u32(0x00FF00FF))
    x = u32((x | (x << u32(4))) & u32(0x0F0F0F0F))
    x = u32((x | (x << u32(2))) & u32(0x33333333))
    return u32((x | (x << u32(1))) & u32(0x55555555))


@kernel
def sample_of_pixel(scene, view, column, row, sample):
    """Sequences of its own for each pixel."""
    return SampleNumber(u32(row * view.width + column), u32(sample))


@kernel(needs=BLUE_NOISE, otherwise=sample_of_pixel)
def sample_number(scene, view, column, row, sample):
    """The number of a sample of a pixel of the full image.

    All pixels share one sequence: 2 ** sample_bits points for each, pixel after pixel along the Z-order curve. To
    shuffle and to scramble it is to turn the parts of each square of pixels about, and the samples in a pixel. More
    samples than that, and what does not fit into 32 bits of an image, are other sequences.
    """
    bits = view.sample_bits
    place = u32(every_other_bit(u32(column)) | (every_other_bit(u32(row)) << u32(1)))
    mask = u32((u32(1) << bits) - u32(1))
    index = u32((place << bits) | (u32(sample) & mask))
    # In two steps, since shifting by 32 is undefined.
    beyond = u32((place >> u32(1)) >> u32(u32(31) - bits))
    block = u32(u32(sample) >> bits)
    return SampleNumber(u32(hash32(u32(block ^ u32(bits << u32(27)))) + beyond), index)


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


@kernel
def sobol_third_and_fourth(i):
    """The third and the fourth Sobol dimension of point i < 65536, bits reversed: of x^2 + x + 1 and x^3 + x + 1.

    Bratley and Fox 1988, Algorithm 659; the first of the direction numbers are those of Joe and Kuo 2008. Bit-reversed,
    what their recurrences shift to the right goes to the left. Each takes 16 bits, so that one word sums up both: this
    loop is the dearest part of drawing a number.
    """
    both = u32(0)
    third, third_after = u32(0b1), u32(0b11)
    fourth, fourth_after, fourth_last = u32(0b1), u32(0b11), u32(0b100)
    for _ in range(_BITS):
        both = u32(both ^ (u32(third | (fourth << u32(16))) if (i & u32(1)) != u32(0) else u32(0)))
        third, third_after = third_after, u32(third_after ^ third ^ (third << u32(2)))
        fourth, fourth_after, fourth_last = fourth_after, fourth_last, u32(fourth_after ^ fourth ^ (fourth << u32(3)))
        i = u32(i >> u32(1))
    return u32(both & u32(0xFFFF)), u32(both >> u32(16))


@struct
class Pair:
    """Two numbers in [0, 1)."""

    a: f32
    b: f32


@kernel
def shuffled(reversed_sample, key):
    """The number of a sample's point of a sequence."""
    return reverse_bits(laine_karras(reversed_sample, key))


@kernel
def scrambled_pair(x, y, scramble):
    """Two scrambled dimensions of which the bits are reversed."""
    first = reverse_bits(laine_karras(x, scramble))
    second = reverse_bits(laine_karras(y, u32(u32(scramble * u32(0x85EBCA6B)) + u32(1))))
    return Pair(unit_float(first), unit_float(second))


@kernel
def sobol_pair(reversed_sample, key):
    """The first two dimensions, a (0, 2)-sequence; each key has its own order and its own scrambling."""
    # Bit-reversed, the number of the point is the first dimension.
    i = shuffled(reversed_sample, key)
    return scrambled_pair(i, sobol_second(i), hash32(key ^ u32(0xA511E9B3)))


@kernel
def later_pair(reversed_sample, key):
    """The third and the fourth dimension of the points of which `sobol_pair` gives the first two.

    Of a point's number only 16 bits take part. The others choose the scrambling, so that no point ever comes again.
    """
    i = shuffled(reversed_sample, key)
    third, fourth = sobol_third_and_fourth(u32(i & u32(0xFFFF)))
    return scrambled_pair(third, fourth, hash32(key ^ u32(0x63D83595) ^ (i >> u32(16))))


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
def four_sobol(scene, pixel, sample, seed, before, sequence):
    """Two pairs."""
    reversed_sample = reverse_bits(sample)
    first = later_pair(reversed_sample, sequence_key(pixel, seed, before))
    second = sobol_pair(reversed_sample, sequence_key(pixel, seed, sequence))
    return Numbers(first.a, first.b, second.a, second.b)


@kernel(needs=INDEPENDENT_SAMPLER, otherwise=four_sobol)
def four_numbers(scene, pixel, sample, seed, before, sequence):
    """Four numbers: (a, b) and (c, d) are each well spread over the samples of a pixel.

    So are (c, d) together with the (a, b) that have this sequence for the one before.
    """
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


# A path draws from sequences 0 and 1 for the camera, then from eight for each bounce. The direct light of a pixel or of
# a bounce is an integral over four dimensions: where the path came to, and from which point of a light it is lit. One
# sequence serves both, its first dimensions for the place, its later ones for the point.
CAMERA_SEQUENCE = u32(0)
LENS_SEQUENCE = u32(1)
_PER_BOUNCE = u32(8)


@kernel
def camera_numbers(scene, pixel, sample, seed):
    """(a, b): position on the lens; (c, d): position in the pixel."""
    return four_numbers(scene, pixel, sample, seed, LENS_SEQUENCE, CAMERA_SEQUENCE)


@kernel
def direction_sequence(depth):
    """The sequence of the direction in which a path goes on at this depth."""
    return u32(u32(depth) * _PER_BOUNCE + u32(2))


@kernel
def sequence_before(depth):
    """The sequence of what brought a path to this depth: the last direction, or the camera."""
    return u32(direction_sequence(depth) - _PER_BOUNCE) if depth > 0 else CAMERA_SEQUENCE


@kernel
def direction_numbers(scene, pixel, sample, seed, depth):
    """(a, b): point on a light; (c, d): direction of the path."""
    return four_numbers(scene, pixel, sample, seed, sequence_before(depth), direction_sequence(depth))


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
