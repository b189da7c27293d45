"""The scorer on tracks whose figures are known in closed form."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from service.mixture import Mixture
from service.score import Track, Truth, compare, levels, read_truth, score


def still_truth() -> Truth:
    return Truth(np.array([0.0, 100.0]), np.zeros(2), np.zeros(2))


def track_of(north: np.ndarray, east: np.ndarray, variance: float = 1.0) -> Track:
    n = len(north)
    covariance = np.tile([variance, 0.0, variance], (n, 1))
    return Track(np.linspace(1.0, 99.0, n), north, east, covariance)


def test_constant_offset() -> None:
    figures = score(track_of(np.full(50, 3.0), np.full(50, 4.0), 4.0), still_truth())
    assert figures.rmse_m == pytest.approx(5.0)
    assert figures.p95_m == pytest.approx(5.0)
    assert figures.final_m == pytest.approx(5.0)
    assert figures.nees_mean == pytest.approx(25.0 / 4.0)
    assert figures.coverage_95 == 0.0


def test_gaussian_errors_are_covered_as_claimed() -> None:
    """20,000 draws: coverage within four standard errors of 95 % (false alarm 6e-5), NEES within 4 of 2."""
    random = np.random.default_rng(3)
    count = 20_000
    errors = random.multivariate_normal((0, 0), [[4.0, 1.2], [1.2, 0.5]], count)
    covariance = np.tile([4.0, 1.2, 0.5], (count, 1))
    figures = score(Track(np.linspace(1, 99, count), errors[:, 0], errors[:, 1], covariance), still_truth())
    assert figures.coverage_95 == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / count))
    assert figures.nees_mean == pytest.approx(2.0, abs=4 * 2 / np.sqrt(count))
    assert figures.coverage_50 == pytest.approx(0.5, abs=4 * np.sqrt(0.25 / count))
    assert figures.coverage_99 == pytest.approx(0.99, abs=4 * np.sqrt(0.99 * 0.01 / count))
    assert figures.nees_low is not None
    assert figures.nees_high is not None
    assert figures.nees_low < 2.0 < figures.nees_high
    entropy = -np.log(2 * np.pi * np.e * np.sqrt(4.0 * 0.5 - 1.2**2))
    assert figures.log_score == pytest.approx(entropy, abs=4 / np.sqrt(count))


def test_the_levels_of_gaussian_errors_are_uniform() -> None:
    """20,000 draws in 100 bins: chi-square of the counts below its 1 - 1e-4 quantile."""
    random = np.random.default_rng(4)
    count = 20_000
    errors = random.multivariate_normal((0, 0), [[4.0, 1.2], [1.2, 0.5]], count)
    track = Track(np.linspace(1, 99, count), errors[:, 0], errors[:, 1], np.tile([4.0, 1.2, 0.5], (count, 1)))
    counts = np.array(levels(compare(track, still_truth())))
    assert counts.sum() == count
    assert np.sum((counts - 200.0) ** 2 / 200.0) < stats.chi2(99).ppf(1 - 1e-4)


def test_a_row_of_several_hypotheses_is_scored_as_the_mixture() -> None:
    """The truth lies in the lesser of two hypotheses 40 m apart, which the Gaussian of the leader does not know."""
    mixture = Mixture(
        np.array([0.6, 0.4]),
        np.array([[0.0, 40.0], [0.0, 0.0]]),
        np.array([[1.0, 0.0, 1.0], [1.0, 0.0, 1.0]]),
    )
    track = track_of(np.zeros(3), np.full(3, 40.0))
    compared = compare(replace(track, mixtures={1: mixture}), still_truth())
    assert compared.log_score[1] == pytest.approx(np.log(0.4 / (2 * np.pi)), abs=1e-9)
    assert compared.log_score[0] == pytest.approx(-np.log(2 * np.pi) - 800.0)
    assert compared.level[0] == 1.0
    assert compared.level[1] < 0.7


def test_truth_is_interpolated_and_nothing_is_scored_outside_of_it() -> None:
    truth = Truth(np.array([10.0, 20.0]), np.array([0.0, 10.0]), np.zeros(2))
    times = np.array([5.0, 12.0, 18.0, 25.0])
    track = Track(times, np.array([99.0, 2.0, 8.5, 99.0]), np.zeros(4), np.tile([1.0, 0.0, 1.0], (4, 1)))
    assert score(track, truth).max_m == pytest.approx(0.5)


def test_nothing_to_compare_gives_no_figures() -> None:
    figures = score(track_of(np.zeros(0), np.zeros(0)), still_truth())
    assert figures.rmse_m is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time_s,north_m\n1,2\n", "missing: east_m"),
        ("time_s,north_m,east_m\n1,2,3\n1,x,3\n", "line 3"),
        ("time_s,north_m,east_m\n1,2,3\n2,2,nan\n", "line 3"),
        ("time_s,north_m,east_m\n1,2,3\n", "at least two rows"),
        ("time_s,north_m,east_m\n2,2,3\n1,2,3\n", "backwards"),
    ],
)
def test_a_wrong_truth_file_says_where(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "truth.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=words):
        read_truth(path)
