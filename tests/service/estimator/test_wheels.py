"""Several speeds as one: their mean by weight, brought to the centre, and the one that lies."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from drivers.sample import AnyReading, Odometer, Sample, Speed
from service.config import Sensor
from service.estimator.wheels import Wheels

SECOND = 1_000_000_000


def said(seconds: float, source: str, reading: AnyReading) -> Sample:
    time = round(seconds * SECOND)
    return Sample(time, time, "bus", source, reading)


def turning(rate: float) -> Callable[[int], float]:
    return lambda time: rate


def test_it_is_the_mean_weighted_by_precision_at_the_centre() -> None:
    """Left wheel 0.6 m left of the centre at 0.5 rad/s: 0.3 m/s faster; variances 0.01 and 0.04."""
    wheels = Wheels(
        [
            Sensor(kind="speed", source="LEFT", sigma=0.1, lever=(0.0, -0.6), correlation_s=0.1),
            Sensor(kind="position"),
            Sensor(kind="speed", source="RIGHT", sigma=0.2, lever=(1.0, 0.6), correlation_s=0.1),
        ],
        None,
    )
    alone = wheels.take(said(1.0, "LEFT", Speed(2.3)), turning(0.5))
    assert alone is not None
    assert alone.speed == pytest.approx(2.0)
    assert alone.density == pytest.approx(0.01 * 0.1)
    both = wheels.take(said(1.01, "RIGHT", Speed(1.8)), turning(0.5))
    assert both is not None
    assert both.speed == pytest.approx((2.0 / 0.01 + 2.1 / 0.04) / (1 / 0.01 + 1 / 0.04))
    assert both.density == pytest.approx(0.1 / (1 / 0.01 + 1 / 0.04))
    assert not wheels.wants(said(1.0, "ABOVE", Speed(1.0)))
    assert both.time == round(1.01 * SECOND)
    late = wheels.take(said(2.0, "RIGHT", Speed(1.8)), turning(0.0))
    assert late is not None
    assert late.speed == pytest.approx(1.8)  # the left wheel has been silent for too long


def test_its_variance_is_what_it_says() -> None:
    """Four wheels of 0.2 m/s, 4,000 times: the mean's variance is a quarter, to 8 % (3.6 sigmas of a chi-square)."""
    sensors = [Sensor(kind="speed", source=f"W{wheel}", sigma=0.2, correlation_s=0.0) for wheel in range(4)]
    rng = np.random.default_rng(2)
    errors: list[float] = []
    for turn in range(4000):
        wheels = Wheels(sensors, None)
        fused = None
        for wheel in range(4):
            fused = wheels.take(
                said(1.0 + turn, f"W{wheel}", Speed(3.0 + rng.normal(0.0, 0.2))), turning(0.0)
            )
        assert fused is not None
        errors.append(fused.speed - 3.0)
        assert wheels.outvoted <= 1
    assert float(np.var(errors)) == pytest.approx(0.04 / 4.0, rel=0.08)


def test_of_three_the_one_that_slips_is_left_out() -> None:
    wheels = Wheels([Sensor(kind="speed", source=name, sigma=0.1) for name in "ABC"], None)
    for name, speed in (("A", 2.0), ("B", 2.1)):
        wheels.take(said(1.0, name, Speed(speed)), turning(0.0))
    fused = wheels.take(said(1.0, "C", Speed(4.0)), turning(0.0))
    assert fused is not None
    assert fused.speed == pytest.approx(2.05)
    assert wheels.outvoted == 1


def test_a_speed_that_is_late_is_of_when_it_was_true() -> None:
    wheels = Wheels([Sensor(kind="speed", delay_ms=80.0, lever=(0.0, 1.0))], None)
    fused = wheels.take(
        said(1.0, "RADAR", Speed(2.0)), lambda time: 0.5 if time == 92 * SECOND // 100 else 0.0
    )
    assert fused is not None
    assert fused.time == 92 * SECOND // 100
    assert fused.speed == pytest.approx(2.5)


def test_wheels_of_one_message_are_told_apart_by_their_index() -> None:
    wheels = Wheels(
        [Sensor(kind="speed", index=wheel, lever=(0.0, side)) for wheel, side in enumerate((-0.5, 0.5))], None
    )
    assert wheels.take(said(1.0, "WHEEL_DISTANCE", Odometer((0.0, 0.0))), turning(0.4)) is None
    fused = wheels.take(said(1.1, "WHEEL_DISTANCE", Odometer((0.22, 0.18))), turning(0.4))
    assert fused is not None
    assert fused.speed == pytest.approx(2.0)
    assert wheels.unusable == 2
