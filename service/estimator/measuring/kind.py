"""What a kind of measurement must say of itself, and the values that pass between a reading and its sensor model."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from filters.motion.model import Motion
from filters.sensing import Sensor as SensorModel
from service.config import Beacon, Sensor
from service.estimator.controls import Controls
from service.estimator.start import DELAY
from service.geodesy import LocalFrame

NOMINAL_OUTLIERS = 0.01
"""Share of readings that mean nothing by which health judges a sensor that claims to have none."""


def delay_state(settings: Sensor) -> str | None:
    """Return the slow state of the sensor's delay, if it is to be estimated."""
    return DELAY if "delay" in settings.estimate else None


class Place(NamedTuple):
    """What the estimator knows when a reading is turned into a measurement."""

    time: int
    frame: LocalFrame | None
    down: float
    controls: Controls
    motion: Motion[Any, Any] | None = None


class Surroundings(NamedTuple):
    """What is known of the place: beacons, and the landmarks' north and east (metres), by their number.

    ``height`` names the state that is the vehicle's down, if it is one; ``rolls`` tells a vehicle whose speed is a
    control from one whose velocity is a state. ``speed_noise`` (m/√s) is the control's, ``wheel_radius`` in metres.
    """

    beacons: dict[int, Beacon]
    landmarks: dict[int, tuple[float, float]]
    height: str | None = None
    rolls: bool = True
    speed_noise: float = 0.0
    wheel_radius: float | None = None


class Bound(Protocol):
    """One ``[[sensor]]`` of the configuration, as its kind sees it.

    ``memory`` is what the kind remembers of the one who says the reading at hand.
    """

    settings: Sensor
    surroundings: Surroundings
    model: SensorModel[Any]
    memory: Any

    def sigma(self, claimed: float | None) -> float:
        """Return the larger of what the configuration and the reading say; each knows of errors the other does not."""
        ...

    def spread(self, claimed: float | None, place: Place) -> float:
        """Return the standard deviation to weigh a reading by: its sigma, its timing, and how alike its errors are."""
        ...


@dataclass(frozen=True)
class Kind:
    """One kind of measurement.

    Attributes
    ----------
    readings : tuple[type, ...]
        What it is made of.
    model : callable
        Makes the sensor model of :mod:`filters.sensing` that the settings ask for.
    measure : callable
        Makes the model's measurement of a reading, or says in a string why it cannot be one.
    default_sigma : float
        Used where neither the configuration nor the reading says how good it is.
    spans : tuple[float, ...], or a callable that says it of the surroundings
        How widely outliers scatter, one for each dimension of the reading.
    least_sigma : float
        What no reading is better than, whatever it claims.
    correlation : float
        Seconds over which a sensor's errors stay alike. Readings closer together repeat each other's errors: each is
        given the variance that makes all of them together worth one independent reading per this time.
    absolute : bool
        Whether it says where the vehicle is (a position, a range), not only how it moves or points.
    shifted : bool
        Whether a stamp that is off shifts it by the way that was driven meanwhile.
    wants : callable
        Which of the readings are taken, given the settings.
    suffix : callable
        What tells one reading's origin from another's in the record: the beacon.
    label : callable
        What tells two sensors of the kind apart that have one link.
    part : callable
        Which part of a reading a sensor takes where several may have one each: the wheel; ``None``: all of it.
    memory : callable
        Makes what is remembered of each speaker, if anything is.
    tempers : bool
        Whether its measurements themselves say how many of them share one independent error, by what they are of.
    alone : bool
        Whether only one speaker is heard at a time, because each has errors of its own that last.
    """

    readings: tuple[type, ...]
    model: Callable[[Sensor, Surroundings], SensorModel[Any]]
    measure: Callable[[Bound, Any, Place], Any]
    default_sigma: float
    spans: tuple[float, ...] | Callable[[Surroundings], tuple[float, ...]]
    least_sigma: float = 0.0
    correlation: float = 0.0
    absolute: bool = False
    shifted: bool = False
    wants: Callable[[Sensor, Any], bool] = lambda settings, reading: True
    suffix: Callable[[Any], str] = lambda reading: ""
    label: Callable[[Sensor], str] = lambda settings: ""
    part: Callable[[Sensor], int | None] = lambda settings: None
    memory: Callable[[Sensor, Surroundings], Any] | None = None
    tempers: bool = False
    alone: bool = False

    def log_outlier_density(self, settings: Sensor, surroundings: Surroundings) -> float:
        """Return the logarithm of the outlier part's density in the reading's own space.

        A model without that part is judged as if it had a small one: nothing would ever surprise it.
        """
        spans = self.spans(surroundings) if callable(self.spans) else self.spans
        return math.log(settings.outliers or NOMINAL_OUTLIERS) - math.fsum(map(math.log, spans))


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
    lasting : float
        Variance of the part of the error that lasts from reading to reading for about a minute, m²; 0: none.
    independent : bool
        Whether its errors are said to be independent of each other.
    timing : float
        How well the latency is known that was taken off its stamp, seconds: all its readings share that error.
    receiver : str or None
        What the lasting error is named after; ``None``: of a speaker that has no state of its own.
    share : float
        The power of its likelihood that it weighs by, of an independent reading.
    outliers : float
        Which share of its sensor's readings is said to be outliers.
    """

    name: str
    model: SensorModel[Any]
    value: Any
    absolute: bool
    log_outlier: float
    repeats: float
    lasting: float = 0.0
    independent: bool = False
    timing: float = 0.0
    receiver: str | None = None
    share: float = 1.0
    outliers: float = NOMINAL_OUTLIERS

    def surprise(self, log_mean: float) -> float:
        """Return the probability, 0…1, that the reading is the outlier part's, given its evidence."""
        if math.isnan(log_mean):
            return 0.0
        return math.exp(min(0.0, self.log_outlier - log_mean / self.share))


class Refusal(NamedTuple):
    """A reading that could not be used: whose, and why."""

    name: str
    reason: str
