"""The bank against one extended Kalman filter per member: the same numbers to 1e-9."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from filters.extended_kalman import ExtendedKalmanFilter
from filters.kernels.expectations import spread_of
from filters.linearised import LinearisedUnicycle
from filters.linearised.bank import GaussianBank
from filters.linearised.shadow import LINEARISED
from filters.motion.slow import RandomWalk
from filters.motion.unicycle import Unicycle, UnicycleControl
from filters.sensing import (
    Heading,
    HeadingMeasurement,
    Position,
    PositionMeasurement,
    Range,
    RangeMeasurement,
    Velocity,
    VelocityMeasurement,
)
from filters.sensing.speed import WheelSpeed, WheelSpeedMeasurement

MOTION = Unicycle(0.1, 0.02, 1e-3, 1e-3, slip_noise=0.05, turn_noise=0.01)
SLOW = tuple(RandomWalk(name, 1e-3) for name in ("range_scale", "range_bias", "heading_bias", "delay"))
SIZE = 9
SENSORS: dict[str, tuple[Any, Callable[[np.random.Generator], Any]]] = {
    "range": (
        Range(0.5, scale="range_scale", bias="range_bias"),
        lambda chance: RangeMeasurement(30.0 + chance.normal(), 20.0, 15.0, -2.0, 0.4),
    ),
    "plain range": (Range(0.5), lambda chance: RangeMeasurement(30.0 + chance.normal(), 20.0, 15.0, -2.0)),
    "position": (
        Position(1.0, lever=(0.4, -0.2)),
        lambda chance: PositionMeasurement(chance.normal(), chance.normal(), 0.7, 0.9),
    ),
    "late position": (
        Position(1.0, lever=(0.4, -0.2), delay="delay"),
        lambda chance: PositionMeasurement(chance.normal(), chance.normal(), 0.7, 0.9, 3.0, 0.4),
    ),
    "late velocity": (
        Velocity(0.3, scale="odometry_scale", delay="delay"),
        lambda chance: VelocityMeasurement(1.4 + 0.1 * chance.normal(), 0.3, 1.5, 0.3, 0.4),
    ),
    "plain late velocity": (
        Velocity(0.3, delay="delay"),
        lambda chance: VelocityMeasurement(1.4, 0.3, 1.5, 0.2, -0.6),
    ),
    "velocity": (
        Velocity(0.3, scale="odometry_scale"),
        lambda chance: VelocityMeasurement(1.4 + 0.1 * chance.normal(), 0.3, 1.5),
    ),
    "plain velocity": (Velocity(0.3), lambda chance: VelocityMeasurement(1.4, 0.3, 1.5, 0.2)),
    "heading": (
        Heading(0.1, bias="heading_bias"),
        lambda chance: HeadingMeasurement(3.1 + 0.1 * chance.normal()),
    ),
    "wheel speed": (
        WheelSpeed(0.1, scale="range_scale", bias="range_bias"),
        lambda chance: WheelSpeedMeasurement(1.5 + 0.1 * chance.normal(), 1.4, 0.5, -0.6),
    ),
    "plain wheel speed": (WheelSpeed(0.1), lambda chance: WheelSpeedMeasurement(1.5, 1.4, 0.5, 0.6, 0.2)),
    "plain heading": (Heading(0.1), lambda chance: HeadingMeasurement(3.1 + 0.1 * chance.normal(), 0.2)),
}


def _gaussian(chance: np.random.Generator) -> tuple[Any, Any]:
    root = (
        chance.normal(size=(SIZE, SIZE))
        * np.array([2.0, 2.0, 0.3, 0.01, 0.02, 0.02, 0.1, 0.1, 0.05])[:, None]
    )
    mean = chance.normal(size=SIZE) * np.array([3.0, 3.0, 2.0, 0.01, 0.0, 0.0, 0.1, 0.1, 0.05])
    mean[4:6] = 1.0
    return mean, root @ root.T


def _pair(members: int, seed: int) -> tuple[GaussianBank, list[ExtendedKalmanFilter[UnicycleControl]]]:
    chance = np.random.default_rng(seed)
    bank = GaussianBank(MOTION, SLOW, members)
    singles: list[ExtendedKalmanFilter[UnicycleControl]] = []
    for member in range(members):
        mean, covariance = _gaussian(chance)
        bank.set(member, mean, covariance)
        singles.append(ExtendedKalmanFilter(LinearisedUnicycle(MOTION, SLOW), mean, covariance))
    return bank, singles


def _agree(bank: GaussianBank, singles: list[ExtendedKalmanFilter[UnicycleControl]]) -> None:
    for member, single in enumerate(singles):
        away = bank.mean[member] - single.mean
        away[2] = np.remainder(away[2] + np.pi, 2 * np.pi) - np.pi
        np.testing.assert_allclose(away, 0.0, atol=1e-9)
        np.testing.assert_allclose(bank.covariance[member], single.covariance, rtol=1e-9, atol=1e-9)


def test_moves_every_member_as_one_filter_does() -> None:
    bank, singles = _pair(4, 1)
    chance = np.random.default_rng(2)
    for _ in range(50):
        control = UnicycleControl(chance.normal(), 0.4 * chance.normal(), 0.1 * chance.random(), 0.02)
        bank.predict(control, 0.2)
        for single in singles:
            single.predict(control, 0.2)
    _agree(bank, singles)


@pytest.mark.parametrize("kind", SENSORS)
def test_corrects_every_member_as_one_filter_does(kind: str) -> None:
    bank, singles = _pair(3, 3)
    chance = np.random.default_rng(4)
    sensor, draw = SENSORS[kind]
    for _ in range(5):
        measurement = draw(chance)
        said = bank.correct(bank.expect(sensor, measurement), np.ones(3, np.bool_))
        for member, single in enumerate(singles):
            correction = single.correct(LINEARISED[type(sensor)](sensor), measurement)
            assert said.nis[member] == pytest.approx(correction.nis, rel=1e-9, abs=1e-9)
            assert said.log_evidence[member] == pytest.approx(correction.log_evidence, rel=1e-9, abs=1e-9)
            assert said.accepted[member]
        bank.predict(UnicycleControl(0.3, 0.05), 0.2)
        for single in singles:
            single.predict(UnicycleControl(0.3, 0.05), 0.2)
    _agree(bank, singles)


def test_only_who_is_chosen_and_live_takes_a_measurement_and_the_gate_keeps_it_out() -> None:
    bank, _ = _pair(4, 5)
    bank.live[3] = False
    before = bank.mean.copy(), bank.covariance.copy()
    far = PositionMeasurement(500.0, 0.0, 0.5)
    said = bank.correct(bank.expect(Position(1.0), far), np.array([True, False, True, True]), gate=0.999)
    assert not said.accepted.any()
    assert np.isnan(said.nis[[1, 3]]).all()
    assert (said.nis[[0, 2]] > 100.0).all()
    np.testing.assert_array_equal(bank.mean, before[0])
    np.testing.assert_array_equal(bank.covariance, before[1])
    said = bank.correct(bank.expect(Position(1.0), far), np.array([True, False, True, True]))
    assert said.accepted.tolist() == [True, False, True, False]
    np.testing.assert_array_equal(bank.mean[[1, 3]], before[0][[1, 3]])


def test_more_noise_for_one_member_widens_that_one_alone() -> None:
    bank, singles = _pair(2, 6)
    control = UnicycleControl(1.0, 0.1)
    bank.predict(control, 0.5, distance_variance=np.array([0.0, 0.3]))
    for single, sigma in zip(singles, (0.0, 0.3**0.5), strict=True):
        single.predict(control._replace(distance_sigma=sigma), 0.5)
    _agree(bank, singles)


def test_the_spread_of_what_is_expected_is_that_of_the_covariance_and_all_can_be_set_alike() -> None:
    bank, _ = _pair(3, 8)
    said = bank.expect(Position(1.0, lever=(0.4, -0.2)), PositionMeasurement(1.0, 2.0))
    for member in range(3):
        jacobian = said.jacobian[member]
        spread = np.empty((2, 2))
        spread_of(bank.covariance, said.jacobian, member, spread)
        np.testing.assert_allclose(spread, jacobian @ bank.covariance[member] @ jacobian.T, rtol=1e-12)
    mean, covariance = _gaussian(np.random.default_rng(9))
    bank.live[1] = False
    bank.set_all(mean, covariance)
    assert bank.live.all()
    bank.live[:] = False
    bank.set_some([0, 2], mean, covariance)
    assert bank.live.tolist() == [True, False, True]
    np.testing.assert_array_equal(bank.mean[0], bank.mean[2])
    np.testing.assert_allclose(bank.covariance[1], covariance, rtol=1e-12)


def test_refuses_what_is_no_gaussian_no_control_and_no_sensor() -> None:
    bank, _ = _pair(1, 7)
    with pytest.raises(ValueError, match="at least one member"):
        GaussianBank(MOTION, members=0)
    with pytest.raises(ValueError, match="a mean of north"):
        bank.set(0, np.zeros(3), np.eye(3))
    with pytest.raises(ValueError, match="finite"):
        bank.predict(UnicycleControl(np.nan, 0.0), 0.1)
    with pytest.raises(TypeError, match="not among"):
        bank.expect(object(), None)
    with pytest.raises(ValueError, match="residuals must be finite"):
        bank.correct(bank.expect(Position(1.0), PositionMeasurement(np.nan, 0.0)), np.ones(1, np.bool_), None)
