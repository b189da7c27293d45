"""The Kalman filter against least squares over the whole history, and against filterpy."""

from __future__ import annotations

import math

import filterpy.kalman
import numpy as np
import pytest
from scipy import stats

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
    moved = rng.normal(size=(4000, 2)) @ np.linalg.cholesky(NOISE).T
    erred = rng.normal(size=(4000, 2)) @ np.linalg.cholesky(SPREAD).T
    for push, error in zip(moved, erred, strict=True):
        truth = TRANSITION @ truth + push
        z = MODEL @ truth + error
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
    ("mean", "covariance"),
    [
        ([0.0], [[1.0, 0.0], [0.0, 1.0]]),
        ([math.nan], [[1.0]]),
        ([0.0], [[math.inf]]),
        ([0.0], [[-1.0]]),
        ([0.0, 0.0], [[1.0, 0.5], [0.0, 1.0]]),
    ],
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


def test_the_evidence_is_the_density_of_the_measurement() -> None:
    """Of each innovation against scipy's Gaussian; their sum against the joint Gaussian of all measurements: 1e-9."""
    rng = np.random.default_rng(5)
    belief = KalmanFilter([0.5, -0.2], np.diag([2.0, 1.0]))
    mean, covariance = belief.mean.copy(), belief.covariance.copy()
    measured, total = rng.normal(size=(5, 2)), 0.0
    # the joint Gaussian of all states, hence of all measurements
    means, blocks = [mean], [[covariance]]
    for z in measured:
        belief.predict(TRANSITION, NOISE)
        correction = belief.correct(z, MODEL, SPREAD)
        gaussian = stats.multivariate_normal(np.zeros(2), correction.innovation_covariance)
        assert correction.log_evidence == pytest.approx(gaussian.logpdf(correction.innovation), abs=1e-9)
        total += correction.log_evidence
        crosses = [TRANSITION @ block for block in blocks[-1]]
        means.append(TRANSITION @ means[-1])
        blocks.append([*crosses, TRANSITION @ blocks[-1][-1] @ TRANSITION.T + NOISE])
    joint = np.block(
        [
            [blocks[max(i, j)][min(i, j)].T if i < j else blocks[i][j] for j in range(1, 6)]
            for i in range(1, 6)
        ]
    )
    every = np.kron(np.eye(5), MODEL)
    gaussian = stats.multivariate_normal(
        every @ np.concatenate(means[1:]), every @ joint @ every.T + np.kron(np.eye(5), SPREAD)
    )
    assert total == pytest.approx(gaussian.logpdf(measured.ravel()), abs=1e-9)


def test_an_angle_is_corrected_the_short_way_round() -> None:
    belief = KalmanFilter([3.1], [[1.0]], angles=(0,))
    correction = belief.correct([-3.1], [[1.0]], [[1.0]], angles=(0,))
    assert correction.innovation[0] == pytest.approx(2 * math.pi - 6.2)
    assert belief.mean[0] == pytest.approx(math.pi)
    belief.predict([[1.0]], [[0.0]], [[1.0]], [0.5])
    assert belief.mean[0] == pytest.approx(0.5 - math.pi, abs=0.1)
    assert KalmanFilter([7.0], [[1.0]], angles=(0,)).mean[0] == pytest.approx(7.0 - 2 * math.pi)


def test_a_gate_passes_what_is_right_as_often_as_it_says() -> None:
    """95 % of 4,000, within 4.9 standard deviations: false alarm 1e-6."""
    rng = np.random.default_rng(6)
    passed = 0
    for z in rng.normal(size=(4000, 2)) * math.sqrt(1.5):
        belief = KalmanFilter([0.0, 0.0], 0.5 * np.eye(2))
        correction = belief.correct(z, np.eye(2), np.eye(2), gate=0.95)
        passed += correction.accepted
        assert correction.accepted != (belief.mean.tolist() == [0.0, 0.0])
    assert abs(passed - 3800) < 4.9 * math.sqrt(4000 * 0.95 * 0.05)


@pytest.mark.parametrize(
    "arguments",
    [
        ([[1.0, 0.0]], [[1.0]], None, None),
        ([[1.0]], [[1.0, 0.0], [0.0, 1.0]], None, None),
        ([[1.0]], [[1.0]], [[1.0, 2.0]], [1.0]),
        ([[1.0]], [[1.0]], [[1.0]], None),
        ([[1.0]], [[1.0]], None, [1.0]),
    ],
)
def test_a_prediction_that_does_not_fit_is_refused(arguments: tuple[object, ...]) -> None:
    belief = KalmanFilter([1.0], [[2.0]])
    with pytest.raises(ValueError, match="Kalman prediction"):
        belief.predict(*arguments)  # type: ignore[arg-type]
    assert belief.mean.tolist() == [1.0]
    assert belief.covariance.tolist() == [[2.0]]


@pytest.mark.parametrize(
    ("arguments", "angles"),
    [
        (([1.0], [[1.0, 0.0]], [[1.0]]), ()),
        (([1.0], [[1.0]], [[1.0, 0.0], [0.0, 1.0]]), ()),
        (([1.0], [[math.nan]], [[1.0]]), ()),
        (([1.0], [[1.0]], [[math.nan]]), ()),
        (([1.0], [[1.0]], [[1.0]]), (1,)),
    ],
)
def test_a_correction_that_does_not_fit_is_refused(
    arguments: tuple[list[float], list[list[float]], list[list[float]]], angles: tuple[int, ...]
) -> None:
    belief = KalmanFilter([1.0], [[2.0]])
    with pytest.raises(ValueError, match="Kalman correction"):
        belief.correct(*arguments, angles=angles)
    assert belief.mean.tolist() == [1.0]


def test_a_noise_that_is_not_positive_is_refused() -> None:
    belief = KalmanFilter([1.0], [[0.0]])
    with pytest.raises(np.linalg.LinAlgError):
        belief.correct([1.0], [[1.0]], [[0.0]])
    assert belief.mean.tolist() == [1.0]


def test_a_gate_counts_only_what_was_measured() -> None:
    """NIS 5 of one component: beyond 95 % of chi-square with one degree of freedom (3.8), not with three (7.8)."""
    belief = KalmanFilter([0.0, 0.0, 0.0], np.eye(3))
    told = belief.correct([math.nan, math.sqrt(10.0), math.nan], np.eye(3), np.eye(3), gate=0.95)
    assert told.nis == pytest.approx(5.0)
    assert not told.accepted
    assert belief.mean.tolist() == [0.0, 0.0, 0.0]
