"""Moments of each label's particles, against numpy on the particles of one label at a time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import norm

from filters.belief import STILL, Displacement
from filters.labelled_moments import Hypothesis, LabelledMoments

Array = NDArray[np.float64]
Column = NDArray[np.float32]


def particles(seed: int, count: int) -> tuple[Column, Column, NDArray[np.int32]]:
    """Three labels far apart, one of them with its heading about the seam of the circle; a fourth column beside."""
    random = np.random.default_rng(seed)
    labels = random.integers(0, 3, count).astype(np.int32)
    middles = np.array([[0.0, 10.0, 1.0, 2.0], [500.0, -3.0, 3.1, -1.0], [-40.0, 900.0, -0.5, 0.0]])
    sigmas = np.array([[1.0, 2.0, 0.2, 0.5], [0.3, 0.1, 0.3, 0.1], [30.0, 5.0, 0.05, 3.0]])
    rows = middles[labels] + sigmas[labels] * random.normal(size=(count, 4))
    rows[:, 0] += 0.5 * (rows[:, 2] - middles[labels, 2])
    rows[:, 2] = (rows[:, 2] + math.pi) % (2.0 * math.pi) - math.pi
    weights = random.exponential(size=count).astype(np.float32)
    return np.ascontiguousarray(rows.T.astype(np.float32)), weights, labels


def expected(columns: Column, weights: Column, by: Displacement) -> tuple[Array, Array, float]:
    """Mean, covariance of the pose, and variances of displaced particles, in double precision."""
    n, e, h, other = columns.astype(np.float64)
    w = weights.astype(np.float64)
    w /= w.sum()
    north = n + by.forward * np.cos(h) - by.right * np.sin(h)
    east = e + by.forward * np.sin(h) + by.right * np.cos(h)
    heading = h + by.turn
    mean_heading = math.atan2(w @ np.sin(heading), w @ np.cos(heading))
    away = np.remainder(heading - mean_heading + math.pi, 2.0 * math.pi) - math.pi
    mean = np.array([w @ north, w @ east, mean_heading, w @ other])
    offsets = np.stack([north - mean[0], east - mean[1], away])
    # of the differences of headings it is the second moment: their mean is not quite zero
    covariance = (w * offsets) @ offsets.T
    return mean, covariance, float(w @ (other - mean[3]) ** 2)


@pytest.mark.parametrize("by", [STILL, Displacement(1.3, -0.4, 0.7)])
@pytest.mark.parametrize("count", [50, 30_000])
def test_each_label_has_the_moments_of_its_own_particles(by: Displacement, count: int) -> None:
    columns, weights, labels = particles(count, count)
    moments = LabelledMoments(4, 8)
    found = moments.of(columns, weights, labels, count, by, {0: 7, 2: 9, 1: 8, 5: 3})
    assert sorted(found) == [0, 1, 2], "the label 5 has no particles"
    assert [found[label].name for label in (0, 1, 2)] == [7, 8, 9]
    for label, hypothesis in found.items():
        mine = labels == label
        mean, covariance, beside = expected(columns[:, mine], weights[mine], by)
        sigma = np.sqrt([*np.diag(covariance), beside])
        away = hypothesis.mean - mean
        away[2] = math.remainder(away[2], 2.0 * math.pi)
        assert np.all(np.abs(away) < 2e-3 * sigma)
        scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
        np.testing.assert_allclose(hypothesis.covariance / scale, covariance / scale, atol=5e-3)
        assert hypothesis.variance[3] == pytest.approx(beside, rel=5e-3)
        assert hypothesis.weight == pytest.approx(weights[mine].sum() / weights.sum(), rel=1e-5)


def test_weights_are_shares_of_the_whole_whoever_is_asked() -> None:
    columns, weights, labels = particles(3, 1_000)
    found = LabelledMoments(4, 8).of(columns, weights, labels, 1_000, STILL, {1: 1})
    assert found[1].weight == pytest.approx(weights[labels == 1].sum() / weights.sum(), rel=1e-6)


def test_a_label_may_inherit_where_to_look() -> None:
    """The same figures, found at once: a heading wraps on the far side of the mean that was inherited."""
    columns, weights, labels = particles(4, 2_000)
    moments = LabelledMoments(4, 8)
    before = moments.of(columns, weights, labels, 2_000, STILL, {1: 1})[1]
    labels[labels == 1] = 6
    moments.inherit(1, 6)
    after = moments.of(columns, weights, labels, 2_000, STILL, {6: 1})[6]
    np.testing.assert_allclose(after.mean, before.mean, rtol=1e-6)
    np.testing.assert_allclose(after.covariance, before.covariance, rtol=1e-3, atol=1e-6)


def gaussian(north: float, east: float, heading: float, variances: tuple[float, float, float]) -> Hypothesis:
    covariance = np.diag(variances)
    return Hypothesis(1, 1.0, np.array([north, east, heading]), covariance, np.diag(covariance))


def test_the_distance_is_the_integral_of_the_root_of_both_densities() -> None:
    """Bhattacharyya: -log ∫ √(p q); here over north and east as sums over a fine grid, the headings being alike."""
    one, two = gaussian(0.0, 0.0, 0.3, (1.0, 0.5, 0.01)), gaussian(1.5, -0.7, 0.3, (0.6, 2.0, 0.01))
    axis = np.arange(-14.0, 14.0, 0.05)
    root: list[Array] = [
        np.sqrt(
            norm.pdf(axis, one.mean[i], np.sqrt(one.variance[i]))
            * norm.pdf(axis, two.mean[i], np.sqrt(two.variance[i]))
        )
        for i in range(2)
    ]
    overlap = float(root[0].sum() * root[1].sum()) * 0.05**2
    assert one.distance(two) == pytest.approx(-math.log(overlap), rel=1e-5)


def test_the_distance_goes_around_the_circle() -> None:
    variances = (1.0, 1.0, 0.04)
    across = gaussian(0.0, 0.0, math.pi - 0.1, variances).distance(
        gaussian(0.0, 0.0, 0.1 - math.pi, variances)
    )
    assert across == pytest.approx(0.2**2 / 0.04 / 8.0, rel=1e-6)
    alike = gaussian(5.0, 1.0, 0.0, variances)
    assert alike.distance(alike) == pytest.approx(0.0, abs=1e-12)
