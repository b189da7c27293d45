"""The motion mode: standing is noticed and taken for what it is; a slip is told in time, and no other is."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from service.estimate import MotionMode
from service.estimator.mode import Mode
from tests.service.estimator.driving import SPEED, STEP, Drive

Modes = list[tuple[float, MotionMode]]


def followed(
    drive: Drive, seconds: float, beacons: Callable[[float], tuple[int, ...]]
) -> tuple[Mode, Modes, float]:
    """Drive on among beacons, heeding the mode as a ground vehicle does; return its changes and the worst error."""
    mode = Mode(drive.motion, [], drive.belief, drive.control)
    mode.started(drive.now)
    modes: Modes = []
    worst = 0.0
    while drive.time < seconds:
        start, end = drive.step()
        control = drive.control(start, end)
        mode.approach(start, end)
        if mode.stands:
            drive.motion.stand(drive.belief.column("gyro_bias"), drive.belief.weights, control.turn, STEP)
        else:
            doubt = mode.doubt(control.distance, STEP)
            drive.belief.predict(control._replace(distance_sigma=math.sqrt(doubt)), STEP)
        mode.moved(start, end)
        for beacon in beacons(drive.time):
            measured = drive.range(beacon)
            mode.weighed(end, measured, drive.weigh(measured), False)
        drive.settle()
        worst = max(worst, drive.error if drive.time > 10.0 else 0.0)
        if not modes or mode.mode is not modes[-1][1]:
            modes.append((drive.time, mode.mode))
    return mode, modes, worst


def test_a_slip_is_told_in_time_and_the_scale_is_not_spoiled() -> None:
    def slipping(time: float) -> float:
        return 1.3 if 40.0 <= time < 60.0 else 1.0

    drive = Drive(seed=11, odometry=slipping)
    _, modes, worst = followed(drive, 80.0, lambda time: (0, 1) if 40.0 <= time < 60.0 else (0, 1, 2, 3))
    driven = [(time, mode) for time, mode in modes if time > 5.0]
    assert [mode for _, mode in driven] == [MotionMode.SLIPPING, MotionMode.MOVING]
    assert driven[0][0] - 40.0 <= 3.0
    assert 0.0 <= driven[1][0] - 60.0 <= 8.0
    assert worst < 2.0
    assert float(drive.belief.moments().mean[4]) == pytest.approx(1.0, abs=0.03)


def test_honest_wheels_do_not_slip() -> None:
    """Ten minutes, a scale of 1 %, four ranges five times a second."""
    _, modes, _ = followed(Drive(seed=12, odometry=lambda time: 1.01), 600.0, lambda time: (0, 1, 2, 3))
    assert MotionMode.SLIPPING not in [mode for _, mode in modes]


def test_who_stands_keeps_the_pose_and_learns_the_gyro() -> None:
    drive = Drive(seed=13, speed=lambda time: 0.0 if 20.0 <= time < 40.0 else SPEED)
    seen: list[bytes] = []

    def beacons(time: float) -> tuple[int, ...]:
        if 25.0 < time < 39.0:
            seen.append(drive.belief.columns[:3, :400].tobytes())
        return (0, 1) if time < 20.0 else ()

    mode, modes, _ = followed(drive, 42.0, beacons)
    assert modes[-2:] == [(pytest.approx(modes[-2][0]), MotionMode.STILL), (modes[-1][0], MotionMode.MOVING)]
    assert 20.0 <= modes[-2][0] <= 23.0
    assert 40.0 <= modes[-1][0] <= 41.0
    assert not mode.stands
    assert len(set(seen)) == 1
    assert math.sqrt(float(drive.belief.moments().variance[3])) < 1e-3


def test_without_odometry_or_place_the_mode_claims_nothing() -> None:
    """A stretch of which nothing is known is no evidence, and a belief that is spread has no say on slipping."""
    drive = Drive(seed=14)
    draw = np.random.default_rng(1).uniform
    drive.belief.initialize(
        {
            "north": draw(-50, 50, 400),
            "east": draw(-50, 50, 400),
            "heading": draw(-3, 3, 400),
            "gyro_bias": np.zeros(400),
            "odometry_scale": np.ones(400),
        }
    )
    mode = Mode(drive.motion, [], drive.belief, drive.control)
    mode.started(0)
    start, end = drive.step()
    drive.controls[start] = drive.controls[start]._replace(distance_sigma=1.0, turn_sigma=0.5)
    before = mode.still
    mode.approach(start, end)
    mode.moved(start, end)
    measured = drive.range(0)
    mode.weighed(end, measured, drive.weigh(measured), False)
    assert mode.still == pytest.approx(before, abs=0.02)
    assert mode.doubt(1.0, 0.1) == 0.0
