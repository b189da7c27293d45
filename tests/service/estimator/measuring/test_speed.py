"""Speeds through the whole estimator: as the control, beside it, and for a vehicle whose velocity is a state."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest

from drivers.sample import AnyReading, LocalPosition, Odometer, Rotation, Sample, Speed
from service.config import Configuration, validated
from service.estimate import Estimate
from service.estimator import Estimator

SECOND = 1_000_000_000


def configuration(sensors: list[dict[str, Any]], **sections: Any) -> Configuration:
    file: dict[str, Any] = {
        "vehicle": {"name": "rover"},
        "start": {"position": [0.0, 0.0, 0.0], "heading": 0.0, "sigma_heading": 0.02},
        "loop": {"rate": 20.0, "horizon_ms": 100.0},
        "budget": {"particles_max": 2000},
        "link": [{"name": "l", "kind": "mavlink", "url": "udpin:127.0.0.1:0"}],
        "sensor": sensors,
    }
    return validated(file | sections, Configuration, "rover.toml")


Said = Callable[[float], Iterable[tuple[str, AnyReading]]]


def run(estimator: Estimator, said: Said, seconds: float) -> Estimate:
    """Feed what is said twenty times a second, and return the last estimate."""
    last: Estimate | None = None
    for tick in range(1, round(seconds * 20) + 1):
        now = tick * SECOND // 20
        readings = said(tick / 20.0)
        estimator.ingest([Sample(now, now, "l", source, reading) for source, reading in readings])
        last = estimator.tick(now, now, 2000)
    assert last is not None
    return last


def fate(estimator: Estimator, name: str, now: int = 0) -> tuple[int, dict[str, int]]:
    status = next(status for status in estimator.sensors(now) if status.name == name)
    return status.accepted, status.refused


def test_four_wheels_make_one_speed() -> None:
    """A circle of 0.25 rad/s at 2 m/s for 20 s, by four wheels at the corners, one of which slips half of the time:
    after 40 m the place is right to 1 m, and within 3.5 standard deviations; their mean alone would be 1.2 m short of
    that, and one side's wheels 10 % fast."""
    corners = {"FL": (0.8, -0.8), "FR": (0.8, 0.8), "RL": (-0.8, -0.8), "RR": (-0.8, 0.8)}
    sensors = [
        {"kind": "speed", "source": wheel, "lever": list(lever), "sigma": 0.05}
        for wheel, lever in corners.items()
    ]
    rng = np.random.default_rng(3)
    rate = 0.25

    def said(t: float) -> Iterable[tuple[str, AnyReading]]:
        yield "GYRO", Rotation(rate)
        for wheel, (_, right) in corners.items():
            slip = 1.6 if wheel == "RR" and t % 4.0 > 2.0 else 1.0
            yield wheel, Speed(slip * (2.0 - right * rate) + 0.05 * rng.normal())

    estimator = Estimator(
        configuration(sensors, motion={"speed_noise": 0.02, "yaw_rate_noise": 0.005}), seed=1
    )
    last = run(estimator, said, 20.0)
    radius, angle = 2.0 / rate, rate * 20.0
    error = np.array([last.position[0], last.position[1]]) - radius * np.array(
        [math.sin(angle), 1 - math.cos(angle)]
    )
    nn, ne, _, ee, _, _ = last.position_covariance
    assert math.hypot(*error) < 1.0
    assert float(error @ np.linalg.solve(np.array([[nn, ne], [ne, ee]], float), error)) < 3.5**2
    assert estimator.missing == []
    for wheel in corners:
        accepted, refused = fate(estimator, f"speed/l/{wheel}")
        assert accepted > 350
        assert not refused


def test_a_speed_beside_an_odometer_finds_its_scale() -> None:
    """An odometer that counts 6 % short, beside a radar: after a minute its scale is known to a third of a percent of
    what a minute of readings can tell, within 3.5 standard deviations."""
    rng = np.random.default_rng(5)

    def said(t: float) -> Iterable[tuple[str, AnyReading]]:
        yield "GYRO", Rotation(0.0)
        yield "WHEEL_DISTANCE", Odometer((2.0 * t / 1.06,))
        yield "RADAR", Speed(2.0 + 0.1 * rng.normal())

    sensors = [{"kind": "speed", "source": "RADAR", "sigma": 0.1}]
    motion = {"odometry_scale_sigma": 0.1, "speed_noise": 0.05}
    estimator = Estimator(configuration(sensors, motion=motion), seed=1)
    scale, sigma = run(estimator, said, 60.0).biases["odometry_scale"]
    assert scale == pytest.approx(1.06, abs=3.5 * sigma)
    assert sigma < 0.02
    accepted, refused = fate(estimator, "speed/l/RADAR")
    assert accepted > 1000
    assert refused.keys() <= {"no_odometry"}  # the very first, before the odometer's second word
    assert sum(refused.values()) <= 1


def test_an_odometer_does_not_vouch_for_itself() -> None:
    """A sensor of the very wheels that are the control is not weighed: the scale stays as uncertain as it was."""

    def said(t: float) -> Iterable[tuple[str, AnyReading]]:
        yield "GYRO", Rotation(0.0)
        yield "WHEEL_DISTANCE", Odometer((2.0 * t, 2.0 * t))

    motion = {"odometry_scale_sigma": 0.1, "odometry_scale_walk": 0.0}
    sensors = [{"kind": "speed", "index": 0}, {"kind": "speed", "index": 1}]
    estimator = Estimator(configuration(sensors, motion=motion), seed=1)
    last = run(estimator, said, 10.0)
    assert last.biases["odometry_scale"] == pytest.approx((1.0, 0.1), abs=0.01)
    assert fate(estimator, "speed/l/1")[0] > 150
    together = Estimator(configuration(sensors, motion=motion | {"speed_from": "sensors"}), seed=1)
    assert run(together, said, 10.0).position[0] == pytest.approx(20.0, abs=3.0)


def test_a_radar_with_a_scale_of_its_own_leaves_the_odometer_alone() -> None:
    """Only the product of two scales is seen: a radar that reads 10 % fast, and says so, moves its own scale."""
    rng = np.random.default_rng(6)

    def said(t: float) -> Iterable[tuple[str, AnyReading]]:
        yield "GYRO", Rotation(0.0)
        yield "WHEEL_DISTANCE", Odometer((2.0 * t,))
        yield "RADAR", Speed(2.2 + 0.05 * rng.normal())

    sensors = [{"kind": "speed", "source": "RADAR", "sigma": 0.05, "estimate": ["scale"], "scale_sigma": 0.1}]
    motion = {"odometry_scale_sigma": 0.01, "speed_noise": 0.05}
    biases = run(Estimator(configuration(sensors, motion=motion), seed=1), said, 40.0).biases
    assert biases["speed_scale/RADAR"][0] == pytest.approx(1.1, abs=0.03)
    assert biases["odometry_scale"][0] == pytest.approx(1.0, abs=0.03)


def test_a_tag_goes_as_fast_as_it_is_told() -> None:
    """A fix of 1 m every two seconds tells a velocity to 0.4 m/s or so; a wheel's speed beside it makes its length
    known to half of that, and the truth (1.5 m/s eastwards) lies within 3.5 standard deviations."""
    spreads: list[float] = []
    for sensors in ([{"kind": "position"}], [{"kind": "position"}, {"kind": "speed", "sigma": 0.05}]):
        rng = np.random.default_rng(8)

        def said(t: float, rng: np.random.Generator = rng) -> Iterable[tuple[str, AnyReading]]:
            if round(t * 20) % 40 == 0:
                north, east = rng.normal(0.0, 1.0, 2)
                yield "FIX", LocalPosition(north, 1.5 * t + east, None, 1.0)
            yield "WHEEL_DISTANCE", Odometer((1.5 * t,))

        tag = configuration(
            sensors,
            vehicle={"name": "tag", "motion": "constant_velocity"},
            start={"position": [0.0, 0.0, 0.0], "sigma": [1.0, 1.0, 1.0]},
            motion={"acceleration_noise": 0.1},
        )
        last = run(Estimator(tag, seed=2), said, 30.0)
        variance = last.velocity_covariance[3]
        assert variance is not None
        assert last.velocity[1] == pytest.approx(1.5, abs=3.5 * math.sqrt(variance))
        spreads.append(math.sqrt(variance))
    assert spreads[1] < 0.5 * spreads[0]
