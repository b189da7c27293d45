"""A particle set as columns: one row of memory per dimension, allocated once."""

from __future__ import annotations

from typing import Final

import numpy as np

from filters.kernels.compile import Float32Array


class ParticleSet:
    """What motion and sensor models see of the particles.

    Attributes
    ----------
    names : tuple of str
        The dimensions, in the order of the rows.
    rows : dict[str, int]
        Row of each dimension.
    columns : (dimension, capacity) float32
        The state; only the first ``count`` of each row are particles.
    log_weights : (capacity,) float32
        Logarithm of each weight, up to a common constant.
    count : int
        How many particles there are.
    variances : dict[str, float]
        Variance, given a particle's path, of each slow state that a sensor marginalises; the same for all particles.
    """

    __slots__ = ("capacity", "columns", "count", "log_weights", "names", "rows", "variances")

    def __init__(self, names: tuple[str, ...], capacity: int) -> None:
        self.names: Final = names
        self.rows: Final = {name: row for row, name in enumerate(names)}
        self.capacity: Final = capacity
        self.columns: Float32Array = np.zeros((len(names), capacity), np.float32)
        self.log_weights: Float32Array = np.zeros(capacity, np.float32)
        self.count = 0
        self.variances: dict[str, float] = {}

    def row(self, name: str) -> int:
        """Row of a dimension.

        Raises
        ------
        KeyError
            There is none of that name.
        """
        try:
            return self.rows[name]
        except KeyError:
            raise KeyError(f"no dimension {name!r} among {', '.join(self.names)}") from None
