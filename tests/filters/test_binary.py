"""The binary Bayes filter against Bayes' rule with probabilities, in exact fractions."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from filters.binary import CERTAINTY, BinaryBayesFilter, log_odds, probability
from filters.discrete import DiscreteBayesFilter

INSIDE = st.floats(1e-6, 1.0 - 1e-6)


@settings(max_examples=100, deadline=None)
@given(prior=INSIDE, claims=st.lists(INSIDE, min_size=1, max_size=8))
def test_table_4_2_equals_bayes_rule_in_fractions(prior: float, claims: list[float]) -> None:
    """Equation 4.19, multiplied out without rounding."""
    belief = BinaryBayesFilter(prior)
    odds = Fraction(prior) / (1 - Fraction(prior))
    start = odds
    for claim in claims:
        belief.update(claim)
        odds *= Fraction(claim) / (1 - Fraction(claim)) / start
    assert float(belief.log_odds) == pytest.approx(
        math.log(odds.numerator) - math.log(odds.denominator), abs=1e-9
    )
    assert float(belief.belief) == pytest.approx(float(odds / (1 + odds)), rel=1e-9)


@settings(max_examples=100, deadline=None)
@given(prior=INSIDE, pairs=st.lists(st.tuples(INSIDE, INSIDE), min_size=1, max_size=8))
def test_the_forward_form_equals_the_discrete_filter(prior: float, pairs: list[tuple[float, float]]) -> None:
    belief = BinaryBayesFilter(prior)
    other = DiscreteBayesFilter((True, False), np.eye(2), [prior, 1.0 - prior])
    for true, false in pairs:
        belief.update_forward(true, false)
        other.update([true, false])
    assert float(belief.belief) == pytest.approx(other.probability(True), rel=1e-9)


@settings(max_examples=100, deadline=None)
@given(prior=INSIDE, chances=st.lists(st.tuples(INSIDE, INSIDE, INSIDE), min_size=1, max_size=6))
def test_a_state_that_changes_equals_the_discrete_filter(
    prior: float, chances: list[tuple[float, float, float]]
) -> None:
    belief = BinaryBayesFilter(prior)
    other = DiscreteBayesFilter((True, False), np.eye(2), [prior, 1.0 - prior])
    for failing, mending, likelihood in chances:
        belief.predict(failing, mending)
        belief.update_forward(likelihood, 0.5)
        other.propagate([[1.0 - failing, failing], [mending, 1.0 - mending]])
        other.update([likelihood, 0.5])
    assert float(belief.belief) == pytest.approx(other.probability(True), rel=1e-9)


@pytest.mark.parametrize("odds", [-800.0, -40.0, -1.0, 0.0, 1e-9, 3.0, 36.0, 800.0])
def test_probabilities_of_any_log_odds(odds: float) -> None:
    """Equations 4.13 and 4.14 are each other's inverse as far as a float can say so."""
    p = float(probability(odds))
    assert p == pytest.approx(1.0 / (1.0 + math.exp(-odds)) if odds > -700.0 else 0.0, rel=1e-14, abs=1e-300)
    if -700.0 < odds < 3.5:
        assert float(log_odds(p)) == pytest.approx(odds, rel=1e-13, abs=1e-15)
    assert float(probability(-odds)) + p == pytest.approx(1.0, abs=1e-15)


def test_log_odds_at_certainty() -> None:
    assert log_odds([0.0, 0.5, 1.0]).tolist() == [-math.inf, 0.0, math.inf]


def test_certainty_is_bounded_and_taken_back_exactly() -> None:
    belief = BinaryBayesFilter()
    belief.update(1.0)
    assert float(belief.log_odds) == CERTAINTY
    assert 1.0 - 1e-15 < float(belief.belief) < 1.0
    belief.update(0.0)
    assert float(belief.log_odds) == 0.0
    belief.update_forward(1.0, 0.0)
    belief.update_forward(0.0, 1.0)
    assert float(belief.log_odds) == 0.0
    for _ in range(10_000):
        belief.update(1.0)
    assert float(belief.belief) == 1.0
    for _ in range(10_000):
        belief.update(0.0)
    assert float(belief.belief) == 0.5


def test_a_limit_lets_a_state_that_did_change_be_noticed() -> None:
    belief = BinaryBayesFilter(limit=3.0)
    for _ in range(1000):
        belief.update(0.9)
    assert float(belief.log_odds) == 3.0
    belief.update(0.1)
    belief.update(0.1)
    assert float(belief.belief) < 0.5
    for _ in range(1000):
        belief.update(0.0)
    assert float(belief.log_odds) == -3.0


def test_the_order_does_not_matter_and_the_prior_says_nothing() -> None:
    claims = np.random.default_rng(1).uniform(0.01, 0.99, 50)
    one, other = BinaryBayesFilter(0.3), BinaryBayesFilter(0.3)
    for claim in claims:
        one.update(claim)
        one.update(0.3)
    for claim in claims[::-1]:
        other.update(claim)
    np.testing.assert_allclose(one.log_odds, other.log_odds, rtol=1e-12)


def test_many_states_at_once_are_each_for_itself() -> None:
    rng = np.random.default_rng(2)
    prior, first, second = rng.uniform(0.1, 0.9, (3, 4, 5))
    together = BinaryBayesFilter(prior)
    together.update(first)
    together.update_forward(second, 0.5)
    together.predict(0.1, second)
    for place in np.ndindex(4, 5):
        alone = BinaryBayesFilter(prior[place])
        alone.update(first[place])
        alone.update_forward(second[place], 0.5)
        alone.predict(0.1, second[place])
        assert float(together.log_odds[place]) == pytest.approx(float(alone.log_odds), abs=1e-14)


def test_some_of_the_states() -> None:
    belief = BinaryBayesFilter(0.2, shape=(4,))
    belief.update([0.5, 0.5, 0.9], cells=[1, 1, 3])
    step = -float(log_odds(0.2))
    expected = [-step, step, -step, float(log_odds(0.9))]
    np.testing.assert_allclose(belief.log_odds, expected, atol=1e-14)
    belief.update_forward(3.0, 1.0, cells=np.array([True, False, False, False]))
    assert float(belief.log_odds[0]) == pytest.approx(-step + math.log(3.0))
    with pytest.raises(IndexError):
        belief.update(0.5, cells=[0, 7])
    assert float(belief.log_odds[0]) == pytest.approx(-step + math.log(3.0))


def test_chances_of_change_at_their_ends() -> None:
    belief = BinaryBayesFilter(0.9, shape=(3,))
    belief.predict([0.0, 1.0, 1.0], [0.0, 1.0, 0.0])
    np.testing.assert_allclose(belief.belief, [0.9, 0.1, 0.0], atol=1e-15)
    assert np.isneginf(belief.log_odds[2])


@pytest.mark.parametrize(
    ("make", "what"),
    [
        (lambda: BinaryBayesFilter(0.0), "prior"),
        (lambda: BinaryBayesFilter([0.5, math.nan]), "prior"),
        (lambda: BinaryBayesFilter(0.5, limit=0.0), "limit"),
        (lambda: BinaryBayesFilter(0.99, limit=1.0), "within the limit"),
        (lambda: BinaryBayesFilter([0.5, 0.5], shape=(3,)), r"shape \(2,\)"),
    ],
)
def test_a_filter_that_makes_no_sense(make: Callable[[], object], what: str) -> None:
    with pytest.raises(ValueError, match=what):
        make()


@pytest.mark.parametrize(
    ("harm", "what"),
    [
        (lambda belief: belief.update(1.1), "got 1.1"),
        (lambda belief: belief.update([0.5, math.nan]), "got nan"),
        (lambda belief: belief.update_forward(-1.0, 1.0), "got -1.0"),
        (lambda belief: belief.update_forward(1.0, math.inf), "got inf"),
        (lambda belief: belief.update_forward(0.0, 0.0), "both zero"),
        (lambda belief: belief.add([0.0, math.inf]), "got inf"),
        (lambda belief: belief.predict(0.1, [0.1, -0.1]), "got -0.1"),
        (lambda belief: belief.predict(math.nan, 0.1), "got nan"),
    ],
)
def test_bad_input_harms_nothing(harm: Callable[[BinaryBayesFilter], None], what: str) -> None:
    belief = BinaryBayesFilter([0.3, 0.6])
    with pytest.raises(ValueError, match=what):
        harm(belief)
    np.testing.assert_array_equal(belief.log_odds, log_odds([0.3, 0.6]))
