"""What an error is made of: evidence against the density of all fixes at once, and parts found where they are known."""

from __future__ import annotations

import math
from typing import Any, cast

import numpy as np
import pytest
from scipy import stats

from filters.linearised import error_parts
from filters.linearised.error_parts import FRESH, LASTING, MOTION, ErrorParts
from filters.motion.unicycle import Unicycle, UnicycleControl
from filters.sensing import Position, PositionMeasurement, Velocity, VelocityMeasurement

WILD = math.log(1e-300)
SIZE = 7


def begun(motion: Unicycle, variance: float, claim: float) -> ErrorParts:
    parts = ErrorParts(motion)
    mean = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    covariance = np.diag([variance, variance, 1e-4, 1e-8, 1e-8, claim**2, claim**2])
    parts.begin(mean, covariance)
    return parts


def test_the_evidence_is_that_of_all_fixes_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """A vehicle that stands: fixes are jointly Gaussian, and their covariance is a closed form.

    Gaussians that are far from right leave out what is beyond their gate; here they are to hear everything.
    """
    monkeypatch.setattr(error_parts, "GATE", 1.0 - 1e-12)
    chance = np.random.default_rng(3)
    claim, step, number = 1.5, 5.0, 12
    parts = begun(Unicycle(0.1, 0.1, 0.0, 0.0), 0.04, claim)
    fixes = chance.normal(0.4, 0.3, (number, 2))
    for north, east in fixes:
        parts.predict(None, step, claim)
        value = PositionMeasurement(float(north), float(east), claim, claim)
        parts.hear(Position(claim), value, claim**2, WILD, 1.0)
    times = step * np.arange(1, number + 1)
    table: list[float] = []
    for fresh, p in FRESH:
        for (lasting, duration), q in LASTING:
            apart = np.exp(-np.abs(times[:, None] - times) / duration)
            faded = np.exp(-(times[:, None] + times) / duration)
            error = claim**2 * (lasting * (apart - faded) + faded)
            covariance = 0.04 + error + claim**2 * fresh * np.eye(number)
            density: Any = stats.multivariate_normal(np.zeros(number), cast(Any, covariance))
            log = sum(float(density.logpdf(z)) for z in fixes.T)
            table += [log + math.log(p * q * r) for _, r in MOTION]
    weights = np.exp(np.array(table) - max(table))
    weights /= weights.sum()
    shares = np.array([fresh for fresh, _ in FRESH for _ in LASTING for _ in MOTION])
    lasts = np.array([part[0] for _ in FRESH for part, _ in LASTING for _ in MOTION])
    found = parts.parts
    assert found.fresh == pytest.approx(float(weights @ shares), rel=1e-6)
    assert found.lasting == pytest.approx(float(weights @ lasts), rel=1e-6)
    assert parts.motion_share == pytest.approx(sum(m * p for m, p in MOTION))


def driven(seed: int, fresh: float, lasting: float, seconds: int) -> ErrorParts:
    """Circle with good wheels; the error's parts are standard deviations over the claim, 40 s its memory."""
    chance = np.random.default_rng(seed)
    claim, memory = 1.0, math.exp(-1.0 / 40.0)
    parts = begun(Unicycle(0.05, 0.002, 0.0, 0.0), 1.0, claim)
    truth, error = np.zeros(3), claim * lasting * chance.normal(size=2)
    for _ in range(seconds):
        d, t = 2.0 + 0.05 * chance.normal(), 0.05 + 0.002 * chance.normal()
        truth += (d * math.cos(truth[2] + 0.5 * t), d * math.sin(truth[2] + 0.5 * t), t)
        error = memory * error + math.sqrt(1.0 - memory**2) * claim * lasting * chance.normal(size=2)
        fix = truth[:2] + error + fresh * claim * chance.normal(size=2)
        parts.predict(UnicycleControl(2.0, 0.05), 1.0, claim)
        parts.hear(
            Position(claim),
            PositionMeasurement(float(fix[0]), float(fix[1]), claim, claim),
            claim**2,
            WILD,
            0.5,
        )
        parts.forget(1.0)
    return parts


@pytest.mark.parametrize("seed", range(2))
def test_each_part_is_found_by_itself(seed: int) -> None:
    """Seven minutes of fixes; each of 14 seeds stays within these bounds by a tenth at least."""
    assert driven(seed, 0.6, 0.8, 400).parts.fresh > 0.35
    assert driven(seed, 0.1, 0.8, 400).parts.fresh < 0.015
    assert driven(seed, 0.25, 2.0, 400).parts.lasting > 3.5


def test_a_receiver_that_is_better_than_it_claims_is_found_out() -> None:
    """12 of 14 seeds come below 1; of three seeds two come above once in 19 times."""
    assert sorted(driven(seed, 0.25, 0.5, 400).parts.lasting for seed in range(3))[1] < 1.0


def test_what_was_learned_is_kept_when_the_belief_begins_anew_and_forgotten_with_time() -> None:
    parts = driven(1, 0.1, 0.8, 200)
    learned = parts.parts
    parts.stop()
    parts.predict(UnicycleControl(1.0, 0.0), 1.0, 1.0)
    parts.witness(Velocity(0.1), VelocityMeasurement(1.0, 0.0, 1.0, 0.1))
    parts.hear(Position(1.0), PositionMeasurement(0.0, 0.0, 1.0), 1.0, WILD, 1.0)
    assert not parts.live
    assert parts.parts == learned
    parts.forget(1e5)
    assert parts.parts.fresh == pytest.approx(sum(share * p for share, p in FRESH), rel=1e-3)
