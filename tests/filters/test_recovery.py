"""Augmented recovery: the averages against plain arithmetic, and a kidnapped filter that finds back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.proposals import Ring, Rings
from filters.recovery import AugmentedRecovery, Averages, expected_log_evidence
from filters.sensing import Range, RangeMeasurement

# ---- the averages


@given(st.lists(st.floats(-30.0, 30.0), min_size=1, max_size=50), st.floats(0.001, 0.3), st.floats(1.1, 3.0))
@settings(max_examples=100, deadline=None)
def test_they_are_the_averages_of_augmented_mcl(logs: list[float], slow: float, ratio: float) -> None:
    averages = Averages(slow, slow * ratio)
    plain_slow = plain_fast = math.exp(logs[0])
    averages.add(logs[0])
    for log in logs[1:]:
        averages.add(log)
        plain_slow += slow * (math.exp(log) - plain_slow)
        plain_fast += slow * ratio * (math.exp(log) - plain_fast)
    assert averages.log_slow == pytest.approx(math.log(plain_slow), abs=1e-12)
    assert averages.share == pytest.approx(max(0.0, 1.0 - plain_fast / plain_slow), abs=1e-11)


def test_numbers_that_float64_cannot_hold_are_averaged() -> None:
    averages = Averages(0.1, 0.5)
    for log in (-2000.0, -2000.0, -2002.0):
        averages.add(log)
    e = math.exp(-2.0)
    assert averages.share == pytest.approx(1.0 - (0.5 + 0.5 * e) / (0.9 + 0.1 * e), abs=1e-12)
    for _ in range(50):
        averages.add(-math.inf)
    assert averages.share == pytest.approx(1.0 - 0.5**50 / 0.9**50 * 0.65, abs=1e-9)


def test_nothing_is_known_before_the_first_evidence() -> None:
    averages = Averages(0.1, 1.0)
    averages.add(-math.inf)
    assert averages.share == 0.0
    averages.add(-3.0)
    assert (averages.log_slow, averages.log_fast) == (-3.0, -3.0)
    averages.add(-math.inf)
    assert averages.share == 1.0  # the fast average remembers nothing but the last
    averages.add(-math.inf)
    assert averages.share == 1.0


@pytest.mark.parametrize("log", [math.nan, math.inf])
def test_what_is_no_evidence_is_refused(log: float) -> None:
    averages, recovery = Averages(0.1, 0.2), AugmentedRecovery()
    with pytest.raises(ValueError, match="averages"):
        averages.add(log)
    with pytest.raises(ValueError, match="gnss: log evidence"):
        recovery.observe("gnss", log)
    assert averages.log_slow == -math.inf
    assert recovery.share == 0.0


@pytest.mark.parametrize(("slow", "fast"), [(0.0, 0.1), (0.2, 0.1), (0.1, 1.1), (0.1, 0.1)])
def test_rates_are_ordered(slow: float, fast: float) -> None:
    with pytest.raises(ValueError, match="slow < fast"):
        AugmentedRecovery(slow, fast)


# ---- kinds of sensors


def test_one_faulty_sensor_of_four_asks_for_a_quarter() -> None:
    recovery = AugmentedRecovery(0.01, 0.5)
    for step in range(200):
        for kind, unit in (("a", 1.0), ("b", 1e-9), ("c", 1e9), ("d", 5.0)):
            fails = kind == "d" and step >= 100
            recovery.observe(kind, -math.inf if fails else math.log(unit))
    assert recovery.shares == pytest.approx({"a": 0.0, "b": 0.0, "c": 0.0, "d": 1.0}, abs=1e-9)
    assert recovery.share == pytest.approx(0.25, abs=1e-9)
    recovery.forget("d")
    recovery.forget("never heard")
    assert recovery.share == pytest.approx(0.0, abs=1e-9)


def test_a_reading_of_ten_times_the_sigma_is_no_failure() -> None:
    """Evidence falls tenfold with the sigma; relative to what such a reading should have, it does not."""
    rng = np.random.default_rng(1)
    told, untold = AugmentedRecovery(0.01, 0.3), AugmentedRecovery(0.01, 0.3)
    for step in range(300):
        variance = 0.25 if step < 250 else 25.0
        innovation = math.sqrt(variance) * rng.standard_normal()
        log_evidence = -0.5 * (math.log(2 * math.pi * variance) + innovation**2 / variance)
        told.observe("gnss", log_evidence, expected_log_evidence([variance]))
        untold.observe("gnss", log_evidence)
    assert untold.share > 0.8
    assert told.share < 0.2


def test_expected_evidence_is_the_mean_log_density() -> None:
    """Against 100,000 innovations: within 5 standard deviations of the mean."""
    innovations = np.random.default_rng(2).normal(0.0, [[0.5], [3.0]], (2, 100_000))
    density = -0.5 * (np.log(2 * np.pi * np.array([[0.25], [9.0]])) + innovations**2 / [[0.25], [9.0]])
    said = density.sum(axis=0)
    assert expected_log_evidence([0.25, 9.0]) == pytest.approx(said.mean(), abs=5 * said.std() / 316)
    for bad in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(ValueError, match="variances"):
            expected_log_evidence([1.0, bad])


def test_restarting_lets_the_new_belief_be_judged_by_itself() -> None:
    recovery = AugmentedRecovery(0.01, 0.5)
    for log in (0.0, 0.0, -9.0, -9.0):
        recovery.observe("range", log)
    assert recovery.share > 0.7
    recovery.restart()
    assert recovery.share == 0.0


# ---- kidnapped

BEACONS = ((-40.0, -40.0), (45.0, -35.0), (0.0, 50.0))
TAKEN = 60


class Outcome:
    """A belief of 2,000 particles at a place, carried off at step 60 by 50 m; three ranges a step."""

    def __init__(self, recovers: bool, normalised: bool, seed: int) -> None:
        rng, count, sensor = np.random.default_rng(seed), 2000, Range(0.5, outliers=0.05, span=200.0)
        belief = ParticleFilter(Unicycle(0.3, 0.1, 0.0, 0.0), capacity=count, seed=seed)
        start = {name: rng.normal(0.0, 0.3, count) for name in ("north", "east", "heading")}
        belief.initialize(start | {"gyro_bias": np.zeros(count), "odometry_scale": np.ones(count)})
        recovery = AugmentedRecovery(0.02, 0.3)
        self.shares: list[float] = []
        self.errors: list[float] = []
        for step in range(120):
            north, east = (0.0, 0.0) if step < TAKEN else (30.0, -40.0)
            belief.predict(UnicycleControl(0.0, 0.0), 0.1)
            rings = []
            for n, e in BEACONS:
                z = math.hypot(north - n, east - e) + 0.5 * rng.standard_normal()
                evidence = belief.weigh(sensor, RangeMeasurement(z, n, e))
                rings.append(Ring(n, e, z, 0.5))
                if not normalised:
                    recovery.observe("range", evidence.log_mean)
            weights = belief.weights / belief.weights.sum()
            if normalised:
                recovery.observe("range", math.log(weights.mean()))
            self.shares.append(recovery.share)
            mean = belief.moments().mean
            self.errors.append(math.hypot(mean[0] - north, mean[1] - east))
            injected = round(recovery.share * count) if recovers else 0
            if injected > 0:
                belief.inject(Rings(rings).draw(injected, rng))
            else:
                belief.resample()


def test_a_kidnapped_belief_finds_back() -> None:
    """Expected: next to nothing is injected while all is well; 4 s after the kidnapping the error is below 1 m."""
    for seed in range(3):
        outcome = Outcome(recovers=True, normalised=False, seed=seed)
        assert max(outcome.errors[10:TAKEN]) < 1.0
        assert np.mean(outcome.shares[10:TAKEN]) < 0.15
        assert max(outcome.shares[TAKEN : TAKEN + 10]) > 0.5
        assert max(outcome.errors[-20:]) < 1.0


def test_without_recovery_it_stays_lost() -> None:
    outcome = Outcome(recovers=False, normalised=False, seed=0)
    assert min(outcome.errors[TAKEN:]) > 20.0


def test_fed_with_normalised_weights_it_never_fires() -> None:
    """Their mean is one over the count, whatever was measured: the share stays 0 and the belief lost."""
    outcome = Outcome(recovers=True, normalised=True, seed=0)
    assert max(outcome.shares) < 1e-6
    assert min(outcome.errors[TAKEN:]) > 20.0
