"""Vector algebra, colours and orthonormal frames."""

from __future__ import annotations

from ..lang import Vec3, f32, inverse, kernel, sqrt, struct


@kernel
def dot(a, b):
    """Scalar product."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@kernel
def cross(a, b):
    """Vector product."""
    return Vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@kernel
def length(a):
    """Euclidean length."""
    return sqrt(dot(a, a))


@kernel
def normalize(a):
    """`a` scaled to length 1."""
    return a * inverse(sqrt(dot(a, a)))


@kernel
def max_component(a):
    """The largest component."""
    return max(a.x, max(a.y, a.z))


@kernel
def mean_component(a):
    """The mean of the components."""
    return (a.x + a.y + a.z) * 0.33333334


@kernel
def max_abs_component(a):
    """The largest absolute component."""
    return max(abs(a.x), max(abs(a.y), abs(a.z)))


@kernel
def luminance(c):
    """The luminance of a linear Rec.709 colour, after ITU-R BT.709."""
    return 0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z


@kernel
def between(a, b, t):
    """From `a` at t = 0 to `b` at t = 1, for numbers and vectors."""
    return a * (1.0 - t) + b * t


@kernel
def black():
    """No light."""
    return Vec3(0, 0, 0)


@kernel
def white():
    """All light."""
    return Vec3(1, 1, 1)


@kernel
def xyz(row):
    """The first three numbers of a row of four."""
    return Vec3(row[0], row[1], row[2])


@struct
class Frame:
    """An orthonormal basis; n is the local z."""

    t: Vec3
    b: Vec3
    n: Vec3


@kernel
def frame_around(n):
    """An orthonormal basis around the unit vector n (Duff et al. 2017, Building an Orthonormal Basis, Revisited)."""
    sign = f32(1.0) if n.z >= 0.0 else f32(-1.0)
    a = -inverse(sign + n.z)
    b = n.x * n.y * a
    return Frame(Vec3(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3(b, sign + n.y * n.y * a, -n.y), n)


@kernel
def to_local(frame, v):
    """World to frame."""
    return Vec3(dot(frame.t, v), dot(frame.b, v), dot(frame.n, v))


@kernel
def to_world(frame, v):
    """Frame to world."""
    return frame.t * v.x + frame.b * v.y + frame.n * v.z
