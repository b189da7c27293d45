"""Wheels and accelerometer: what they say where the wheels hold, begin to spin, or spin, beside Student's t itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from scipy import stats

from drivers.sample import SECOND
from service.estimator.grip import NOTHING, Grip, Said
from service.estimator.track import Motion

STEP = SECOND // 10
SLIP = 0.2
NOISE = 0.03


class Ground:
    """Wheels that count what ``share`` of the time says too much, on a vehicle whose speed is ``speed``."""

    counted = True

    def __init__(self, speed: Callable[[float], float], share: Callable[[float], float]) -> None:
        self._speed, self._share = speed, share
        self._chance = np.random.default_rng(5)
        self.silent = False
        self.speeds: list[float] = []

    def distance(self, start: int, end: int) -> Motion:
        middle = 0.5 * (start + end) / SECOND
        noise = NOISE * float(self._chance.standard_normal())
        speed = self._speed(middle) * (1.0 + self._share(middle)) + noise
        self.speeds.append(speed)
        return Motion(speed * (end - start) / SECOND, 0.0)

    def gained(self, start: int, end: int) -> Motion:
        return Motion(
            self._speed(end / SECOND) - self._speed(start / SECOND) + 0.1 * (end - start) / SECOND,
            0.1 if self.silent else 0.0,
        )


def asked(grip: Grip, seconds: float, begin: float = 0.0) -> Iterator[tuple[float, Said]]:
    for index in range(round(10 * begin), round(10 * seconds)):
        yield index / 10, grip.ask(index * STEP, (index + 1) * STEP)


def waves(time: float) -> float:
    return 1.5 + 0.5 * np.sin(time)


def test_the_scale_is_learned_and_an_askew_accelerometer_is_no_jump() -> None:
    """The t of 4 degrees that fits steps of a median of five best has 0.41 of the levels' sigma (of a million)
    where there is a step;
    gravity adds 0.01 m/s a stretch. That an error looks 100 times likelier of a jump is as rare as 6 sigma.
    """
    grip = Grip(Ground(waves, lambda time: 0.0), SLIP)
    said = [said.change for _, said in asked(grip, 300.0)]
    assert grip.scale == pytest.approx(0.41 * NOISE, rel=0.2)
    assert grip.mean == pytest.approx(-0.01, abs=0.01)
    assert max(said) < 100.0


def test_a_jump_is_worth_what_the_densities_say() -> None:
    ground = Ground(waves, lambda time: 0.3 if 60.0 <= time < 70.0 else 0.0)
    grip = Grip(ground, SLIP)
    assert max(said.change for _, said in asked(grip, 60.2)) < 100.0
    scale, mean = grip.scale, grip.mean
    said = grip.ask(602 * STEP, 603 * STEP)
    middles = [(index * STEP + STEP // 2) for index in range(597, 603)]
    levels = [
        speed - ground.gained(middles[0], middle).total
        for speed, middle in zip(ground.speeds[-6:], middles, strict=True)
    ]
    error = float(np.median(levels[1:]) - np.median(levels[:5])) - mean
    for odds, speed in zip(said, (ground.speeds[-1], ground.gained(*middles[4:]).total), strict=True):
        exact = stats.t.logpdf(error, 4, scale=np.hypot(scale, SLIP * speed)) - stats.t.logpdf(
            error, 4, scale=scale
        )
        assert np.log(odds) == pytest.approx(min(8.0, exact), abs=1e-6)
    assert said.change > 100.0


def test_a_count_that_was_stamped_late_is_no_jump() -> None:
    """Two stretches read 15 % slow, as of ArduPilot's wheels every second or so; the same for good is a jump."""
    late = Grip(Ground(waves, lambda time: -0.15 if 60.0 < time < 60.2 else 0.0), SLIP)
    assert max(said.change for _, said in asked(late, 70.0)) < 100.0
    slow = Grip(Ground(waves, lambda time: -0.15 if time > 60.0 else 0.0), SLIP)
    assert max(said.change for _, said in asked(slow, 70.0)) > 100.0


def test_wheels_that_slip_speed_up_more_than_the_vehicle() -> None:
    """Over 4 s of 1.2 m/s² they do so by 0.36 m/s² more, which is a little more each stretch, and adds up."""

    def speed(time: float) -> float:
        return 1.0 + 1.2 * min(4.0, max(0.0, time - 60.0))

    def told(share: float) -> float:
        grip = Grip(Ground(speed, lambda time: share), SLIP)
        return sum(np.log(said.slip) for time, said in asked(grip, 64.0) if time >= 60.0)

    assert told(0.3) > 2.0
    assert told(0.0) < 0.0


@pytest.mark.parametrize("what", ["apart", "silent", "commanded", "standing", "new"])
def test_nothing_is_said_of_what_is_not_known(what: str) -> None:
    ground = Ground(lambda time: 0.0 if what == "standing" else 1.5, lambda time: 0.3 if time > 59.9 else 0.0)
    grip = Grip(ground, SLIP)
    if what == "new":
        assert all(said is NOTHING for _, said in asked(grip, 3.0))
        return
    for _ in asked(grip, 59.9):
        pass
    ground.silent, ground.counted = what == "silent", what != "commanded"
    start = 600 if what == "apart" else 599
    assert grip.ask(start * STEP, (start + 1) * STEP) is NOTHING
