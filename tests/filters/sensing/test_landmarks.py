"""Landmarks against sums over the map written with scipy's densities, particle by particle and landmark by landmark."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import special, stats

from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.particle_set import ParticleSet
from filters.sensing import Bearing, BearingMeasurement, RangeBearing, RangeBearingMeasurement
from filters.sensing.landmark import log_von_mises_peak

Array = NDArray[np.float64]
COUNT = 1500
MAP = np.array([(10.0, 5.0), (-4.0, 7.0), (-4.2, 7.1), (0.0, -12.0), (6.0, 6.0)])


def particles(seed: int) -> ParticleSet:
    rng = np.random.default_rng(seed)
    result = ParticleSet(("north", "east", "heading"), COUNT)
    result.count = COUNT
    result.columns[:] = (
        rng.normal(0, 4, COUNT),
        rng.normal(0, 4, COUNT),
        rng.uniform(-math.pi, math.pi, COUNT),
    )
    return result


def density(
    of: ParticleSet, landmark: Array, distance: float | None, bearing: float, sigmas: tuple[float, float]
) -> Array:
    """The likelihood of one landmark: normal by the distance, von Mises by the bearing, with numpy's arc tangent."""
    north, east, heading = of.columns[:3].astype(np.float64)
    away = np.hypot(landmark[0] - north, landmark[1] - east)
    direction = np.arctan2(landmark[1] - east, landmark[0] - north) - heading
    result = stats.vonmises.pdf(bearing, 1.0 / sigmas[1] ** 2, loc=direction)
    return result if distance is None else result * stats.norm.pdf(distance, away, sigmas[0])


def close(got: NDArray[np.floating[Any]], expected: Array, peak: float) -> None:
    deviations = np.sqrt(np.maximum(peak - expected, 0.0))
    assert (np.abs(got - expected) < 1e-4 + 3e-4 * deviations).all()


@pytest.mark.interpreted
@pytest.mark.parametrize("outliers", [0.05, 0.4])
@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("sigmas", [(0.3, 0.1), (1.0, 0.5)])
def test_a_landmarks_log_likelihood_is_the_sum_over_those_it_may_be(
    outliers: float, known: bool, sigmas: tuple[float, float]
) -> None:
    """A known landmark is a sum of one; without a name every one of the map counts equally."""
    of, sensor = particles(2), RangeBearing(*sigmas, outliers=outliers, span=40.0, landmarks=MAP)
    place = MAP[1] if known else (None, None)
    measured = RangeBearingMeasurement(8.0, 0.7 + 4 * math.pi, place[0], place[1])
    constant = sensor.weigh(of, 0, COUNT, measured)
    candidates = MAP[1:2] if known else MAP
    inlier = sum(density(of, one, 8.0, 0.7, sigmas) for one in candidates) / len(candidates)
    expected = np.log((1.0 - outliers) * inlier + outliers / (40.0 * 2.0 * math.pi))
    close(of.log_weights + constant, expected, constant)
    assert (of.log_weights < 2e-6).all()


@pytest.mark.interpreted
@pytest.mark.parametrize("known", [True, False])
def test_a_bearings_log_likelihood_is_the_sum_over_those_it_may_be(known: bool) -> None:
    of, sensor = particles(3), Bearing(0.2, outliers=0.1, landmarks=MAP)
    place = MAP[3] if known else (None, None)
    constant = sensor.weigh(of, 0, COUNT, BearingMeasurement(-2.0, place[0], place[1]))
    candidates = MAP[3:4] if known else MAP
    inlier = sum(density(of, one, None, -2.0, (1.0, 0.2)) for one in candidates) / len(candidates)
    close(of.log_weights + constant, np.log(0.9 * inlier + 0.1 / (2.0 * math.pi)), constant)


@pytest.mark.interpreted
@pytest.mark.parametrize("known", [True, False])
def test_a_sight_that_repeats_weighs_by_a_power_of_the_whole_mixture(known: bool) -> None:
    """Not by wider errors: what no landmark explains pulls nobody, however often it is seen."""
    of, share = particles(6), 0.2
    of.log_weights[:COUNT] = np.linspace(-1.0, 1.0, COUNT)
    before = of.log_weights[:COUNT].copy()
    sensor = RangeBearing(0.3, 0.1, outliers=0.2, span=15.0, landmarks=MAP)
    place = MAP[1] if known else (None, None)
    constant = sensor.weigh(of, 100, 1400, RangeBearingMeasurement(8.0, 0.7, place[0], place[1], share=share))
    candidates = MAP[1:2] if known else MAP
    inlier = sum(density(of, one, 8.0, 0.7, (0.3, 0.1)) for one in candidates) / len(candidates)
    expected = share * np.log(0.8 * inlier + 0.2 / (15.0 * 2.0 * math.pi))
    gained = of.log_weights - before
    close(gained[100:1400] + constant, expected[100:1400], constant)
    assert (gained[:100] == 0.0).all()
    assert (gained[1400:] == 0.0).all()


@pytest.mark.interpreted
def test_only_the_block_is_weighed() -> None:
    of, sensor = particles(4), RangeBearing(0.3, 0.1, landmarks=MAP)
    whole = particles(4)
    sensor.weigh(whole, 0, COUNT, RangeBearingMeasurement(8.0, 0.7))
    sensor.weigh(of, 100, 900, RangeBearingMeasurement(8.0, 0.7))
    outside = np.r_[0:100, 900:COUNT]
    assert (of.log_weights[outside] == 0.0).all()
    np.testing.assert_allclose(of.log_weights[100:900], whole.log_weights[100:900], atol=1e-6)


def test_far_from_every_landmark_the_loss_is_bounded_with_and_without_an_outlier_part() -> None:
    for outliers, least in ((0.05, math.log(0.05 / (50.0 * 2.0 * math.pi))), (0.0, -80.0)):
        of, sensor = particles(5), RangeBearing(0.3, 0.1, outliers=outliers, landmarks=MAP)
        of.columns[:2] += 5e5
        constant = sensor.weigh(of, 0, COUNT, RangeBearingMeasurement(8.0, 0.7))
        assert np.isfinite(of.log_weights).all()
        assert (of.log_weights + constant > least - 1e-3).all()


@pytest.mark.parametrize("sigma", [0.001, 0.01, 0.1, 0.1414, 0.1415, 0.3, 1.0, 3.0])
def test_the_peak_of_von_mises_is_scipys(sigma: float) -> None:
    """Either side of where the Bessel function gives way to its series, to 1e-6."""
    concentration = 1.0 / sigma**2
    expected = -math.log(2.0 * math.pi * special.i0e(concentration))
    assert log_von_mises_peak(sigma) == pytest.approx(expected, abs=1e-6)


def test_the_innovation_is_that_of_the_likeliest_landmark() -> None:
    centre = {"north": 1.0, "east": 2.0, "heading": 0.5}
    direction = math.atan2(7.0 - 2.0, -4.0 - 1.0) - 0.5
    away = math.hypot(5.0, 5.0)
    sensor = RangeBearing(0.3, 0.1, landmarks=MAP[:2])
    assert sensor.innovation(centre, RangeBearingMeasurement(away + 0.2, direction + 6.28)) == pytest.approx(
        0.2
    )
    named = RangeBearingMeasurement(away, direction, 10.0, 5.0)
    assert sensor.innovation(centre, named) == pytest.approx(away - math.hypot(9.0, 3.0))
    turned = BearingMeasurement(direction + 0.05 - 2.0 * math.pi)
    assert Bearing(0.1, landmarks=MAP[:2]).innovation(centre, turned) == pytest.approx(0.05)


def test_what_cannot_be_used_is_refused_with_a_reason() -> None:
    sensor = RangeBearing(0.3, 0.1)
    assert "map" in str(sensor.refusal(RangeBearingMeasurement(8.0, 0.7)))
    assert "map" in str(Bearing(0.1).refusal(BearingMeasurement(0.7)))
    assert "distance" in str(sensor.refusal(RangeBearingMeasurement(0.0, 0.7, 1.0, 2.0)))
    assert "sigma" in str(sensor.refusal(RangeBearingMeasurement(8.0, 0.7, 1.0, 2.0, 0.1, -0.1)))
    assert "sigma" in str(Bearing(0.1).refusal(BearingMeasurement(0.7, 1.0, 2.0, 0.0)))
    assert "share" in str(sensor.refusal(RangeBearingMeasurement(8.0, 0.7, 1.0, 2.0, share=0.0)))
    assert "share" in str(Bearing(0.1).refusal(BearingMeasurement(0.7, 1.0, 2.0, share=1.1)))
    assert sensor.refusal(RangeBearingMeasurement(8.0, 0.7, 1.0, 2.0)) is None
    with pytest.raises(ValueError, match="landmarks"):
        RangeBearing(0.3, 0.1, landmarks=[(1.0, math.nan)])
    with pytest.raises(ValueError, match="landmarks"):
        Bearing(0.1, landmarks=[1.0, 2.0])
    for wrong in (0.0, -1.0, math.inf):
        with pytest.raises(ValueError, match="range_bearing"):
            RangeBearing(0.3, wrong)
        with pytest.raises(ValueError, match="range_bearing"):
            RangeBearing(wrong, 0.1)


@pytest.mark.parametrize("named", [True, False])
def test_a_filter_finds_its_place_among_landmarks(named: bool) -> None:
    """From 3 m and any heading to 0.2 m and 0.1 rad after 40 sights of five landmarks, with names and without.

    The statistics allow 0.2 / sqrt(40 / 3) = 0.06 m and 0.03 rad; fixed seeds, and a limit three times that.
    """
    rng = np.random.default_rng(6)
    truth = np.array([1.0, -2.0, 0.7])
    belief = ParticleFilter(Unicycle(0.05, 0.02, 0.0, 0.0), capacity=8000, seed=2)
    start = {"north": rng.normal(0, 3, 8000), "east": rng.normal(0, 3, 8000)}
    start |= {"heading": rng.normal(0.7, 0.5, 8000)}
    belief.initialize(start | {"gyro_bias": np.zeros(8000), "odometry_scale": np.ones(8000)})
    sensor = RangeBearing(0.2, 0.1, landmarks=MAP)
    for step in range(40):
        landmark = MAP[step % len(MAP)]
        away = math.hypot(*(landmark - truth[:2])) + 0.2 * rng.standard_normal()
        bearing = (
            math.atan2(landmark[1] - truth[1], landmark[0] - truth[0])
            - truth[2]
            + 0.1 * rng.standard_normal()
        )
        belief.predict(UnicycleControl(0.0, 0.0), 0.02)
        place = landmark if named else (None, None)
        belief.weigh(sensor, RangeBearingMeasurement(away, bearing, place[0], place[1]))
        belief.normalize()
        if belief.effective_sample_size < 4000:
            belief.resample()
    error = belief.moments().mean[:3] - truth
    assert np.hypot(*error[:2]) < 0.2
    assert abs(error[2]) < 0.1
