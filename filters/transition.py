"""Transitions over finitely many states: line 3 of Table 4.1, section 4.1.1 of *Probabilistic Robotics*.

A full matrix, a sparse one, or what a chain in continuous time makes of a duration.
"""

from __future__ import annotations

import math
import sys
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.duration import require_duration

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

ROW_TOLERANCE = 1e-9
"""How far the probabilities of leaving a state, itself included, may be from one."""


class Transition(Protocol):
    """What moves a belief: p(x_k | u, x_i) for one control u."""

    @property
    def size(self) -> int:
        """How many states it leads from and to."""
        ...

    def predict(self, belief: Vector) -> Vector:
        """Line 3 of Table 4.1: the sum over i of p(x_k | u, x_i) p_i."""
        ...


class DenseTransition:
    """A transition as a full matrix.

    Parameters
    ----------
    matrix : (n, n) array
        ``matrix[i, k]`` is p(x_k | u, x_i): from row to column, each row a distribution.

    Raises
    ------
    ValueError
        Not square, negative, not finite, or a row whose sum is not one to 1e-9.
    """

    def __init__(self, matrix: ArrayLike) -> None:
        values = np.array(matrix, np.float64)
        if values.ndim != 2 or values.shape[0] != values.shape[1] or values.size == 0:
            raise ValueError(f"transition: a square matrix is needed, got shape {values.shape}")
        require_probabilities("transition", values)
        sums = values.sum(axis=1)
        _require_rows(sums)
        self._matrix: Matrix = values / sums[:, None]

    @property
    def size(self) -> int:
        """How many states there are."""
        return len(self._matrix)

    def predict(self, belief: Vector) -> Vector:
        """Line 3 of Table 4.1 as a vector times a matrix."""
        return belief @ self._matrix


class SparseTransition:
    """A transition of which most entries are zero, as triplets; costs as much as there are triplets.

    Parameters
    ----------
    size : int
        How many states there are.
    source, target : (m,) array of int
        From which state to which; a pair that occurs twice is added up.
    probability : (m,) array
        p(target | u, source). The ones of each source sum to one.

    Raises
    ------
    ValueError
        Lengths that differ, an index outside 0 to ``size - 1``, a probability negative or not finite, or a
        source whose sum is not one to 1e-9.
    """

    def __init__(self, size: int, source: ArrayLike, target: ArrayLike, probability: ArrayLike) -> None:
        values = np.array(probability, np.float64, ndmin=1)
        rows, columns = _indices("source", source, size), _indices("target", target, size)
        if not rows.shape == columns.shape == values.shape or values.ndim != 1:
            raise ValueError(
                f"sparse transition: source, target and probability must be of one length, got "
                f"{rows.shape}, {columns.shape} and {values.shape}"
            )
        require_probabilities("sparse transition", values)
        sums: Vector = np.bincount(rows, values, size).astype(np.float64)
        _require_rows(sums)
        self._size = size
        self._source = rows
        self._target = columns
        self._probability: Vector = values / sums[rows]

    @property
    def size(self) -> int:
        """How many states there are."""
        return self._size

    def predict(self, belief: Vector) -> Vector:
        """Line 3 of Table 4.1, the sum over the triplets only."""
        moved = np.bincount(self._target, self._probability * belief[self._source], self._size)
        return cast(Vector, moved)


class Drift:
    """The transition of a chain in continuous time over a short duration: exp(Q t) to first order, 1 + Q t.

    Parameters
    ----------
    rates : (n, n) array
        ``rates[i, k]`` is how often per second state i turns into k; each row sums to zero.
    duration : float
        Seconds, in which no state is left with more than certainty.

    Raises
    ------
    ValueError
        A matrix that is not square or whose rows do not sum to zero, or a duration that is negative or too long.
    """

    def __init__(self, rates: Matrix, duration: float) -> None:
        if rates.ndim != 2 or rates.shape[0] != rates.shape[1] or rates.size == 0:
            raise ValueError(f"drift: a square matrix is needed, got shape {rates.shape}")
        if not np.abs(rates.sum(axis=1)).max() <= ROW_TOLERANCE:
            raise ValueError(f"drift: each row must sum to zero, got {rates.tolist()}")
        leaving = [-rates.item(state, state) for state in range(len(rates))]
        if not (duration >= 0.0 and max(leaving) * duration <= 1.0):
            raise ValueError(f"drift: no state may be left more than once, got {duration} s")
        self._rates = rates
        self._duration = duration

    @property
    def size(self) -> int:
        """How many states there are."""
        return len(self._rates)

    def predict(self, belief: Vector) -> Vector:
        """Line 3 of Table 4.1: p + p Q t."""
        return belief + self._duration * (belief @ self._rates)


class Forgetting:
    """The transition after which a share of the belief is spread evenly: what was learned is forgotten by so much.

    Parameters
    ----------
    size : int
        How many states.
    share : float
        In [0, 1].

    Raises
    ------
    ValueError
        No state, or a share outside [0, 1].
    """

    def __init__(self, size: int, share: float) -> None:
        if size < 1 or not 0.0 <= share <= 1.0:
            raise ValueError(f"forgetting: a state and a share in [0, 1] are needed, got {size} and {share}")
        self._size = size
        self._share = share

    @property
    def size(self) -> int:
        """How many states there are."""
        return self._size

    def predict(self, belief: Vector) -> Vector:
        """Line 3 of Table 4.1: the same share of each state goes to all of them."""
        return (1.0 - self._share) * belief + self._share / self._size * belief.sum()


def transition(given: object) -> Transition:
    """Make a transition of a matrix, or of a sparse matrix: anything with ``tocoo``, as scipy's have.

    Returns
    -------
    Transition
        What is one already is returned as it is.

    Raises
    ------
    ValueError
        As :class:`DenseTransition` and :class:`SparseTransition`.
    """
    if isinstance(given, DenseTransition | SparseTransition):
        return given
    if hasattr(given, "tocoo"):
        triplets: Any = cast(Any, given).tocoo()
        rows, columns = triplets.shape
        if rows != columns:
            raise ValueError(f"transition: a square matrix is needed, got shape {triplets.shape}")
        return SparseTransition(rows, triplets.row, triplets.col, triplets.data)
    if hasattr(given, "predict") and hasattr(given, "size"):
        return cast(Transition, given)
    return DenseTransition(cast(ArrayLike, given))


def transition_over(rates: ArrayLike, duration: float) -> DenseTransition:
    """Transition of a chain in continuous time over a duration: exp(Q t).

    So a belief that is predicted at irregular times comes out the same however the time is cut. By
    uniformisation over a step so short that no sum cancels, then repeated squaring.

    Parameters
    ----------
    rates : (n, n) array
        ``rates[i, k]`` is how often per second state i turns into k; the diagonal is not read.
    duration : float
        Seconds, not negative.

    Raises
    ------
    ValueError
        A rate or duration negative or not finite, or a matrix that is not square.
    """
    leaving = np.array(rates, np.float64, ndmin=2)
    if leaving.ndim != 2 or leaving.shape[0] != leaving.shape[1]:
        raise ValueError(f"transition rates: a square matrix is needed, got shape {leaving.shape}")
    np.fill_diagonal(leaving, 0.0)
    require_probabilities("transition rates", leaving)
    require_duration("transition rates", duration)
    fastest = float(leaving.sum(axis=1).max())
    events = fastest * duration
    squarings = max(0, math.ceil(math.log2(events))) if events > 1.0 else 0
    events = math.ldexp(events, -squarings)
    jump = leaving / max(fastest, sys.float_info.min)
    jump += np.diag(1.0 - jump.sum(axis=1))
    term = np.eye(len(leaving)) * math.exp(-events)
    moved = term.copy()
    for count in range(1, 24):  # 1 / 24! is below the last bit of one
        term = term @ jump * (events / count)
        moved += term
    for _ in range(squarings):
        moved = moved @ moved
        moved /= moved.sum(axis=1, keepdims=True)
    return DenseTransition(moved / moved.sum(axis=1, keepdims=True))


def require_probabilities(what: str, values: NDArray[np.float64]) -> None:
    """Check numbers that a distribution is made of.

    Raises
    ------
    ValueError
        One of them is negative or not finite.
    """
    if not np.isfinite(values).all() or (values < 0.0).any():
        place = int(np.flatnonzero(~np.isfinite(values) | (values < 0.0))[0])
        raise ValueError(
            f"{what}: every number must be finite and not negative, got {values.ravel()[place]} at {place}"
        )


def _require_rows(sums: Vector) -> None:
    wrong = np.flatnonzero(np.abs(sums - 1.0) > ROW_TOLERANCE)
    if wrong.size:
        raise ValueError(
            f"transition: the probabilities of leaving state {wrong[0]} must sum to one, got {sums[wrong[0]]}"
        )


def _indices(what: str, values: ArrayLike, size: int) -> NDArray[np.intp]:
    given = np.array(values, ndmin=1)
    if not np.issubdtype(given.dtype, np.integer):
        raise ValueError(f"sparse transition: {what} must be whole numbers, got {given.dtype}")
    if given.size and not 0 <= given.min() <= given.max() < size:
        raise ValueError(
            f"sparse transition: {what} must lie in 0 to {size - 1}, got {given.min()} to {given.max()}"
        )
    return given.astype(np.intp)
