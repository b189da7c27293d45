"""Counting occupied bins by hashing, without allocation."""

from __future__ import annotations

import math

import numpy as np
from numpy import int64, uint64
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array, Int32Array, function, kernel


@function
def _mixed(key: np.uint64) -> np.uint64:
    """Spread a bin's key over the table (the finaliser of SplitMix64)."""
    key = uint64((key ^ uint64(key >> uint64(30))) * uint64(0xBF58476D1CE4E5B9))
    key = uint64((key ^ uint64(key >> uint64(27))) * uint64(0x94D049BB133111EB))
    return uint64(key ^ uint64(key >> uint64(31)))


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

    ``keys`` and ``stamps`` are an open-addressing table, a power of two in size and larger than ``samples``;
    an entry counts only if its stamp is this call's, so the table is never cleared. Particles lighter than
    ``least`` do not count. 21 bits per dimension: bins a million bins apart share a key.
    """
    mask = int64(keys.size - 1)
    count = 0
    for k in range(samples):
        i = k * particles // samples
        if weights[i] < least:
            continue
        north = int64(math.floor(columns[0, i] * per_north)) & int64(0x1FFFFF)
        east = int64(math.floor(columns[1, i] * per_east)) & int64(0x1FFFFF)
        heading = int64(math.floor((columns[2, i] + math.pi) * per_heading)) & int64(0x1FFFFF)
        key = int64(int64(north << int64(42)) | int64(east << int64(21)) | heading)
        slot = int64(_mixed(uint64(key)) & uint64(mask))
        while stamps[slot] == stamp and keys[slot] != key:
            slot = int64(int64(slot + 1) & mask)
        if stamps[slot] != stamp:
            stamps[slot] = stamp
            keys[slot] = key
            count += 1
    return count
