"""Schmidt's consider filter against simulated errors that readings share, and its limits in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filters.consider import LastingError

STEP = 0.5
DURATION = 60.0
LASTING = 4.0
WHITE = 1.0
WALK = 0.05


def gains(steps: int) -> list[float]:
    """Of a Kalman filter in one dimension that takes every reading for independent."""
    variance = 25.0
    found: list[float] = []
    for _ in range(steps):
        variance += WALK * STEP
        gain = variance / (variance + WHITE)
        variance *= 1.0 - gain
        found.append(gain)
    return found


def test_the_variance_is_that_of_many_drives() -> None:
    """Of 4,000 simulated errors; a sample variance is off by 5 standard errors (11 %) once in 1e6."""
    chance = np.random.default_rng(7)
    steps, count = 200, 4000
    persistence = math.exp(-STEP / DURATION)
    lasting = math.sqrt(LASTING) * chance.standard_normal(count)
    brought = np.zeros(count)
    ours = LastingError(DURATION)
    for step, gain in enumerate(gains(steps)):
        lasting = persistence * lasting + math.sqrt(LASTING * (1 - persistence**2)) * chance.standard_normal(
            count
        )
        ours.wait(STEP)
        if step % 10 == 9:  # a reading of another sensor, without the error
            brought *= 1.0 - 0.3
            ours.displaced(0.3)
        else:
            brought = (1.0 - gain) * brought + gain * lasting
            ours.corrected(gain, LASTING)
        if step in (0, 20, 100, 199):
            assert ours.variance == pytest.approx(float(brought.var()), rel=0.11)


def test_readings_for_ever_bring_it_to_the_error_itself() -> None:
    """An error that does not change within the time: to 1e-6 of its variance."""
    ours = LastingError(1e12)
    for _ in range(500):
        ours.wait(STEP)
        ours.corrected(0.1, LASTING)
    assert ours.variance == pytest.approx(LASTING, rel=1e-6)
    ours.restart()
    assert ours.variance == 0.0


def test_silence_leaves_what_was_brought() -> None:
    ours = LastingError(DURATION)
    ours.corrected(0.5, LASTING)
    before = ours.variance
    assert before == pytest.approx(0.25 * LASTING)
    ours.wait(1e6)
    assert ours.variance == before
    ours.corrected(0.5, LASTING)  # by now another error, independent of the first
    assert ours.variance == pytest.approx(0.25 * before + 0.25 * LASTING)


@pytest.mark.parametrize("duration", [0.0, -1.0, math.inf, math.nan])
def test_a_duration_that_is_none(duration: float) -> None:
    with pytest.raises(ValueError, match="duration"):
        LastingError(duration)
