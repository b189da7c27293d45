"""A vehicle that is better than it was said to be makes the belief narrower, and what is published heeds it."""

from __future__ import annotations

import math
from typing import cast

import pytest

from filters.sensing import PositionMeasurement, RangeMeasurement
from service.config import Configuration
from service.config.reading import validated
from service.estimator.caution import Caution, caution_of
from service.estimator.ground import GroundVehicle
from service.estimator.measuring import Measurement
from service.estimator.receivers import Receivers
from service.estimator.vehicle import vehicle_of
from tests.service.estimator.driving import STEP, Drive


class Driven:
    """A drive as a vehicle, for the companion."""

    def __init__(self, drive: Drive) -> None:
        self.motion, self.slow_states, self.stands = drive.motion, [], False
        self.control = drive.control


def followed(seconds: float, independent: bool = True, standing: bool = False) -> tuple[Caution, Drive]:
    """Drive with a perfect gyro and perfect wheels among beacons whose ranges are as good as they say."""
    drive = Drive(seed=4)
    vehicle = Driven(drive)
    vehicle.stands = standing
    caution = Caution(cast(GroundVehicle, vehicle), drive.belief)
    caution.started(drive.now)
    while drive.time < seconds:
        start, end = drive.step()
        with drive.motion.as_learned():
            drive.belief.predict(drive.control(start, end), STEP)
        caution.moved(start, end)
        for beacon in range(4):
            measured = drive.range(beacon)._replace(independent=independent)
            caution.weighed(end, measured, drive.weigh(measured), False)
        drive.settle()
    return caution, drive


def test_a_good_gyro_is_found_out_and_the_region_shrinks() -> None:
    caution, drive = followed(60.0)
    assert drive.motion.turn_share < 0.4
    assert drive.motion.distance_share < 0.7
    assert caution.shown("range/bus/0") == pytest.approx(1.0, abs=0.4)
    control = drive.control(0, 0)
    stated = drive.motion.noise_variances(control, STEP)
    with drive.motion.as_learned():
        learned = drive.motion.noise_variances(control, STEP)
        gap = drive.motion.noise_variances(control._replace(distance_sigma=2.0), STEP)
    assert learned[0] == pytest.approx(drive.motion.distance_share * stated[0])
    assert learned[1] == pytest.approx(drive.motion.turn_share * stated[1])
    assert gap[0] == pytest.approx(learned[0] + 4.0)
    assert drive.motion.noise_variances(control, STEP) == stated


def test_while_errors_wander_what_was_stated_holds() -> None:
    caution, drive = followed(20.0, independent=False)
    assert drive.motion.turn_share == 1.0
    assert drive.motion.distance_share == 1.0
    assert caution.shown("range/bus/0") == 1.0


class Apart:
    """Who tells motion and wandering errors apart."""

    motion_shares = (0.05, 0.5)


def test_while_errors_wander_those_who_know_them_apart_say_what_the_motion_has_shown() -> None:
    """A minute of ranges whose errors wander: the receivers' word counts, and goes on to when nothing is heard."""
    caution, drive = followed(5.0, independent=False)
    caution.receivers = cast(Receivers, Apart())
    for _ in range(3):
        caution.moved(*drive.step())
        assert (drive.motion.turn_share, drive.motion.distance_share) == Apart.motion_shares
    for _ in range(int(12.0 / STEP)):
        caution.moved(*drive.step())
    assert (drive.motion.turn_share, drive.motion.distance_share) == Apart.motion_shares
    caution.weighed(drive.now, drive.range(0)._replace(independent=True), drive.weigh(drive.range(0)), False)
    caution.moved(*drive.step())
    assert (drive.motion.turn_share, drive.motion.distance_share) != Apart.motion_shares


def test_a_sensor_is_not_judged_while_the_vehicle_stands() -> None:
    caution, _ = followed(5.0, standing=True)
    assert caution.shown("range/bus/0") == pytest.approx(1.0, abs=0.1)


def test_a_reading_is_given_the_variance_that_its_sensor_has_shown() -> None:
    caution, drive = followed(30.0)
    known = drive.range(0)
    factor = math.sqrt(caution.shown(known.name))
    assert cast(RangeMeasurement, caution.sized(known).value).sigma == pytest.approx(0.3 * factor)
    stranger = drive.range(1)._replace(name="range/other/1")
    assert caution.sized(stranger) is stranger
    fix = Measurement(known.name, known.model, PositionMeasurement(1.0, 2.0, 0.4), True, -10.0, 1.0)
    assert caution.sized(fix).value == PositionMeasurement(1.0, 2.0, pytest.approx(0.4 * factor))  # type: ignore[arg-type]
    bare = fix._replace(value=PositionMeasurement(1.0, 2.0))
    assert caution.sized(bare) is bare


def test_the_switch_and_vehicles_without_odometry_have_none() -> None:
    for motion, on in (("unicycle", False), ("constant_velocity", True)):
        file = {
            "vehicle": {"name": "v", "motion": motion},
            "link": [{"name": "l", "kind": "mavlink", "url": "udpin:127.0.0.1:0"}],
            "honesty": {"noise_learning": on},
        }
        settings = validated(file, Configuration, "test.toml")
        assert caution_of(settings, vehicle_of(settings), Drive().belief) is None
