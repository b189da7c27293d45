"""The scorer on tracks whose figures are known in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from service.score import Track, Truth, read_truth, score


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
