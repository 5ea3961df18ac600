"""Elementary functions as polynomials: no library call, no branch, the same rounding on every device."""

from __future__ import annotations

from ..lang import as_float, as_int, f32, i32, kernel, sqrt


@kernel
def cos_sin_turn(u):
    """Cos and sin of 2 pi u for u in [0, 1]; absolute error below 3e-7.

    The quadrant is split off; the rest is a minimax polynomial on [-pi/4, pi/4] (coefficients of Cephes' sinf, cosf).
    """
    k = i32(u * 4.0 + 0.5)
    x = (u * 4.0 - f32(k)) * 1.5707963
    x2 = x * x
    s = x * (1.0 + x2 * (-0.16666654 + x2 * (0.0083321608 + x2 * -0.00019515296)))
    c = 1.0 + x2 * (-0.5 + x2 * (0.041666645 + x2 * (-0.0013887316 + x2 * 2.4433157e-05)))
    swapped = (k & 1) == 1
    cosine = s if swapped else c
    sine = c if swapped else s
    q = k & 3
    return (-cosine if (q == 1) | (q == 2) else cosine), (-sine if q >= 2 else sine)


@kernel
def floor_int(x):
    """The largest whole number not above x, as int32."""
    i = i32(x)
    return i32(i - 1) if x < f32(i) else i


@kernel
def exp_minus(x):
    """exp(-x) for x >= 0; relative error below 3e-7; 0 for x above 87."""
    y = min(x, 88.0)
    k = i32(y * -1.442695 - 0.5)
    # ln 2 in two parts, so that no digits of a large x are lost (Cody and Waite 1980).
    r = (-y - f32(k) * 0.693359375) + f32(k) * 2.12194440e-4
    # Taylor series of exp on [-0.35, 0.35], enough for float32.
    p = 1.0 + r * (1.0 + r * (0.5 + r * (0.16666667 + r * (0.041666668 + r * (0.008333334 + r * 0.0013888889)))))
    return p * as_float((k + 127) << 23) if x < 87.0 else f32(0.0)


@kernel
def unit_power(x, n):
    """X to the power of n for x in [0, 1] and n >= 0; relative error below 1e-6 (1 + ln(1 / result)); 0 to the 0 is 1.

    x = 2^k m with m about 1; ln m is twice the series of artanh((m - 1) / (m + 1)).
    """
    bits = as_int(x)
    # 0x3F3504F3 is sqrt(1/2): m lies between it and sqrt(2).
    k = i32(i32(bits - 0x3F3504F3) >> 23)
    m = as_float(i32(bits - i32(k << 23)))
    s = (m - 1.0) / (m + 1.0)
    s2 = s * s
    series = 1.0 + s2 * (0.33333334 + s2 * (0.2 + s2 * (0.14285715 + s2 * 0.11111111)))
    return exp_minus(max(0.0, -n * (f32(k) * 0.6931472 + 2.0 * s * series)))


@kernel
def atan2_turn(y, x):
    """The angle of (x, y) in turns, from 0 to 1; absolute error below 1e-6.

    atan on [0, 1] is an odd minimax polynomial (Abramowitz and Stegun 1964, 4.4.49), extended by symmetry.
    """
    ax = abs(x)
    ay = abs(y)
    big = max(ax, ay)
    r = min(ax, ay) / (big if big > 1e-30 else f32(1e-30))
    s = r * r
    p = 1.0 + s * (
        -0.3333314528
        + s
        * (
            0.1999355085
            + s
            * (
                -0.1420889944
                + s * (0.1065626393 + s * (-0.0752896400 + s * (0.0429096138 + s * (-0.0161657367 + s * 0.0028662257))))
            )
        )
    )
    a = r * p * 0.15915494
    a = 0.25 - a if ay > ax else a
    a = 0.5 - a if x < 0.0 else a
    return 1.0 - a if y < 0.0 else a


@kernel
def acos_turn(x):
    """The angle from 0 to pi whose cosine is x, divided by pi, so from 0 to 1."""
    c = min(max(x, -1.0), 1.0)
    return 2.0 * atan2_turn(sqrt(max(0.0, 1.0 - c * c)), c)


@kernel
def power_heuristic(a, b):
    """Weight of the strategy with density a against one with density b (Veach 1997, section 9.2.4; exponent 2)."""
    # By the ratio, since the squares overflow for narrow lobes; a = 0 makes it infinite and the weight 0.
    r = b / a
    return 1.0 / (1.0 + r * r)


@kernel
def strategy_weight(pdf, other):
    """Multiple importance sampling: weight of a sample that only light sampling (density `other`) competes for."""
    return f32(1.0) if pdf == 0.0 else power_heuristic(pdf, other)
