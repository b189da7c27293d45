"""The bias of few particles: enumeration, simulation, closed forms and Bayes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from filters.textbook.bias import Step, expected, posterior, simulated

STAY = np.eye(2)
MOVE = np.array([[0.7, 0.2, 0.1], [0.1, 0.6, 0.3], [0.3, 0.3, 0.4]])
START = [0.5, 0.3, 0.2]
STEPS = [
    Step(MOVE, np.array([0.9, 0.1, 0.3])),
    Step(MOVE.T / MOVE.T.sum(1, keepdims=True), np.array([0.2, 0.5, 0.05])),
]


def test_one_particle_ignores_every_measurement() -> None:
    """Equation 4.38: what is left is the prediction p(x_t | u_1..t)."""
    predicted = np.array(START) @ STEPS[0].transition @ STEPS[1].transition
    np.testing.assert_allclose(expected(START, STEPS, 1), predicted, rtol=0, atol=1e-15)


@given(st.floats(0.01, 0.99), st.floats(0.01, 1.0), st.floats(0.01, 1.0))
@settings(max_examples=50, deadline=None)
def test_two_particles_in_two_states(p: float, a: float, b: float) -> None:
    """Exercise 3 in closed form."""
    share = expected([p, 1 - p], [Step(STAY, np.array([a, b]))], 2)[0]
    assert share == pytest.approx(p * p + 2 * p * (1 - p) * a / (a + b), abs=1e-14)


def test_a_bias_of_more_than_a_third() -> None:
    """Half and half, likelihoods 1 and 0: Bayes is certain, two particles err with probability 1/4, one with 1/2."""
    step = [Step(STAY, np.array([1.0, 0.0]))]
    assert posterior([0.5, 0.5], step)[0] == 1.0
    assert expected([0.5, 0.5], step, 2)[0] == pytest.approx(0.75, abs=1e-15)
    assert expected([0.5, 0.5], step, 1)[0] == pytest.approx(0.5, abs=1e-15)


@pytest.mark.parametrize("particles", [1, 2, 3, 5])
def test_simulation_agrees_with_enumeration(particles: int) -> None:
    """8,000 runs; each share within 5 standard deviations of a mean over runs (at most 0.5 / √runs): 12 tests, 7e-6."""
    runs = 8000
    exact = expected(START, STEPS, particles)
    seen = simulated(START, STEPS, particles, runs, seed=particles)
    assert exact.sum() == pytest.approx(1.0, abs=1e-12)
    assert np.abs(seen - exact).max() < 5 * 0.5 / math.sqrt(runs)


def test_the_bias_falls_as_one_over_the_particles() -> None:
    """Times M it tends to the second-order expansion of a ratio of means; what is left halves as M doubles."""
    p, w = np.array([0.4, 0.6]), np.array([0.9, 0.3])
    step = [Step(STAY, w)]
    limit = (p * w / (p @ w) * (p @ w**2) - p * w**2) / (p @ w) ** 2
    six, twelve = (m * (expected(p, step, m) - posterior(p, step)) - limit for m in (6, 12))
    assert np.abs(twelve).max() < 0.06 * np.abs(limit).max()
    np.testing.assert_allclose(six / twelve, 2.0, rtol=0.1)


def test_many_particles_are_bayes() -> None:
    """400 particles: within 5 standard deviations of 300 runs."""
    seen = simulated(START, STEPS[:1], 400, 300, seed=1)
    assert np.abs(seen - posterior(START, STEPS[:1])).max() < 5 * 0.5 / math.sqrt(400 * 300 / 2)


def test_weights_that_are_all_zero_leave_the_particles() -> None:
    """Only the first state can be: with both particles in the other the set is kept, as ParticleFilter keeps it."""
    step = [Step(STAY, np.array([1.0, 0.0]))]
    assert expected([0.0, 1.0], step, 2).tolist() == [0.0, 1.0]
    assert simulated([0.0, 1.0], step, 2, 10, seed=1).tolist() == [0.0, 1.0]


def test_bayes_is_table_4_1() -> None:
    belief = np.array(START)
    for step in STEPS:
        after = [
            sum(belief[i] * step.transition[i, j] for i in range(3)) * step.likelihood[j] for j in range(3)
        ]
        belief = np.array(after) / sum(after)
    np.testing.assert_allclose(posterior(START, STEPS), belief, rtol=1e-14)


@pytest.mark.parametrize(
    ("prior", "step", "what"),
    [
        ([0.5, 0.6], Step(STAY, np.ones(2)), "prior"),
        ([[1.0]], Step(STAY, np.ones(2)), "prior"),
        ([0.5, 0.5], Step(np.ones((2, 2)), np.ones(2)), "step 1: transition"),
        ([0.5, 0.5], Step(np.eye(3), np.ones(2)), "step 1: transition"),
        ([0.5, 0.5], Step(STAY, np.array([1.0, -1.0])), "step 1: likelihood"),
        ([0.5, 0.5], Step(STAY, np.array([1.0, math.nan])), "step 1: likelihood"),
    ],
)
def test_what_is_no_probability_is_refused(prior: Any, step: Step, what: str) -> None:
    for compute in (posterior, lambda p, s: expected(p, s, 2), lambda p, s: simulated(p, s, 2, 2, 1)):
        with pytest.raises(ValueError, match=what):
            compute(prior, [step])


def test_too_many_joint_states_are_refused() -> None:
    for particles in (0, 18):
        with pytest.raises(ValueError, match="enumerated"):
            expected([0.5, 0.5], [], particles)
    assert expected([0.5, 0.5], [], 16).tolist() == [0.5, 0.5]
    for particles, runs in ((0, 1), (1, 0)):
        with pytest.raises(ValueError, match="at least one"):
            simulated([0.5, 0.5], [], particles, runs, 1)
