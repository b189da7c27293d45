"""Altitude: by a barometer, or by whatever else says how high the vehicle is and is no satellite receiver.

A pressure is an altitude in the standard atmosphere, and what the weather makes of that is the sensor's bias: without
``estimate = ["bias"]`` a pressure says nothing. Several barometers have a bias each; so of one sensor only one speaks.
"""

from __future__ import annotations

from typing import cast

from drivers.sample import Altitude as AltitudeReading
from drivers.sample import Pressure
from filters.sensing.altitude import Altitude, AltitudeMeasurement
from service.atmosphere import pressure_altitude
from service.config import Sensor
from service.estimator.measuring.kind import Bound, Kind, Place, Surroundings
from service.estimator.start import slow_state

DEFAULT_SIGMA = 0.5
SPAN = 1000.0

NO_ORIGIN, NEEDS_BIAS = "no_origin", "pressure_needs_estimate_bias"


def _model(settings: Sensor, _surroundings: Surroundings) -> Altitude:
    return Altitude(
        settings.sigma or DEFAULT_SIGMA,
        outliers=settings.outliers,
        span=SPAN,
        bias=slow_state(settings, "bias") if "bias" in settings.estimate else None,
    )


class Zero:
    """Where a speaker's altitudes are counted from, metres above the sea.

    It is the origin; where that is unknown and the bias is estimated, what the first reading said.
    """

    def __init__(self) -> None:
        self._altitude: float | None = None

    def above(self, altitude: float, place: Place, biased: bool) -> float | None:
        """Return an altitude less the zero, or ``None`` while there is none."""
        if self._altitude is None and place.frame is not None:
            self._altitude = place.frame.origin.altitude
        elif self._altitude is None and biased:
            self._altitude = altitude
        return None if self._altitude is None else altitude - self._altitude


def _measure(sensor: Bound, reading: AltitudeReading | Pressure, place: Place) -> AltitudeMeasurement | str:
    biased = "bias" in sensor.settings.estimate
    if isinstance(reading, Pressure):
        if not biased:
            return NEEDS_BIAS
        altitude, claimed = pressure_altitude(reading.absolute), None
    else:
        altitude, claimed = reading.altitude, reading.sigma
    above = cast(Zero, sensor.memory).above(altitude, place, biased)
    return NO_ORIGIN if above is None else AltitudeMeasurement(above, sensor.spread(claimed, place))


ALTITUDE = Kind(
    (AltitudeReading, Pressure),
    _model,
    _measure,
    default_sigma=DEFAULT_SIGMA,
    spans=(SPAN,),
    least_sigma=0.05,
    correlation=1.0,
    label=lambda settings: "" if settings.source is None else f"/{settings.source}",
    memory=lambda settings, surroundings: Zero(),
    alone=True,
)
