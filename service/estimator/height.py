"""Height where the belief leaves it out: a random walk of its own, in a Kalman filter.

It is corrected by whatever fix brings an altitude, and by altitudes as such, whose biases are its further states.
Ranges need it, and it comes out with an honest variance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from drivers.sample import AnyReading, GeodeticPosition, LocalPosition
from filters.belief import Evidence
from filters.kalman import KalmanFilter
from filters.linearised.altitude import LinearisedAltitude
from filters.motion.constant_velocity import DOWN
from filters.motion.learned import Learned
from filters.sensing.altitude import Altitude, AltitudeMeasurement
from service.config import Configuration
from service.estimator.start import Anchor, altitude_biases
from service.geodesy import LocalFrame

CLIMB = 0.05
"""m per √s; how fast the height wanders, uncorrected."""

CLIMB_MEASURED = 0.3
"""The same where altitudes tell how: a slope of one in ten at 2 m/s, for seconds. The weather must not pass for it."""


def height_state(configuration: Configuration) -> str | None:
    """Return the name of the state that is the vehicle's down, or ``None`` where a filter of its own keeps it.

    A tag's particles have it: in three dimensions, and on the plane unless position fixes bring altitudes.
    """
    if configuration.vehicle.motion != "constant_velocity":
        return None
    fixes = any(sensor.kind == "position" for sensor in configuration.sensor)
    return None if fixes and configuration.motion.dimensions == 2 else DOWN


def climb_of(configuration: Configuration) -> float:
    """Return how fast the height wanders, m per √s."""
    measured = any(sensor.kind == "altitude" for sensor in configuration.sensor)
    return CLIMB_MEASURED if measured else CLIMB


def height_of(configuration: Configuration) -> Height:
    """Return the height of a vehicle whose particles do not have it."""
    return Height(altitude_biases(configuration), climb_of(configuration))


class Height:
    """Down and its variance, or nothing while neither a start nor a fix has brought any.

    Parameters
    ----------
    biases : sequence of Learned
        Of the altitudes that correct it.
    climb : float
        How fast it wanders, m per √s.
    """

    def __init__(self, biases: Sequence[Learned] = (), climb: float = CLIMB) -> None:
        self._climb = climb
        self._learned = list(biases)
        self._rows = {name: row for row, name in enumerate((DOWN, *(bias.name for bias in biases)))}
        self._walks = np.square([climb, *(bias.walk for bias in biases)])
        self._belief: KalmanFilter | None = None

    def begin(self, anchor: Anchor | None) -> None:
        """Begin anew where ``anchor`` has it, if it does."""
        self._belief = None
        if anchor is not None and anchor.position[2] is not None:
            self._begin(anchor.position[2], anchor.sigma[2] ** 2)

    def _begin(self, down: float, variance: float) -> None:
        mean = np.zeros(len(self._rows))
        mean[0] = down
        self._belief = KalmanFilter(mean, np.diag([variance, *(bias.sigma**2 for bias in self._learned)]))

    def wander(self, duration: float) -> None:
        """Let ``duration`` seconds pass."""
        if self._belief is not None:
            self._belief.predict(np.eye(len(self._rows)), np.diag(self._walks * duration))

    def correct(self, down: float, variance: float) -> None:
        """Weigh in a measured down (m, m²); the first one is a beginning."""
        if self._belief is None:
            self._begin(down, variance)
        else:
            self._belief.correct(np.array([down]), np.eye(1, len(self._rows)), np.array([[variance]]))

    def weigh(
        self, sensor: Altitude, measurement: AltitudeMeasurement, log_outlier: float, age: float = 0.0
    ) -> Evidence | None:
        """Weigh in an altitude, unless it is more likely an outlier; ``None`` while there is no height to compare with.

        Parameters
        ----------
        log_outlier : float
            Logarithm of the outlier part's density, 1/m.
        age : float
            Seconds since it was measured, in which the height went on.

        Returns
        -------
        Evidence
            ``log_mean`` is the log density that the height gave to it, the outlier part left out.
        """
        if sensor.refusal(measurement) is not None:
            return Evidence(math.nan, math.nan, accepted=False)
        if self._belief is None:
            if sensor.bias is not None:
                return None
            self._begin(-measurement.altitude, sensor.spread(measurement) ** 2)
            return Evidence(math.nan, 0.0, accepted=True)
        belief = self._belief
        said = LinearisedAltitude(sensor).expect(self._rows, belief.mean, measurement)
        noise = said.noise + self._climb**2 * age
        innovation = float(said.measured[0] - said.expected[0])
        variance = float((said.jacobian @ belief.covariance @ said.jacobian.T + noise)[0, 0])
        evidence = -0.5 * (innovation**2 / variance + math.log(2.0 * math.pi * variance))
        if evidence >= log_outlier:
            belief.correct(said.measured, said.jacobian, noise)
        return Evidence(evidence, innovation, accepted=True)

    @property
    def moments(self) -> tuple[float, float] | None:
        """Down (m) and its variance (m²), or ``None`` while unknown."""
        if self._belief is None:
            return None
        return float(self._belief.mean[0]), float(self._belief.covariance[0, 0])

    @property
    def biases(self) -> dict[str, tuple[float, float]]:
        """Every bias with its standard deviation, metres; none while the height is unknown."""
        if self._belief is None:
            return {}
        mean, variance = self._belief.mean, np.diagonal(self._belief.covariance)
        return {
            bias.name: (float(mean[row]), math.sqrt(float(variance[row])))
            for row, bias in enumerate(self._learned, 1)
        }

    @property
    def down(self) -> float:
        """Down, or the origin's own height while unknown."""
        return 0.0 if self._belief is None else float(self._belief.mean[0])


def down_of(reading: AnyReading, frame: LocalFrame | None) -> tuple[float, float] | None:
    """Return the down (m) and its standard deviation that a position reading says, or ``None``."""
    if isinstance(reading, GeodeticPosition) and reading.altitude is not None and frame is not None:
        sigma = reading.sigma_vertical or 2.0 * (reading.sigma_horizontal or 3.0)
        return frame.origin.altitude - reading.altitude, sigma
    if isinstance(reading, LocalPosition) and reading.down is not None:
        return reading.down, reading.sigma_vertical or 2.0 * (reading.sigma_horizontal or 1.0)
    return None
