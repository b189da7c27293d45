"""Counter-based normal numbers: a function of seed, stream, step and particle, and of nothing else.

The counter is hashed by pcg3d (Jarzynski and Olano, "Hash functions for GPU rendering", JCGT 9(3), 2020) to
three words; one gives the radius and the others the angle of Box and Muller's transform, so one hash gives
two independent normals. A *stream* numbers such pairs: a model of five dimensions draws from three. No state
is kept: the same numbers come out in any order, from any block and any thread.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy import float32, int32, uint32

from filters.kernels.compile import Float32Array, function, kernel
from filters.kernels.elementary import bits, cosine, log, real, sine

_MASK = (1 << 64) - 1
_MULTIPLIER = np.uint32(1664525)
_INCREMENT = np.uint32(1013904223)
_HALF_TURN = np.float32(math.pi / 2.0**32)
_UNIT = np.float32(2.0**-31)


def mix(value: int) -> int:
    """Mix 64 bits (the finaliser of SplitMix64; Steele, Lea and Flood 2014)."""
    value = (value + 0x9E3779B97F4A7C15) & _MASK
    value = ((value ^ (value >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    value = ((value ^ (value >> 27)) * 0x94D049BB133111EB) & _MASK
    return value ^ (value >> 31)


@lru_cache(maxsize=64)
def _root(seed: int, stream: int) -> int:
    return mix(mix(seed) ^ stream)


def key(seed: int, stream: int) -> int:
    """The 32-bit key of one stream of one seed."""
    return _root(seed, stream) >> 32


def uniform(seed: int, stream: int, step: int) -> float:
    """One number in (0, 1), for the draws that happen once a step."""
    return ((mix(_root(seed, stream) ^ step) >> 12) + 0.5) * 2.0**-52


@function
def hash3(
    a: np.uint32, b: np.uint32, c: np.uint32
) -> tuple[np.uint32, np.uint32, np.uint32]:  # every product is cast back, or numba widens it to 64 bits
    """pcg3d: three words to three words."""
    a = uint32(uint32(a * _MULTIPLIER) + _INCREMENT)
    b = uint32(uint32(b * _MULTIPLIER) + _INCREMENT)
    c = uint32(uint32(c * _MULTIPLIER) + _INCREMENT)
    a = uint32(a + uint32(b * c))
    b = uint32(b + uint32(c * a))
    c = uint32(c + uint32(a * b))
    a = uint32(a ^ uint32(a >> uint32(16)))
    b = uint32(b ^ uint32(b >> uint32(16)))
    c = uint32(c ^ uint32(c >> uint32(16)))
    a = uint32(a + uint32(b * c))
    b = uint32(b + uint32(c * a))
    c = uint32(c + uint32(a * b))
    return a, b, c


@kernel("void(int64, int64, uint32, uint32, float32[:, ::1], int64)")
def normal_pairs(first: int, last: int, step: int, stream_key: int, noise: Float32Array, row: int) -> None:
    """Fill two rows of ``noise`` with standard normals for the particles ``first`` to ``last``.

    The radius comes from 31 bits, so tails reach 6.6 sigma; the angle from 32 bits, its half-plane from the
    third word: the lowest bits of pcg3d's words, which a float32 leaves over, are not random enough.
    """
    one = noise[row]
    other = noise[row + 1]
    for i in range(last - first):
        p, q, r = hash3(uint32(i + first), uint32(step), uint32(stream_key))
        u = float32(float32(int32(p >> uint32(1))) + float32(0.5)) * _UNIT
        radius = float32(math.sqrt(float32(float32(-2.0) * log(u))))
        angle = float32(float32(int32(q)) * _HALF_TURN)
        sign = int32(r & uint32(0x80000000))
        one[i] = radius * sine(angle)
        other[i] = real(int32(bits(float32(radius * cosine(angle))) ^ sign))
