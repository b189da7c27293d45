"""Slow states: biases and scales that nothing drives, and that wander a little."""

from __future__ import annotations

from typing import NamedTuple

from filters.kernels.compile import Float32Array, kernel

PERIOD = 0.1
"""Seconds gathered before a slow state walks: it is too slow to be worth normals at every tick."""


class RandomWalk(NamedTuple):
    """A state that wanders: its variance grows by ``walk**2`` a second.

    Attributes
    ----------
    name : str
        Of its column.
    walk : float
        Density of the walk, the state's unit per square root of a second.
    """

    name: str
    walk: float


@kernel("void(float32[:, ::1], int64, int64, int64, float32[:, ::1], int64, float32)")
def diffuse(
    columns: Float32Array, row: int, first: int, last: int, noise: Float32Array, noise_row: int, sigma: float
) -> None:
    """Add normal noise of standard deviation ``sigma`` to one column."""
    column = columns[row, first:last]
    normal = noise[noise_row]
    for i in range(last - first):
        column[i] += sigma * normal[i]
