"""Transitions: of continuous time against the matrix exponential, and what is none."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse

from filters.transition import DenseTransition, SparseTransition, transition, transition_over


@pytest.mark.parametrize("duration", [0.0, 1e-6, 0.3, 1.0, 40.0, 1e5])
def test_continuous_time_equals_the_matrix_exponential(duration: float) -> None:
    rates = np.array([[7.0, 0.5, 0.0], [0.2, 0.0, 3.0], [0.2, 1.0, -4.0]])
    generator = rates - np.diag(np.diag(rates))
    generator -= np.diag(generator.sum(axis=1))
    expected = scipy.linalg.expm(generator * duration)
    moving = transition_over(rates, duration)
    got = np.array([moving.predict(row) for row in np.eye(3)])
    np.testing.assert_allclose(got, expected, atol=1e-12)


def test_triplets_that_occur_twice_add_up() -> None:
    twice = SparseTransition(2, [0, 0, 1], [1, 1, 1], [0.4, 0.6, 1.0])
    assert twice.predict(np.array([1.0, 0.0])).tolist() == [0.0, 1.0]
    assert twice.size == DenseTransition(np.eye(2)).size == 2


@pytest.mark.parametrize(
    ("make", "what"),
    [
        (lambda: transition(np.ones((2, 3))), "square"),
        (lambda: transition(scipy.sparse.coo_array(np.ones((2, 3)))), "square"),
        (lambda: transition([[math.nan, 1.0], [0.0, 1.0]]), "finite"),
        (lambda: SparseTransition(2, [0, 1], [0], [1.0]), "one length"),
        (lambda: SparseTransition(2, [0, 2], [0, 1], [1.0, 1.0]), "0 to 1"),
        (lambda: SparseTransition(2, [0, 1], [0, -1], [1.0, 1.0]), "0 to 1"),
        (lambda: SparseTransition(2, [0.0, 1.0], [0, 1], [1.0, 1.0]), "whole numbers"),
        (lambda: SparseTransition(2, [0, 1], [0, 1], [1.5, 1.0]), "sum to one"),
        (lambda: SparseTransition(2, [0, 0, 1], [0, 1, 1], [1.5, -0.5, 1.0]), "not negative"),
        (lambda: transition_over([[0.0, -1.0], [0.0, 0.0]], 1.0), "not negative"),
        (lambda: transition_over([[0.0, 1.0]], 1.0), "square"),
        (lambda: transition_over([[0.0]], math.inf), "duration"),
    ],
)
def test_what_makes_no_sense_is_refused(make: Callable[[], object], what: str) -> None:
    with pytest.raises(ValueError, match=what):
        make()
