"""Which sensor model a reading goes to, and the reading in that model's terms.

The one place that knows both languages: a :class:`~drivers.sample.Sample` says what the wire said; a model of
:mod:`filters.sensing` wants metres north and east of the origin, with a sigma. A reading that cannot be expressed (no
origin yet, no such beacon) is refused with a reason, and the reason is counted. What differs from kind to kind lies in
:mod:`service.estimator.measuring`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from drivers.sample import SECOND, Inertial, Sample
from filters.sensing import PositionMeasurement
from service.config import Sensor
from service.estimator.controls import Controls
from service.estimator.measuring import (
    KINDS,
    Measurement,
    Place,
    Refusal,
    Surroundings,
    position_of,
    surroundings_of,
)
from service.estimator.measuring.kind import NOMINAL_OUTLIERS
from service.estimator.start import receiver_name

MAGNETIC_INTERVAL = SECOND // 5
"""A magnetometer's errors hardly change between readings: five a second carry all that it knows."""

SHORTEST_INTERVAL = 1e-3
"""Seconds; readings of the same instant count as so far apart: two receivers with one clock, or one said twice."""

TIMING = 0.02
"""Seconds by which a stamp may be off after its clock was mapped: at speed v, v times this many metres."""

LONG_SILENCE = 30 * SECOND
"""Of a sensor that hears one speaker at a time: each has errors of its own that last, so a change costs accuracy."""

MOST_SPEAKERS = 64
"""Sources are named from outside: of more than so many that one sensor hears all are forgotten."""

CONTROL = "control"
"""Why a speed is no measurement: it is the control, or part of it."""

__all__ = [
    "BoundSensor",
    "Measurement",
    "Place",
    "Refusal",
    "Surroundings",
    "position_of",
    "surroundings_of",
    "takes",
]


def takes(kind: str) -> tuple[type, ...]:
    """Return the readings that a kind of sensor is made of; none for a kind that is not in this version."""
    return KINDS[kind].readings if kind in KINDS else ()


class BoundSensor:
    """One ``[[sensor]]`` of the configuration with its model.

    Parameters
    ----------
    settings : Sensor
        Kind, link, sigma, outliers, slow states.
    surroundings : Surroundings
        The beacons and landmarks of the configuration, by id.

    Attributes
    ----------
    title : str
        Kind and link, as the configuration names them.
    readings : tuple[type, ...]
        What it may want.
    """

    def __init__(self, settings: Sensor, surroundings: Surroundings) -> None:
        self.settings = settings
        self.surroundings = surroundings
        self.delay = round(settings.delay_ms * 1e6)
        self._kind = KINDS[settings.kind]
        self.memory: Any = None
        self._memories: dict[tuple[str, str], Any] = {}
        self._speaker: tuple[str, str] | None = None
        self._spoke = -(2**62)
        self.part = self._kind.part(settings)
        self._label = self._kind.label(settings)
        self.title = f"{settings.kind}/{settings.link or '*'}{self._label}"
        self.readings = self._kind.readings
        self._beside = settings.kind == "speed" and surroundings.rolls
        self._last_magnetic = -(2**62)
        self._last_time = -(2**62)
        self._repeats = 1.0
        self.model = self._kind.model(settings, surroundings)
        self._log_outlier = self._kind.log_outlier_density(settings, surroundings)
        given = settings.correlation_s
        self._correlation = self._kind.correlation if given is None or self._kind.tempers else given
        self._lasts = settings.kind == "position" and self._correlation > 0.0
        self._receiver = receiver_name(settings)
        self._leader: tuple[str, str] | None = None

    def wants(self, sample: Sample) -> bool:
        """Say whether ``sample`` is this sensor's."""
        settings, kind = self.settings, self._kind
        if settings.link is not None and sample.link != settings.link:
            return False
        if settings.source is not None and sample.source != settings.source:
            return False
        if not isinstance(sample.reading, kind.readings) or not kind.wants(settings, sample.reading):
            return False
        if self._kind.alone and not self._speaks(sample):
            return False
        return not isinstance(sample.reading, Inertial) or self._in_turn(sample.time)

    def _speaks(self, sample: Sample) -> bool:
        """Say whether the sample is of the one speaker; another takes over when that has been silent for long."""
        speaker = (sample.link, sample.source)
        if speaker != self._speaker and sample.time - self._spoke < LONG_SILENCE:
            return False
        self._speaker, self._spoke = speaker, sample.time
        return True

    def _in_turn(self, time: int) -> bool:
        if time - self._last_magnetic < MAGNETIC_INTERVAL:
            return False
        self._last_magnetic = time
        return True

    def is_control(self, sample: Sample, controls: Controls) -> bool:
        """Say whether a speed is in the control by now: compared with that, it would vouch for itself."""
        return self._beside and controls.holds(sample)

    def name(self, sample: Sample) -> str:
        """Return the name under which a sample's fate is recorded: kind, link, and the beacon where there is one."""
        return f"{self.settings.kind}/{sample.link}{self._label}{self._kind.suffix(sample.reading)}"

    def measure(self, sample: Sample, place: Place) -> Measurement | Refusal:
        """Return ``sample`` as a measurement, or why it cannot be one."""
        name = self.name(sample)
        if self.is_control(sample, place.controls):
            return Refusal(name, CONTROL)
        if self._kind.memory is not None:
            self.memory = self._memory_of(sample, self._kind.memory)
        outcome = self._kind.measure(self, sample.reading, place)
        if isinstance(outcome, str):
            return Refusal(name, outcome)
        share = float(outcome.share) if self._kind.tempers else 1.0
        lasting = 0.0
        if self._lasts and isinstance(outcome, PositionMeasurement) and outcome.sigma_north:
            lasting = outcome.sigma_north**2 / self._repeats
        return Measurement(
            name,
            self.model,
            outcome,
            self._kind.absolute,
            self._log_outlier,
            self._repeats / share,
            lasting,
            self._correlation == 0.0 and not (self._kind.tempers and self.settings.correlation_s),
            TIMING if self.delay > 0 else 0.0,
            self._receiver if lasting > 0.0 and self._leads(sample) else None,
            share,
            self.settings.outliers or NOMINAL_OUTLIERS,
        )

    def _leads(self, sample: Sample) -> bool:
        """Say whether the sample is of the speaker that was heard first: each has errors of its own."""
        speaker = (sample.link, sample.source)
        if self._leader is None:
            self._leader = speaker
        return speaker == self._leader

    def _memory_of(self, sample: Sample, make: Callable[[Sensor, Surroundings], Any]) -> Any:
        speaker = (sample.link, sample.source)
        if speaker not in self._memories:
            if len(self._memories) >= MOST_SPEAKERS:
                self._memories.clear()
            self._memories[speaker] = make(self.settings, self.surroundings)
        return self._memories[speaker]

    def sigma(self, claimed: float | None) -> float:
        """Return the larger of what the configuration and the reading say; each knows of errors the other does not."""
        said = claimed if self.settings.claims else None
        known = [value for value in (self.settings.sigma, said) if value is not None and value > 0]
        return max(self._kind.least_sigma, max(known, default=self._kind.default_sigma))

    def spread(self, claimed: float | None, place: Place) -> float:
        """Return the standard deviation to weigh a reading by: its sigma, its timing, and how alike its errors are."""
        sigma = self.sigma(claimed)
        if self._kind.shifted:
            sigma = math.hypot(sigma, TIMING * place.controls.speed(place.time))
        self._count_repeats(place.time)
        return sigma * math.sqrt(self._repeats)

    def _count_repeats(self, time: int) -> None:
        """Note how many readings share one independent error, from the interval to the one before."""
        interval = max(SHORTEST_INTERVAL, abs(time - self._last_time) / SECOND)
        self._last_time = time
        self._repeats = max(1.0, self._correlation / interval)
