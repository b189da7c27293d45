"""The lecture's robot and its wheel: coverage in closed form, chi-square against the multinomial."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from filters.textbook import landmarks, wheel


def test_the_robot_is_found_by_ranges_only() -> None:
    """After the second measurement within 4 m, four of its standard errors; at the start it is anywhere."""
    stages = landmarks.localize(10_000)
    assert [stage.name.split()[-1] for stage in stages] == [
        "anywhere",
        *("moved", "weighted", "resampled") * 2,
    ]
    errors = [float(np.hypot(*(stage.estimate - stage.truth[:2]))) for stage in stages]
    assert errors[0] > 20.0
    assert errors[-1] < 8.0


def test_without_the_2_the_regions_hold_what_the_closed_form_says() -> None:
    """300 runs: four standard errors are 0.1 at most, and the start's 10 m make both a little better."""
    found = landmarks.coverage(300, 4_000)
    np.testing.assert_allclose(found.right, found.claims, atol=0.1)
    np.testing.assert_allclose(found.forgetful, found.theory, atol=0.12)
    assert found.covariance_ratio == pytest.approx(0.5, abs=0.05)
    assert found.theory[4] == pytest.approx(1.0 - np.sqrt(0.05))


def literal(weights: list[float], start: int, turns: list[float]) -> list[int]:
    """Return what the lecture's listing chooses, line by line."""
    index, beta, chosen = start, 0.0, list[int]()
    for turn in turns:
        beta += turn
        while beta > weights[index]:
            beta -= weights[index]
            index = (index + 1) % len(weights)
        chosen.append(index)
    return chosen


def test_the_wheel_is_the_lectures() -> None:
    weights = [0.1, 0.45, 0.05, 0.4]
    ends = np.cumsum(weights)
    generator = np.random.default_rng(3)
    for _ in range(200):
        start = int(generator.integers(4))
        turns = generator.uniform(0.0, 0.9, 6)
        first = np.array([[ends[start] - weights[start]]])
        found = wheel.resting(ends, first, turns[None, :])
        assert found[0].tolist() == literal(weights, start, turns.tolist())


def test_expected_outcomes_are_scipys() -> None:
    found = wheel.compare("independent draws", batches=100)
    assert found.expected.sum() == pytest.approx(100.0)
    assert found.expected.max() == pytest.approx(
        100.0 * stats.multinomial.pmf([2, 1, 1, 0], 4, wheel.WEIGHTS)
    )
    assert found.probability == pytest.approx(stats.chi2.sf(found.chi_square, found.degrees), abs=1e-9)


@pytest.mark.parametrize("name", ["independent draws", "wheel of whole turns"])
def test_a_wheel_of_whole_turns_is_multinomial(name: str) -> None:
    """False alarm 1e-4 by chi-square of every outcome."""
    found = wheel.compare(name, batches=20_000)
    assert found.probability > 1e-4
    np.testing.assert_allclose(found.variance_ratio, 1.0, atol=0.06)


def test_the_lectures_wheel_is_not() -> None:
    found = wheel.compare("wheel of the lecture", batches=20_000)
    assert found.probability < 1e-12
    assert (found.variance_ratio < 0.95).all()


def test_but_it_is_where_twice_the_largest_weight_is_one_turn() -> None:
    """False alarm 1e-4; elsewhere the distance is plain."""
    at_one, beside = wheel.sweep("wheel of the lecture", [0.5, 0.4], batches=20_000)
    degrees = 34
    assert stats.chi2.sf(at_one * degrees, degrees) > 1e-4
    assert beside > 10.0
