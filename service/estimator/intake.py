"""Where samples come in: controls at once to the vehicle, measurements into the timeline until the horizon passes them.

Whatever arrives, nothing is raised here. What cannot be used is counted with its reason, per sensor and in all.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, NamedTuple

from drivers.plausibility import implausible
from drivers.sample import Origin, Sample
from service.config import Configuration
from service.estimate import SensorStatus
from service.estimator.binding import BoundSensor, surroundings_of
from service.estimator.complete import Complete
from service.estimator.controls import Controls
from service.estimator.records import SensorRecords
from service.geodesy import Geodetic, LocalFrame
from service.timeline import FUTURE_TOLERANCE, Timeline

if TYPE_CHECKING:
    from service.estimator.latecomers import Latecomers


class Waiting(NamedTuple):
    """A sample on its way to the sensor that wants it."""

    sensor: BoundSensor
    sample: Sample


Passed = list[tuple[int, Waiting]]
"""Measurements that the horizon has passed, oldest first, each with its time."""


class Intake:
    """The samples of one vehicle, sorted, ordered and counted.

    Parameters
    ----------
    configuration : Configuration
        Its sensors, beacons and origin.
    controls : Controls
        Where controls go.

    Attributes
    ----------
    frame : LocalFrame or None
        The local frame, configured or learned; ``None`` until then.
    records : SensorRecords
        What became of each sensor's readings.
    latecomers : Latecomers or None
        Who takes measurements that the horizon has passed.
    caught_up : int
        How many of them were taken.
    complete : Complete
        Up to when nothing is missing.
    dropped : Counter[str]
        What came and was not used, by reason.
    """

    def __init__(self, configuration: Configuration, controls: Controls) -> None:
        surroundings = surroundings_of(configuration)
        self.records = SensorRecords()
        self.dropped: Counter[str] = Counter()
        self.frame = _configured_frame(configuration)
        self.latecomers: Latecomers | None = None
        self.caught_up = 0
        self.complete = Complete()
        self._controls = controls
        self._sensors = [BoundSensor(sensor, surroundings) for sensor in configuration.sensor]
        self._timeline: Timeline[Waiting] = Timeline()
        self._heard: set[str] = set()
        self._listeners: dict[type, tuple[BoundSensor, ...]] = {}

    def take(self, samples: Iterable[Sample]) -> None:
        """Take samples as they arrive.

        A driver refuses what cannot be true; should it come all the same, it is refused here and counted, because one
        number that is not finite would spoil the belief for ever.
        """
        for sample in samples:
            reading = sample.reading
            if sample.time > sample.received + FUTURE_TOLERANCE:
                self.dropped["future"] += 1
            elif isinstance(reading, Origin):
                self._hear_origin(reading)
            else:
                self._controls.take(sample)
                self._queue(sample)

    def release(self, horizon: int) -> Passed:
        """Move the horizon to ``horizon`` (nanoseconds) and return the measurements that it passed."""
        return self._timeline.release(horizon)

    @property
    def horizon(self) -> int:
        """Nanoseconds; everything up to here has been released."""
        return self._timeline.horizon

    def learn_origin(self, origin: Geodetic) -> None:
        """Lay the local frame at ``origin``, if there is none yet."""
        if self.frame is None:
            self.frame = LocalFrame(origin)

    def refuse(self, waiting: Waiting, reason: str) -> None:
        """Count a measurement that is not used, with its sensor."""
        self.records.of(waiting.sensor.name(waiting.sample)).refused[reason] += 1

    def leave_out(self, passed: Passed, reason: str) -> None:
        """Count measurements for which a tick had no room, per sensor and in all."""
        for _, waiting in passed:
            self.refuse(waiting, reason)
        self.dropped[reason] += len(passed)

    @property
    def missing(self) -> list[str]:
        """Which sensors were never heard, in the user's words."""
        return self._silent()

    @property
    def drops(self) -> dict[str, int]:
        """What came and was not used, since the start."""
        counts = self.dropped + self._timeline.refused
        counts["late"] -= self.caught_up
        counts["control out of order"] = self._controls.out_of_order
        counts["control implausible"] = self._controls.implausible
        return {what: count for what, count in counts.items() if count}

    def statuses(self, now: int, trust: Callable[[str], float | None] | None = None) -> list[SensorStatus]:
        """Return every sensor's status, heard or not; rates are over the time since the last call.

        ``trust`` says the log odds of a sensor by its name.
        """
        silent = (SensorStatus(title, 0.0, None, 0, {}, None, None) for title in self._silent())
        return [*self.records.statuses(now, trust), *silent]

    def _silent(self) -> list[str]:
        return [sensor.title for sensor in self._sensors if sensor.title not in self._heard]

    def _hear_origin(self, origin: Origin) -> None:
        if implausible(origin) is None:
            self.learn_origin(Geodetic(origin.latitude, origin.longitude, origin.altitude))
        else:
            self.dropped["implausible"] += 1

    def _listeners_to(self, reading: type) -> tuple[BoundSensor, ...]:
        """Note which sensors may want readings of a type: of most there is none."""
        found = tuple(sensor for sensor in self._sensors if issubclass(reading, sensor.readings))
        self._listeners[reading] = found
        return found

    def _queue(self, sample: Sample) -> None:
        """Have ``sample`` wait for the horizon; it is the first sensor's that wants it: twice it would count double."""
        listeners = self._listeners.get(type(sample.reading))
        if listeners is None:
            listeners = self._listeners_to(type(sample.reading))
        sensor = next((sensor for sensor in listeners if sensor.wants(sample)), None) if listeners else None
        if sensor is None:
            return
        self._wait(sensor, sample)
        if sensor.part is not None:
            self._share(sensor, sample)

    def _share(self, first: BoundSensor, sample: Sample) -> None:
        """Have the other parts of a sample wait for sensors of their own, each for the first that wants it."""
        taken = {first.part, None}
        for sensor in self._sensors:
            if sensor.part not in taken and sensor.wants(sample):
                taken.add(sensor.part)
                self._wait(sensor, sample)

    def _wait(self, sensor: BoundSensor, sample: Sample) -> None:
        record = self.records.of(sensor.name(sample))
        record.arrivals += 1
        if implausible(sample.reading) is not None:
            self.dropped["implausible"] += 1
            record.refused["implausible"] += 1
            return
        self._heard.add(sensor.title)
        if sensor.is_control(sample, self._controls):
            record.accepted += 1
            record.last = sample.time
            return
        self.complete.heard(sensor.name(sample), sample.time - sensor.delay)
        reason = self._timeline.insert(Waiting(sensor, sample), sample.time - sensor.delay, sample.received)
        if reason == "late" and self.latecomers is not None:
            reason = (
                None if self.latecomers.take(sample.time - sensor.delay, Waiting(sensor, sample)) else "late"
            )
            self.caught_up += reason is None
        if reason is not None:
            record.refused[reason] += 1


def _configured_frame(configuration: Configuration) -> LocalFrame | None:
    origin = configuration.origin
    if origin is None:
        return None
    return LocalFrame.from_degrees(origin.latitude, origin.longitude, origin.altitude)
