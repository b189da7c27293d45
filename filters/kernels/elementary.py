"""Elementary functions of float32 as polynomials: calls to the C library keep a loop from vectorising.

Minimax coefficients (fitted by iteratively reweighted least squares in float64); the errors stated are over
the whole range, against float64. Rounding to the nearest integer adds and subtracts 1.5 · 2²³, whose last bit
is worth one; it is taken off as integers so that no compiler can cancel it. Polynomials are evaluated in
pairs (Estrin), because a chain of dependent multiplications leaves the units idle.
"""

from __future__ import annotations

import math

import numpy as np
from numpy import float32, int32

from filters.kernels.compile import function

Real = float | np.float32

TWO_PI = np.float32(2.0 * math.pi)
PER_TURN = np.float32(0.5 / math.pi)
_PER_PI = np.float32(1.0 / math.pi)
_MAGIC = np.float32(12582912.0)
_MAGIC_BITS = np.int32(0x4B400000)
_LOG2E = np.float32(1.44269504)
_LN2 = np.float32(0.69314718)


@function
def bits(x: np.float32) -> np.int32:
    """The bits of a float32."""
    return float32(x).view(int32)


@function
def real(i: np.int32) -> np.float32:
    """The float32 of these bits."""
    return int32(i).view(float32)


@function
def nearest(x: np.float32) -> np.int32:
    """The nearest integer, for magnitudes below 2²²."""
    return int32(bits(float32(x + _MAGIC)) - _MAGIC_BITS)


@function
def order(x: np.float32) -> np.int32:
    """An integer that orders as the float does: an integer maximum vectorises, a float one does not."""
    i = bits(x)
    return int32(i ^ int32(int32(i >> int32(31)) & int32(0x7FFFFFFF)))


@function
def from_order(i: np.int32) -> np.float32:
    """The float of :func:`order`."""
    return real(int32(i ^ int32(int32(i >> int32(31)) & int32(0x7FFFFFFF))))


@function
def wrapped(angle: np.float32) -> np.float32:
    """The same angle in [-pi, pi], to one rounding at its ends."""
    return float32(angle - float32(nearest(float32(angle * PER_TURN))) * TWO_PI)


@function
def sine(r: np.float32) -> np.float32:
    """Sine on [-pi/2, pi/2]."""
    z = float32(r * r)
    low = float32(float32(8.333017290e-03) * z + float32(-1.666665710e-01))
    high = float32(float32(2.600054480e-06) * z + float32(-1.980661507e-04))
    return float32(r + float32(r * z) * float32(high * float32(z * z) + low))


@function
def cosine(r: np.float32) -> np.float32:
    """Cosine on [-pi/2, pi/2]."""
    z = float32(r * r)
    low = float32(float32(4.166398944e-02) * z + float32(-4.999993229e-01))
    high = float32(float32(2.319438335e-05) * z + float32(-1.385592705e-03))
    return float32(float32(1.0) + z * float32(high * float32(z * z) + low))


@function
def sincos(x: np.float32) -> tuple[np.float32, np.float32]:
    """Sine and cosine of any angle below 10⁴ rad: reduced by pi in three parts, the sign from the parity."""
    k = nearest(float32(x * _PER_PI))
    n = float32(k)
    r = float32(x - n * float32(3.140625))
    r = float32(r - n * float32(9.67502593994140625e-4))
    r = float32(r - n * float32(1.509957990978376e-7))
    sign = int32(k << int32(31))
    return real(int32(bits(sine(r)) ^ sign)), real(int32(bits(cosine(r)) ^ sign))


@function
def log(x: np.float32) -> np.float32:
    """Natural logarithm of a positive, normal float32; exactly 0 at 1."""
    i = bits(x)
    e = int32(int32(i - int32(0x3F400000)) >> int32(23))
    m = float32(real(int32(i - int32(e << int32(23)))) - float32(1.0))
    m2 = float32(m * m)
    a = float32(float32(-5.000031877e-01) * m + float32(1.000000596))
    b = float32(float32(-2.497139217e-01) * m + float32(3.332665047e-01))
    c = float32(float32(-1.746329729e-01) * m + float32(2.015715142e-01))
    d = float32(float32(-6.299257169e-02) * m + float32(1.395171635e-01))
    low = float32(b * m2 + a)
    high = float32(d * m2 + c)
    return float32(float32(e) * _LN2 + m * float32(high * float32(m2 * m2) + low))


@function
def exp_bounded(x: np.float32) -> np.float32:
    """Exponential of a number between -87 and 88."""
    t = float32(x * _LOG2E)
    shifted = float32(t + _MAGIC)
    f = float32(t - float32(int32(bits(shifted) - _MAGIC_BITS)))
    f2 = float32(f * f)
    a = float32(float32(6.931469776e-01) * f + float32(1.0))
    b = float32(float32(5.550733745e-02) * f + float32(2.402224208e-01))
    c = float32(float32(1.326472739e-03) * f + float32(9.671512917e-03))
    p = float32(float32(c * f2 + b) * f2 + a)
    return real(int32(bits(p) + int32(bits(shifted) << int32(23))))


@function
def exp(x: np.float32) -> np.float32:
    """Exponential of a number not above 88; 0 below -87, where float32 ends."""
    y = exp_bounded(float32(max(float32(x), float32(-87.0))))
    return y if x >= float32(-87.0) else float32(0.0)


@function
def log1p(y: np.float32) -> np.float32:
    """log(1 + y) for y in [0, 1]."""
    y2 = float32(y * y)
    a = float32(float32(-4.998740445e-01) * y + float32(9.999964235e-01))
    b = float32(float32(-2.407307446e-01) * y + float32(3.317982512e-01))
    c = float32(float32(-9.532245908e-02) * y + float32(1.676478306e-01))
    d = float32(float32(-6.452606272e-03) * y + float32(3.608449751e-02))
    low = float32(b * y2 + a)
    high = float32(d * y2 + c)
    return float32(y * float32(high * float32(y2 * y2) + low))


@function
def log_mixture(x: np.float32, log_inlier: Real, log_outlier: Real) -> np.float32:
    """log(exp(log_inlier - x) + exp(log_outlier)) without overflow: the larger, plus log1p of their ratio.

    A ratio below exp(-30) is nothing beside 1 and is not followed to where float32 becomes subnormal, and
    slow.
    """
    inlier = float32(log_inlier - x)
    ratio = exp_bounded(float32(-min(float32(abs(float32(inlier - log_outlier))), float32(30.0))))
    return float32(max(inlier, log_outlier) + log1p(ratio))
