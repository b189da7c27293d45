"""Which sensor model a reading goes to, and the reading in that model's terms.

The one place that knows both languages: a :class:`~drivers.sample.Sample` says what the wire said; a model of
:mod:`filters.sensing` wants metres north and east of the origin, with a sigma. A reading that cannot be expressed (no
origin yet, no such beacon) is refused with a reason, and the reason is counted.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from drivers.sample import (
    GeodeticPosition,
    Heading,
    Inertial,
    LocalPosition,
    Range,
    Sample,
    Velocity,
)
from filters.sensing import Heading as HeadingModel
from filters.sensing import (
    HeadingMeasurement,
    Position,
    PositionMeasurement,
    RangeMeasurement,
    VelocityMeasurement,
)
from filters.sensing import Range as RangeModel
from filters.sensing import Sensor as SensorModel
from filters.sensing import Velocity as VelocityModel
from service.config import Beacon, Sensor
from service.estimator.controls import Controls
from service.geodesy import LocalFrame

SECOND = 1_000_000_000
MAGNETIC_INTERVAL = SECOND // 5
"""A magnetometer's errors hardly change between readings: five a second carry all that it knows."""

DEFAULT_SIGMA = {"position": 3.0, "velocity": 0.3, "range": 0.5, "heading": 0.1}
"""Used where neither the configuration nor the reading says how good it is: m, m/s, m, rad."""

LEAST_SIGMA = {"position": 0.0, "velocity": 0.1, "range": 0.0, "heading": 0.02}
"""What no reading is better than, whatever it claims: a receiver's velocity is filtered, and lags in turns."""

CORRELATION = {"position": 1.0, "velocity": 1.0, "range": 0.0, "heading": 1.0}
"""Seconds over which a sensor's errors stay alike. Readings closer together repeat each other's errors: each is given
the variance that makes all of them together worth one independent reading per this time."""

SHORTEST_INTERVAL = 1e-3
"""Seconds; readings of the same instant count as so far apart: two receivers with one clock, or one said twice."""

TIMING = 0.02
"""Seconds by which a stamp may be off after its clock was mapped: at speed v, v times this many metres."""

SPAN = {"position": 1000.0, "velocity": 100.0, "range": 200.0, "heading": 2 * math.pi}
"""How widely outliers scatter, per dimension: m, m/s, m, rad."""

NOMINAL_OUTLIERS = 0.01
"""Share of readings that mean nothing by which health judges a sensor that claims to have none."""

SLOWEST_COURSE = 0.3
"""m/s; below this the direction of a measured velocity is noise."""


class Place(NamedTuple):
    """What the estimator knows when a reading is turned into a measurement."""

    time: int
    frame: LocalFrame | None
    down: float
    controls: Controls


class Measurement(NamedTuple):
    """A reading in its model's terms.

    Attributes
    ----------
    name : str
        Kind, link and beacon: ``range/autopilot/5``.
    model : SensorModel
        What weighs the particles.
    value : Any
        The model's own measurement type.
    absolute : bool
        Whether it says where the vehicle is (a position, a range), not only how it moves or points.
    log_outlier : float
        Logarithm of the outlier part's density, in the reading's own space.
    repeats : float
        How many readings share one independent error; the sigma of ``value`` has it already.
    """

    name: str
    model: SensorModel[Any]
    value: Any
    absolute: bool
    log_outlier: float
    repeats: float

    def surprise(self, log_mean: float) -> float:
        """Return the probability, 0…1, that the reading is the outlier part's, given its evidence."""
        if math.isnan(log_mean):
            return 0.0
        return math.exp(min(0.0, self.log_outlier - log_mean))


class Refusal(NamedTuple):
    """A reading that could not be used: whose, and why."""

    name: str
    reason: str


class BoundSensor:
    """One ``[[sensor]]`` of the configuration with its model.

    Parameters
    ----------
    settings : Sensor
        Kind, link, sigma, outliers, slow states.
    beacons : dict[int, Beacon]
        The beacons of the configuration, by id.
    """

    def __init__(self, settings: Sensor, beacons: dict[int, Beacon]) -> None:
        self.settings = settings
        self.beacons = beacons
        self.delay = round(settings.delay_ms * 1e6)
        self._measure = _MEASURES[settings.kind]
        self._last_magnetic = -(2**62)
        self._last_time = -(2**62)
        self._repeats = 1.0
        self.model = model_of(settings)
        self._log_outlier = log_outlier_density(settings)

    @property
    def title(self) -> str:
        """Kind and link, as the configuration names them."""
        return f"{self.settings.kind}/{self.settings.link or '*'}"

    def wants(self, sample: Sample) -> bool:
        """Say whether ``sample`` is this sensor's."""
        settings = self.settings
        if settings.link is not None and sample.link != settings.link:
            return False
        if settings.source is not None and sample.source != settings.source:
            return False
        return isinstance(sample.reading, _READINGS[settings.kind]) and self._in_turn(sample)

    def _in_turn(self, sample: Sample) -> bool:
        reading = sample.reading
        if isinstance(reading, Range):
            return self.settings.beacons is None or reading.beacon in self.settings.beacons
        if not isinstance(reading, Inertial):
            return True
        if reading.magnetic_field is None or sample.time - self._last_magnetic < MAGNETIC_INTERVAL:
            return False
        self._last_magnetic = sample.time
        return True

    def name(self, sample: Sample) -> str:
        """Return the name under which a sample's fate is recorded: kind, link, and the beacon where there is one."""
        suffix = f"/{sample.reading.beacon}" if isinstance(sample.reading, Range) else ""
        return f"{self.settings.kind}/{sample.link}{suffix}"

    def measure(self, sample: Sample, place: Place) -> Measurement | Refusal:
        """Return ``sample`` as a measurement, or why it cannot be one."""
        outcome = self._measure(self, sample.reading, place)
        name = self.name(sample)
        if isinstance(outcome, str):
            return Refusal(name, outcome)
        return Measurement(
            name,
            self.model,
            outcome,
            self.settings.kind in ("position", "range"),
            self._log_outlier,
            self._repeats,
        )

    def sigma(self, claimed: float | None) -> float:
        """Return the larger of what the configuration and the reading say; each knows of errors the other does not."""
        known = [value for value in (self.settings.sigma, claimed) if value is not None and value > 0]
        return max(LEAST_SIGMA[self.settings.kind], max(known, default=DEFAULT_SIGMA[self.settings.kind]))

    def spread(self, claimed: float | None, place: Place) -> float:
        """Return the standard deviation to weigh a reading by: its sigma, its timing, and how alike its errors are."""
        sigma = self.sigma(claimed)
        if self.settings.kind in ("position", "range"):
            sigma = math.hypot(sigma, TIMING * place.controls.speed(place.time))
        self._count_repeats(place.time)
        return sigma * math.sqrt(self._repeats)

    def _count_repeats(self, time: int) -> None:
        """Note how many readings share one independent error, from the interval to the one before."""
        interval = max(SHORTEST_INTERVAL, (time - self._last_time) / SECOND)
        self._last_time = time
        self._repeats = max(1.0, CORRELATION[self.settings.kind] / interval)


def model_of(settings: Sensor) -> SensorModel[Any]:
    """Return the sensor model of :mod:`filters.sensing` that ``settings`` ask for."""
    sigma = settings.sigma or DEFAULT_SIGMA[settings.kind]
    if settings.kind == "range":
        scale = "range_scale" if "scale" in settings.estimate else None
        bias = "range_bias" if "bias" in settings.estimate else None
        return RangeModel(sigma, outliers=settings.outliers, span=SPAN["range"], scale=scale, bias=bias)
    if settings.kind == "position":
        return Position(sigma, outliers=settings.outliers, span=SPAN["position"])
    if settings.kind == "velocity":
        return VelocityModel(sigma, outliers=settings.outliers, span=SPAN["velocity"], scale="odometry_scale")
    return HeadingModel(sigma, outliers=settings.outliers)


def position_of(
    reading: GeodeticPosition | LocalPosition, frame: LocalFrame | None
) -> tuple[float, float, float | None] | None:
    """Return north, east and (where it is said) down of a position reading; ``None`` without an origin."""
    if isinstance(reading, LocalPosition):
        return reading.north, reading.east, reading.down
    if frame is None:
        return None
    altitude = frame.origin.altitude if reading.altitude is None else reading.altitude
    north, east, _ = frame.ned_from_geodetic(reading.latitude, reading.longitude, altitude)
    return north, east, None if reading.altitude is None else frame.origin.altitude - reading.altitude


def log_outlier_density(settings: Sensor) -> float:
    """Return the logarithm of the outlier part's density in the reading's own space.

    A model without that part is judged as if it had a small one: nothing would ever surprise it.
    """
    dimensions = 2 if settings.kind in ("position", "velocity") else 1
    return math.log(settings.outliers or NOMINAL_OUTLIERS) - dimensions * math.log(SPAN[settings.kind])


def _measure_position(sensor: BoundSensor, reading: Any, place: Place) -> Any:
    fix = position_of(reading, place.frame)
    if fix is None:
        return "no_origin"
    return PositionMeasurement(fix[0], fix[1], sensor.spread(reading.sigma_horizontal, place))


def _measure_velocity(sensor: BoundSensor, reading: Any, place: Place) -> Any:
    speed = place.controls.speed(place.time)
    if abs(speed) < SLOWEST_COURSE:
        return "standing"
    return VelocityMeasurement(reading.north, reading.east, speed, sensor.spread(reading.sigma, place))


def _measure_range(sensor: BoundSensor, reading: Any, place: Place) -> Any:
    where = beacon_position(reading, sensor.beacons, place.frame)
    if where is None:
        return "no_beacon"
    north, east, down = where
    return RangeMeasurement(
        reading.distance, north, east, down - place.down, sensor.spread(reading.sigma, place)
    )


def _measure_heading(sensor: BoundSensor, reading: Any, place: Place) -> Any:
    if isinstance(reading, Heading):
        return HeadingMeasurement(reading.heading, sensor.spread(reading.sigma, place))
    forward, right, _ = reading.magnetic_field
    if math.hypot(forward, right) < 1e-6:
        return "no_horizontal_field"
    magnetic = math.atan2(-right, forward)
    return HeadingMeasurement(
        magnetic + math.radians(sensor.settings.declination_deg), sensor.spread(None, place)
    )


def beacon_position(
    reading: Range, beacons: dict[int, Beacon], frame: LocalFrame | None
) -> tuple[float, float, float] | None:
    """Return where the beacon of ``reading`` stands (north, east, down): as configured, else as it says itself."""
    beacon = beacons.get(reading.beacon)
    if beacon is not None and beacon.position is not None:
        return beacon.position
    if frame is None:
        return None
    if beacon is not None and beacon.latitude is not None and beacon.longitude is not None:
        altitude = frame.origin.altitude if beacon.altitude is None else beacon.altitude
        return frame.ned_from_geodetic(
            math.radians(beacon.latitude), math.radians(beacon.longitude), altitude
        )
    if reading.latitude is not None and reading.longitude is not None:
        altitude = frame.origin.altitude if reading.altitude is None else reading.altitude
        return frame.ned_from_geodetic(reading.latitude, reading.longitude, altitude)
    return None


_READINGS: dict[str, tuple[type, ...]] = {
    "position": (GeodeticPosition, LocalPosition),
    "velocity": (Velocity,),
    "range": (Range,),
    "heading": (Heading, Inertial),
}

_MEASURES = {
    "position": _measure_position,
    "velocity": _measure_velocity,
    "range": _measure_range,
    "heading": _measure_heading,
}
