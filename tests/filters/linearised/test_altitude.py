"""The linearised altitude against the particle filter's own innovation, of which it is the derivative."""

from __future__ import annotations

import numpy as np
import pytest

from filters.linearised import LinearisedAltitude
from filters.sensing.altitude import Altitude, AltitudeMeasurement

NAMES = ("north", "east", "heading", "down", "weather")
ROWS = {name: row for row, name in enumerate(NAMES)}
MEAN = np.array([3.0, -2.0, 0.4, -31.0, 2.5])


@pytest.mark.parametrize("bias", [None, "weather"])
def test_it_expects_what_the_sensor_model_does(bias: str | None) -> None:
    sensor, measurement = Altitude(0.7, bias=bias), AltitudeMeasurement(35.0, 0.4 if bias else None)
    said = LinearisedAltitude(sensor).expect(ROWS, MEAN, measurement)
    innovation = sensor.innovation(dict(zip(NAMES, MEAN, strict=True)), measurement)
    np.testing.assert_allclose(said.measured - said.expected, [innovation])
    np.testing.assert_array_equal(said.jacobian, [[0.0, 0.0, 0.0, -1.0, 1.0 if bias else 0.0]])
    np.testing.assert_allclose(said.noise, [[0.16 if bias else 0.49]])
