"""The discrete Bayes filter against the sum over all paths of states."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from enum import Enum

import numpy as np
import pytest
import scipy.sparse
from hypothesis import given, settings
from hypothesis import strategies as st

from filters.discrete import DiscreteBayesFilter
from filters.transition import DenseTransition, SparseTransition, transition_over

STATES = ("a", "b", "c")


def stochastic(rng: np.random.Generator, size: int, zeros: float = 0.0) -> np.ndarray:
    matrix = rng.random((size, size)) * (rng.random((size, size)) >= zeros) + np.eye(size) * 0.1
    return matrix / matrix.sum(axis=1, keepdims=True)


def enumerated(
    start: np.ndarray, moves: list[np.ndarray], likelihoods: list[np.ndarray]
) -> tuple[np.ndarray, float]:
    """Belief and evidence by adding up the probability of every path."""
    size = start.size
    end = np.zeros(size)
    for path in itertools.product(range(size), repeat=len(moves) + 1):
        probability = start[path[0]]
        for t, (move, likelihood) in enumerate(zip(moves, likelihoods, strict=True)):
            probability *= move[path[t], path[t + 1]] * likelihood[path[t + 1]]
        end[path[-1]] += probability
    return end / end.sum(), end.sum()


def triplets(matrix: np.ndarray) -> SparseTransition:
    source, target = np.nonzero(matrix)
    return SparseTransition(len(matrix), source, target, matrix[source, target])


MAKERS: dict[str, Callable[[np.ndarray], object]] = {
    "matrix": lambda matrix: matrix.tolist(),
    "dense": DenseTransition,
    "triplets": triplets,
    "scipy": scipy.sparse.csr_array,
    "scipy, matrix": scipy.sparse.csc_matrix,
}


@pytest.mark.parametrize("maker", MAKERS)
@pytest.mark.parametrize("size", [2, 3, 4])
def test_it_equals_the_sum_over_all_paths(maker: str, size: int) -> None:
    rng = np.random.default_rng(size)
    tables = {"push": stochastic(rng, size, zeros=0.4), "pull": stochastic(rng, size)}
    start = rng.random(size)
    controls = ["push", "pull", "push", "push", "pull", "push"]
    likelihoods = [rng.random(size) * (rng.random(size) > 0.2) + 1e-3 for _ in controls]
    belief = DiscreteBayesFilter(
        range(size), {control: MAKERS[maker](table) for control, table in tables.items()}, start
    )
    log_evidence = 0.0
    for control, likelihood in zip(controls, likelihoods, strict=True):
        belief.predict(control)
        log_evidence += belief.update(likelihood)
    expected, evidence = enumerated(start / start.sum(), [tables[c] for c in controls], likelihoods)
    np.testing.assert_allclose(belief.belief, expected, rtol=1e-12, atol=1e-15)
    assert math.exp(log_evidence) == pytest.approx(evidence, rel=1e-12)


def test_the_door_of_section_2_4_2() -> None:
    """A robot that pushes a door and senses it: 0.75 and 0.983 are the book's numbers."""
    push = [[1.0, 0.0], [0.8, 0.2]]
    belief = DiscreteBayesFilter(("open", "closed"), {"push": push, "nothing": np.eye(2)})
    belief.predict("nothing")
    belief.update([0.6, 0.2])
    assert belief.probability("open") == pytest.approx(0.75)
    belief.predict("push")
    assert belief.probability("open") == pytest.approx(0.95)
    belief.update([0.6, 0.2])
    assert belief.probability("open") == pytest.approx(0.95 * 0.6 / (0.95 * 0.6 + 0.05 * 0.2))
    assert belief.most_likely == "open"


class Mode(Enum):
    STILL = "still"
    MOVING = "moving"
    SLIPPING = "slipping"


def test_the_motion_mode_of_a_vehicle() -> None:
    """Wheels turn, the gyro and the position do not: slipping; then all of it stands: still."""
    rates = [[0.0, 0.5, 0.0], [0.2, 0.0, 0.1], [0.2, 1.0, 0.0]]
    belief = DiscreteBayesFilter(tuple(Mode), transition_over(rates, 0.1))
    for _ in range(20):
        belief.propagate(transition_over(rates, 0.1))
        belief.update([0.001, 0.2, 0.9])
    assert belief.most_likely is Mode.SLIPPING
    for _ in range(20):
        belief.predict()
        belief.update([0.9, 0.05, 0.01])
    assert belief.most_likely is Mode.STILL
    assert belief.probability(Mode.STILL) > 0.95


def test_likelihoods_so_small_that_only_their_logarithms_exist() -> None:
    belief = DiscreteBayesFilter(STATES, np.eye(3), [0.2, 0.3, 0.5])
    assert belief.update_log([-5000.0, -5001.0, -math.inf]) == pytest.approx(
        -5000.0 + math.log(0.2 + 0.3 / math.e)
    )
    expected = np.array([0.2, 0.3 / math.e, 0.0])
    np.testing.assert_allclose(belief.belief, expected / expected.sum(), rtol=1e-12)


def test_a_state_comes_back_after_a_thousand_measurements_against_it() -> None:
    belief = DiscreteBayesFilter(("so", "not so"), np.eye(2))
    for _ in range(1000):
        belief.update([1.0, 0.1])
    assert belief.belief[1] == 0.0
    for _ in range(1001):
        belief.update([0.1, 1.0])
    assert belief.probability("not so") == pytest.approx(10 / 11)


def test_an_impossible_measurement_says_so_and_keeps_the_belief() -> None:
    belief = DiscreteBayesFilter(STATES, np.eye(3), [0.5, 0.5, 0.0])
    assert belief.update([0.0, 0.0, 1.0]) == -math.inf
    assert belief.update_log(np.full(3, -math.inf)) == -math.inf
    assert belief.belief.tolist() == [0.5, 0.5, 0.0]
    assert belief.log_belief.tolist() == [math.log(0.5), math.log(0.5), -math.inf]


@settings(max_examples=100, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    size=st.integers(1, 8),
    logs=st.lists(st.floats(-1e4, 1e4), min_size=8, max_size=8),
)
def test_it_stays_a_distribution(seed: int, size: int, logs: list[float]) -> None:
    rng = np.random.default_rng(seed)
    belief = DiscreteBayesFilter(range(size), triplets(stochastic(rng, size, 0.5)))
    for _ in range(3):
        belief.predict()
        assert math.isfinite(belief.update_log(logs[:size]))
        assert (belief.belief >= 0.0).all()
        assert belief.belief.sum() == pytest.approx(1.0, abs=1e-12)


def test_continuous_time_does_not_depend_on_how_it_is_cut() -> None:
    rates = np.random.default_rng(1).random((4, 4))
    once = DiscreteBayesFilter(range(4), np.eye(4), [1, 0, 0, 0])
    often = DiscreteBayesFilter(range(4), np.eye(4), [1, 0, 0, 0])
    once.propagate(transition_over(rates, 1.0))
    for _ in range(10):
        often.propagate(transition_over(rates, 0.1))
    np.testing.assert_allclose(often.belief, once.belief, rtol=1e-12)
    once.propagate(transition_over(np.zeros((4, 4)), 5.0))
    np.testing.assert_allclose(often.belief, once.belief, rtol=1e-12)


def test_whatever_predicts_is_a_transition() -> None:
    class Rotation:
        size = 3

        def predict(self, belief: np.ndarray) -> np.ndarray:
            return np.roll(belief, 1)

    belief = DiscreteBayesFilter(STATES, Rotation(), [1.0, 0.0, 0.0])
    belief.predict()
    assert belief.most_likely == "b"


GOOD = np.eye(3)


@pytest.mark.parametrize(
    ("make", "what"),
    [
        (lambda: DiscreteBayesFilter((), np.eye(0)), "at least one state"),
        (lambda: DiscreteBayesFilter(("a", "a"), np.eye(2)), "all different"),
        (lambda: DiscreteBayesFilter(STATES, np.eye(2)), "2 states, 3 are needed"),
        (lambda: DiscreteBayesFilter(STATES, {"go": GOOD * 0.9}), "'go'.*state 0 must sum to one, got 0.9"),
        (lambda: DiscreteBayesFilter(STATES, GOOD, [1.0, 0.0]), "one number for each of 3"),
        (lambda: DiscreteBayesFilter(STATES, GOOD, [0.0, 0.0, 0.0]), "must be positive"),
        (lambda: DiscreteBayesFilter(STATES, GOOD, [1.0, -1.0, 1.0]), "not negative, got -1.0 at 1"),
    ],
)
def test_what_makes_no_sense_is_refused(make: Callable[[], object], what: str) -> None:
    with pytest.raises(ValueError, match=what):
        make()


@pytest.mark.parametrize(
    "harm",
    [
        lambda belief: belief.predict("fly"),
        lambda belief: belief.propagate(np.eye(2)),
        lambda belief: belief.update([1.0, math.nan, 1.0]),
        lambda belief: belief.update([1.0, -1.0, 1.0]),
        lambda belief: belief.update([1.0, math.inf, 1.0]),
        lambda belief: belief.update([1.0]),
        lambda belief: belief.update_log([0.0, math.nan, 0.0]),
        lambda belief: belief.update_log([0.0, math.inf, 0.0]),
        lambda belief: belief.update_log([0.0]),
        lambda belief: belief.reset([0.0, 0.0, 0.0]),
        lambda belief: belief.probability("d"),
    ],
)
def test_bad_input_harms_nothing(harm: Callable[[DiscreteBayesFilter[str]], object]) -> None:
    belief = DiscreteBayesFilter(STATES, GOOD, [0.2, 0.3, 0.5])
    before = belief.log_belief
    with pytest.raises(ValueError, match=r"\w"):
        harm(belief)
    np.testing.assert_array_equal(belief.log_belief, before)
