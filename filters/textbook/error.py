"""How an error over many repetitions is summed up."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike


def root_mean_square(errors: ArrayLike) -> float:
    """Return the root of the mean square, in the unit of the errors."""
    return math.sqrt(float(np.square(np.asarray(errors, np.float64)).mean()))
