"""Transitions: of continuous time against the matrix exponential, and what is none."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse

from filters.transition import (
    DenseTransition,
    Drift,
    Forgetting,
    SparseTransition,
    transition,
    transition_over,
)


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


def test_a_drift_is_the_matrix_exponential_to_first_order() -> None:
    rates = np.array([[-0.2, 0.2, 0.0], [0.05, -0.06, 0.01], [0.05, 0.2, -0.25]])
    belief = np.array([0.2, 0.7, 0.1])
    for duration in (0.0, 0.02, 0.2):
        moved = Drift(rates, duration).predict(belief)
        assert moved.sum() == pytest.approx(1.0, abs=1e-15)
        exact = belief @ scipy.linalg.expm(rates * duration)
        np.testing.assert_allclose(moved, exact, atol=0.5 * (0.5 * duration) ** 2)


def test_forgetting_goes_back_to_an_even_belief_by_its_share() -> None:
    belief = np.array([0.2, 0.7, 0.1])
    dense = DenseTransition(0.7 * np.eye(3) + 0.1)
    np.testing.assert_allclose(Forgetting(3, 0.3).predict(belief), dense.predict(belief), rtol=1e-14)
    assert Forgetting(3, 0.0).size == 3


def test_refuses_a_drift_that_is_no_chain_and_a_share_that_is_none() -> None:
    rates = np.array([[-2.0, 2.0], [1.0, -1.0]])
    with pytest.raises(ValueError, match="more than once"):
        Drift(rates, 0.6)
    with pytest.raises(ValueError, match="sum to zero"):
        Drift(np.eye(2), 0.1)
    with pytest.raises(ValueError, match="square"):
        Drift(np.zeros((2, 3)), 0.1)
    with pytest.raises(ValueError, match="share"):
        Forgetting(3, 1.5)
