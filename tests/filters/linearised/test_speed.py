"""The linearised speeds: Jacobians against numerical differentiation, values against the sensor models' innovations."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

from filters.extended_kalman import LinearisedSensor, numerical_jacobian
from filters.linearised import LinearisedGroundSpeed, LinearisedWheelSpeed
from filters.sensing.speed import GroundSpeed, GroundSpeedMeasurement, WheelSpeed, WheelSpeedMeasurement

ROLLING = ("north", "east", "heading", "gyro_bias", "odometry_scale", "k", "b")
MOVING = ("north", "east", "heading", "velocity_north", "velocity_east", "k", "b")
CASES: list[tuple[tuple[str, ...], LinearisedSensor[Any], Any]] = [
    (ROLLING, LinearisedWheelSpeed(WheelSpeed(0.2)), WheelSpeedMeasurement(3.0, 2.9, 0.3, -0.5)),
    (
        ROLLING,
        LinearisedWheelSpeed(WheelSpeed(0.2, scale="k", bias="b")),
        WheelSpeedMeasurement(-3.0, -2.9, 0.3, 0.5, 0.4),
    ),
    (MOVING, LinearisedGroundSpeed(GroundSpeed(0.2)), GroundSpeedMeasurement(3.0)),
    (MOVING, LinearisedGroundSpeed(GroundSpeed(0.2, scale="k", bias="b")), GroundSpeedMeasurement(3.0, 0.4)),
]


@pytest.mark.parametrize(("names", "model", "measurement"), CASES)
def test_the_jacobian_is_the_derivative(
    names: tuple[str, ...], model: LinearisedSensor[Any], measurement: Any
) -> None:
    """To 1e-7 at 20 random states: central differences have about 1e-9."""
    rows = {name: row for row, name in enumerate(names)}
    rng = np.random.default_rng(3)
    for mean in rng.normal(0.0, 1.0, (20, len(names))):
        said = model.expect(rows, mean, measurement)
        numerical = numerical_jacobian(lambda x: model.expect(rows, x, measurement).expected, mean)
        np.testing.assert_allclose(said.jacobian, numerical, atol=1e-7)
        sensor = cast(Any, model).sensor
        innovation = float(sensor.innovation(dict(zip(names, mean, strict=True)), measurement))
        np.testing.assert_allclose(said.measured - said.expected, [innovation])
        assert said.noise[0, 0] == pytest.approx((measurement.sigma or 0.2) ** 2)


def test_where_the_vehicle_stands_there_is_no_direction() -> None:
    rows = {name: row for row, name in enumerate(MOVING)}
    said = LinearisedGroundSpeed(GroundSpeed(0.2)).expect(rows, np.zeros(7), GroundSpeedMeasurement(0.1))
    assert not said.jacobian.any()
    assert said.expected[0] == 0.0


def test_what_a_path_leaves_open_is_not_counted_twice() -> None:
    rows = {name: row for row, name in enumerate(MOVING)}
    measurement = GroundSpeedMeasurement(1.0, 0.3, 4.0)
    said = LinearisedGroundSpeed(GroundSpeed(0.2)).expect(rows, np.ones(7), measurement)
    assert said.noise[0, 0] == pytest.approx(0.09)
    assert said.expected[0] == pytest.approx(2.0**0.5)
