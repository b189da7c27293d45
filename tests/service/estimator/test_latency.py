"""What a stated latency is off by is found on a bending way, and fixes are taken as far ahead as they are late."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import pytest

from filters.belief import Evidence, Moments
from filters.linearised.latency import LATENCY, Lateness
from filters.motion.standing import StandingUnicycle
from filters.motion.unicycle import UnicycleControl
from filters.sensing import Position, PositionMeasurement, Velocity
from service.config import Configuration, validated
from service.estimator.carrier import Pose
from service.estimator.ground import GroundVehicle
from service.estimator.lasting import Lasting
from service.estimator.latency import Latency, Receiver, latency_of
from service.estimator.measuring import Measurement
from service.estimator.vehicle import vehicle_of
from tests.service.estimator.driving import SPEED, STEP, Drive

STATED = 0.05
HEARD = Evidence(0.0, 0.0, True)


@dataclass
class Driven:
    """As much of a ground vehicle as is asked for."""

    drive: Drive
    motion: StandingUnicycle
    slow_states: tuple[()] = ()
    stands: bool = False

    def control(self, start: int, end: int) -> UnicycleControl:
        """All that was driven meanwhile."""
        parts = [part for time, part in self.drive.controls.items() if start <= time < end]
        return UnicycleControl(sum(part.distance for part in parts), sum(part.turn for part in parts))


def fix(
    north: float, east: float, speed: float = 0.0, rate: float = 0.0, timing: float = STATED
) -> Measurement:
    value = PositionMeasurement(north, east, 0.1, 0.1, speed, rate)
    return Measurement("position/l", Position(0.1), value, True, math.log(1e-8), 1.0, 0.01, True, timing)


def driven(late: float, seconds: float) -> Latency:
    """Swing left and right with fixes that are so late; the belief stays where the vehicle is."""
    drive = Drive(seed=3, turn_rate=0.4)
    latency = Latency(cast(GroundVehicle, Driven(drive, drive.motion)), drive.belief)
    latency.started(0)
    for _ in range(round(seconds / STEP)):
        drive.turn_rate = rate = 0.4 if drive.time % 10.0 < 5.0 else -0.4
        start, end = drive.step()
        drive.belief.predict(drive.control(start, end), STEP)
        for name, true in zip(("north", "east", "heading"), drive.truth, strict=True):
            drive.belief.column(name)[:] = true + 0.05 * drive.chance.normal(size=drive.belief.count)
        latency.moved(start, end)
        then = drive.truth[2] - 0.5 * rate * late
        north = drive.truth[0] - SPEED * late * math.cos(then) + 0.1 * drive.chance.normal()
        east = drive.truth[1] - SPEED * late * math.sin(then) + 0.1 * drive.chance.normal()
        latency.weighed(end, fix(north, east, SPEED, rate), HEARD, False)
    return latency


def pose(north: float, east: float) -> Pose:
    """A belief of 0.1 m that moves so fast."""
    covariance = np.diag([0.01, 0.01, 1e-4])
    moments = Moments(("north", "east", "heading"), np.zeros(3), covariance.diagonal(), covariance, 100.0)
    return Pose(
        moments, covariance, (0.0, 1e-4), None, (north, east, None), (0.0, 0.0, None, 0.0, None, None), 0.245
    )


def test_a_late_receiver_is_found_out_and_its_fixes_are_taken_ahead_on_the_way() -> None:
    latency = driven(0.08, 60.0)
    late = latency.late(fix(0.0, 0.0))
    assert late.sigma < 0.5 * STATED
    assert late.mean == pytest.approx(0.08, abs=4.0 * late.sigma)
    moved = latency.punctual(fix(0.0, 0.0, 2.0)).value
    assert math.hypot(moved.north, moved.east) == pytest.approx(2.0 * late.mean)
    lasting = Lasting(None, latency)
    lasting.weighed(0, fix(0.0, 0.0), HEARD, False)
    wide = lasting.widened(pose(3.0, 0.0))
    assert wide.covariance[0, 0] == pytest.approx(0.01 + (3.0 * late.sigma) ** 2)
    assert wide.covariance[1, 1] == pytest.approx(0.01)


def test_after_a_new_beginning_no_fix_is_moved_until_the_way_is_known_and_the_region_has_it_all() -> None:
    latency = driven(0.08, 20.0)
    late = latency.late(fix(0.0, 0.0))
    latency.started(0)
    assert latency.late(fix(0.0, 0.0)) == (0.0, math.hypot(late.mean, late.sigma))
    assert latency.punctual(fix(1.0, 2.0, 2.0)).value.north == 1.0


def test_of_a_receiver_that_was_not_heard_what_was_stated_holds() -> None:
    latency = driven(0.0, 0.0)
    assert latency.late(fix(0.0, 0.0)) == (0.0, STATED)
    assert latency.punctual(fix(1.0, 2.0, 2.0)).value.north == 1.0
    assert latency.punctual(fix(1.0, 2.0, 2.0, timing=0.0)).value.north == 1.0


def test_velocities_of_the_same_receiver_are_as_late_and_no_others() -> None:
    receiver = Receiver("position/l", cast(Lateness, None), Position(0.1))
    late = Measurement("velocity/l", Velocity(0.2, scale="scale"), None, False, 0.0, 1.0, timing=STATED)
    model = receiver.model_of(late)
    assert (model.sigma, model.scale, model.delay) == (0.2, "scale", LATENCY)
    assert receiver.model_of(late) is model
    for other in (late._replace(timing=0.0), late._replace(name="velocity/m"), fix(0.0, 0.0)):
        assert receiver.model_of(other) is other.model


def test_only_a_stated_latency_of_a_vehicle_with_odometry_is_learned() -> None:
    def learns(motion: str = "unicycle", learning: bool = True, **sensor: Any) -> bool:
        file: dict[str, Any] = {
            "vehicle": {"name": "test", "motion": motion},
            "link": [{"name": "l", "kind": "mavlink", "url": "udpin:127.0.0.1:0"}],
            "sensor": [{"kind": "position", **sensor}],
            "honesty": {"noise_learning": learning},
        }
        configuration = validated(file, Configuration, "test.toml")
        return latency_of(configuration, vehicle_of(configuration), Drive().belief) is not None

    assert learns(delay_ms=90.0)
    assert not learns()
    assert not learns(learning=False, delay_ms=90.0)
    assert not learns("constant_velocity", delay_ms=90.0)
