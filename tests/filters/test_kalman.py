"""The Kalman filter against least squares over the whole history, and against filterpy."""

from __future__ import annotations

import math

import filterpy.kalman
import numpy as np
import pytest

from filters.kalman import KalmanFilter

TRANSITION = np.array([[1.0, 0.1], [0.0, 1.0]])
NOISE = np.array([[0.02, 0.01], [0.01, 0.05]])
GAIN = np.array([[0.005], [0.1]])
MODEL = np.array([[1.0, 0.0], [0.3, 1.0]])
SPREAD = np.array([[0.5, 0.1], [0.1, 0.8]])


def whiten(matrix: np.ndarray) -> np.ndarray:
    return np.linalg.inv(np.linalg.cholesky(matrix))


def test_it_equals_batch_least_squares() -> None:
    rng = np.random.default_rng(1)
    steps = 30
    controls = rng.normal(size=(steps, 1))
    measured = rng.normal(size=(steps, 2))
    measured[5, 1] = np.nan
    measured[6] = np.nan
    start, covariance = np.array([1.0, -1.0]), np.diag([2.0, 3.0])
    belief = KalmanFilter(start, covariance)
    rows: list[np.ndarray] = []
    right: list[np.ndarray] = []

    def add(blocks: dict[int, np.ndarray], value: np.ndarray, covariance: np.ndarray) -> None:
        row = np.zeros((value.size, 2 * (steps + 1)))
        for k, block in blocks.items():
            row[:, 2 * k : 2 * k + 2] = block
        root = whiten(covariance)
        rows.append(root @ row)
        right.append(root @ value)

    add({0: np.eye(2)}, start, covariance)
    for k in range(steps):
        belief.predict(TRANSITION, NOISE, GAIN, controls[k])
        belief.correct(measured[k], MODEL, SPREAD)
        add({k: -TRANSITION, k + 1: np.eye(2)}, GAIN @ controls[k], NOISE)
        seen = np.flatnonzero(~np.isnan(measured[k]))
        if seen.size:
            add({k + 1: MODEL[seen]}, measured[k][seen], SPREAD[np.ix_(seen, seen)])
    a, b = np.concatenate(rows), np.concatenate(right)
    information = a.T @ a
    np.testing.assert_allclose(belief.mean, np.linalg.solve(information, a.T @ b)[-2:], atol=1e-9)
    np.testing.assert_allclose(belief.covariance, np.linalg.inv(information)[-2:, -2:], atol=1e-9)


def test_it_equals_filterpy() -> None:
    other = filterpy.kalman.KalmanFilter(dim_x=2, dim_z=2)
    other.x, other.P = np.array([0.0, 1.0]), np.diag([4.0, 1.0])
    other.F, other.Q, other.H, other.R = TRANSITION, NOISE, MODEL, SPREAD
    belief = KalmanFilter(other.x, other.P)
    for z in np.random.default_rng(2).normal(size=(50, 2)):
        other.predict()
        other.update(z)
        belief.predict(TRANSITION, NOISE)
        correction = belief.correct(z, MODEL, SPREAD)
        np.testing.assert_allclose(correction.innovation, other.y)
        expected = other.y @ np.linalg.inv(other.S) @ other.y
        assert correction.nis == pytest.approx(expected)
    np.testing.assert_allclose(belief.mean, other.x)
    np.testing.assert_allclose(belief.covariance, other.P)


def test_nis_is_chi_square() -> None:
    """Mean over 4,000 corrections within 4.9 standard deviations of 2: false alarm 1e-6."""
    rng = np.random.default_rng(3)
    truth = np.zeros(2)
    belief = KalmanFilter(truth, np.zeros((2, 2)))
    nis = []
    for _ in range(4000):
        truth = TRANSITION @ truth + rng.multivariate_normal(np.zeros(2), NOISE)
        z = MODEL @ truth + rng.multivariate_normal(np.zeros(2), SPREAD)
        belief.predict(TRANSITION, NOISE)
        nis.append(belief.correct(z, MODEL, SPREAD).nis)
    assert abs(np.mean(nis) - 2.0) < 4.9 * math.sqrt(4.0 / 4000)


def test_nothing_measured_changes_nothing() -> None:
    belief = KalmanFilter([1.0], [[2.0]])
    correction = belief.correct([math.nan], [[1.0]], [[1.0]])
    assert correction.nis == 0.0
    assert belief.mean.tolist() == [1.0]
    assert belief.covariance.tolist() == [[2.0]]


def test_the_covariance_survives_ten_million_to_one() -> None:
    belief = KalmanFilter([0.0, 0.0], np.diag([1e7, 1e7]))
    for _ in range(1000):
        belief.predict(TRANSITION, NOISE * 1e-12)
        belief.correct([1.0], [[1.0, 0.0]], [[1e-7]])
    np.testing.assert_allclose(belief.covariance, belief.covariance.T, atol=1e-18)
    assert np.linalg.eigvalsh(belief.covariance).min() > 0.0


@pytest.mark.parametrize(
    ("mean", "covariance"), [([0.0], [[1.0, 0.0], [0.0, 1.0]]), ([math.nan], [[1.0]]), ([0.0], [[math.inf]])]
)
def test_a_belief_that_makes_no_sense_is_refused(mean: list[float], covariance: list[list[float]]) -> None:
    with pytest.raises(ValueError, match="Kalman filter"):
        KalmanFilter(mean, covariance)


def test_an_infinite_measurement_is_refused_and_harms_nothing() -> None:
    belief = KalmanFilter([1.0], [[2.0]])
    with pytest.raises(ValueError, match="finite"):
        belief.correct([math.inf], [[1.0]], [[1.0]])
    with pytest.raises(ValueError, match="finite"):
        belief.predict([[math.nan]], [[1.0]])
    assert belief.mean.tolist() == [1.0]
