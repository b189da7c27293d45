"""Drawing one column's values together, before noise spreads them again."""

from __future__ import annotations

from numpy import float32

from filters.kernels.compile import Float32Array, kernel


@kernel("void(float32[:, ::1], int64, int64, int64, float32, float32)")
def shrink(columns: Float32Array, row: int, first: int, last: int, mean: float, factor: float) -> None:
    """Multiply the distance from ``mean`` by ``factor``."""
    column = columns[row, first:last]
    for i in range(last - first):
        column[i] = mean + factor * float32(column[i] - mean)
