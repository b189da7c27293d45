"""Counting occupied bins by hashing, without allocation."""

from __future__ import annotations

import math

import numpy as np
from numpy import float64, int64, uint64
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array, Int32Array, function, kernel

GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


@function
def _mixed(key: np.uint64) -> np.uint64:
    """Spread a bin's key over the table (the finaliser of SplitMix64)."""
    key = uint64((key ^ uint64(key >> uint64(30))) * uint64(0xBF58476D1CE4E5B9))
    key = uint64((key ^ uint64(key >> uint64(27))) * uint64(0x94D049BB133111EB))
    return uint64(key ^ uint64(key >> uint64(31)))


@function
def bin_key(
    north: float, east: float, heading: float, per_north: float, per_east: float, per_heading: float
) -> np.int64:
    """The bin of a pose as one number, 21 bits per dimension: bins two million apart share it."""
    n = int64(math.floor(float64(north) * per_north)) & int64(0x1FFFFF)
    e = int64(math.floor(float64(east) * per_east)) & int64(0x1FFFFF)
    h = int64(math.floor((float64(heading) + math.pi) * per_heading)) & int64(0x1FFFFF)
    return int64(int64(n << int64(42)) | int64(e << int64(21)) | h)


@function
def touch(key: np.int64, keys: NDArray[np.int64], stamps: Int32Array, stamp: int) -> int:
    """Enter a bin in an open-addressing table, a power of two in size and never full; 1 if it is new, else 0.

    An entry counts only if its stamp is this call's, so the table is never cleared.
    """
    mask = int64(keys.size - 1)
    slot = int64(_mixed(uint64(key)) & uint64(mask))
    while stamps[slot] == stamp and keys[slot] != key:
        slot = int64(int64(slot + 1) & mask)
    if stamps[slot] == stamp:
        return 0
    stamps[slot] = stamp
    keys[slot] = key
    return 1


@kernel(
    "int64(float32[:, ::1], float32[::1], int64, int64, float32, float64, float64, float64,"
    "int64[::1], int32[::1], int32)",
    exact=True,
)
def occupied(
    columns: Float32Array,
    weights: Float32Array,
    particles: int,
    samples: int,
    least: float,
    per_north: float,
    per_east: float,
    per_heading: float,
    keys: NDArray[np.int64],
    stamps: Int32Array,
    stamp: int,
) -> int:
    """Count the bins of (north, east, heading) that ``samples`` particles evenly spaced among all lie in.

    ``keys`` and ``stamps`` are the table of :func:`touch`, larger than ``samples``. Particles lighter than ``least`` do
    not count.
    """
    count = 0
    for k in range(samples):
        i = k * particles // samples
        if weights[i] < least:
            continue
        key = bin_key(columns[0, i], columns[1, i], columns[2, i], per_north, per_east, per_heading)
        count += touch(key, keys, stamps, stamp)
    return count


@kernel(
    "UniTuple(int64, 2)(float32[:, ::1], float64[::1], float64, float64, float64, float64, int64, int64, float64,"
    "float64, int64[::1], int32[::1], int32)",
    exact=True,
)
def draws_until_enough(
    columns: Float32Array,
    cumulative: NDArray[np.float64],
    uniform: float,
    per_north: float,
    per_east: float,
    per_heading: float,
    minimum: int,
    maximum: int,
    error: float,
    quantile: float,
    keys: NDArray[np.int64],
    stamps: Int32Array,
    stamp: int,
) -> tuple[int, int]:
    """Draw until the draws are as many as the KLD bound of the bins that they touched; return draws and bins.

    Draw m is the source at the fraction (uniform + m g) mod 1 of the cumulative weight, g being the golden ratio:
    the first n such places are spread nearly as evenly as the n of Table 4.4, for every n, in no order of the sources.
    The table must have more places than there can be bins.
    """
    total = cumulative[cumulative.size - 1]
    bins = 0
    needed = float(minimum)
    drawn = 0
    fraction = uniform % 1.0
    while drawn < maximum and drawn < needed:
        place = fraction * total
        low = 0
        high = cumulative.size - 1
        while low < high:  # the first source whose cumulative weight exceeds the place
            middle = (low + high) // 2
            if cumulative[middle] > place:
                high = middle
            else:
                low = middle + 1
        key = bin_key(columns[0, low], columns[1, low], columns[2, low], per_north, per_east, per_heading)
        new = touch(key, keys, stamps, stamp)
        bins += new
        drawn += 1
        if new == 1 and bins > 1:
            ninth = 2.0 / (9.0 * (bins - 1))
            root = 1.0 - ninth + math.sqrt(ninth) * quantile
            needed = max(float(minimum), (bins - 1) / (2.0 * error) * root * root * root)
        fraction += GOLDEN
        if fraction >= 1.0:
            fraction -= 1.0
    return drawn, bins
