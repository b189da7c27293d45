"""Who is judged: sensors, and the groups of those that would lie together."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from drivers.sample import SECOND, Sample
from filters.error_level import ErrorLevel, Opinion, Testimony
from filters.sensing import Heading, Position, Range, Velocity
from filters.sensing.speed import WheelSpeed
from service.estimator.lie import Lie
from service.estimator.witnesses import WILD

USUAL: dict[type, float] = {Position: 5.0, Velocity: 0.5, Range: 1.5, Heading: 0.15, WheelSpeed: 0.3}
"""Slow errors that an honest sensor may have whatever it claims: multipath of 5 m, a beacon's bias; m, m/s, rad."""

STRANGE = 4.0
"""Seconds over which the share of a sensor's wild readings is taken."""

LESSON, LEARNING = SECOND, 10.0
"""A reading in so many nanoseconds teaches what errors are usual, and this many as much as one independent one."""

HINDSIGHT = 60 * SECOND
"""Readings teach only when they are so old and nobody was caught since: a drag of 0.5 m/s is not to pass as usual."""

SHARED = 5.4
"""Nats that a velocity has in what speaks against its receiver's position, at most."""


@dataclass
class Judged:
    """One sensor.

    Attributes
    ----------
    place : int
        Of its log odds.
    level : ErrorLevel
        What errors are normal for it.
    absolute : bool
        Whether it says where the vehicle is.
    ranging : bool
        Whether it is a range.
    worst : float
        Log odds that a second of readings takes from it at most.
    heard : int or None
        When, nanoseconds.
    agreed, flagged : bool
        Whether it has ever earned trust, and whether it has lost it.
    strange : float
        Share of its readings that its witness takes for wild, by the noise that they claim; 0 to 1.
    lessons : deque
        Testimonies that the level has yet to learn from, with their times.
    """

    place: int
    level: ErrorLevel
    absolute: bool
    ranging: bool
    worst: float
    heard: int | None = None
    agreed: bool = False
    flagged: bool = False
    strange: float = 0.0
    lessons: deque[tuple[int, Testimony]] = field(default_factory=deque[tuple[int, Testimony]])

    def remember(self, testimony: Testimony, honest: bool) -> None:
        """Note a testimony of now to learn from later, if it was an honest one, and learn from the ones of long ago."""
        now = self.heard or 0
        if honest and (not self.lessons or now - self.lessons[-1][0] >= LESSON):
            self.lessons.append((now, testimony))
        while self.lessons and now - self.lessons[0][0] > HINDSIGHT:
            self.level.learn(*self.lessons.popleft()[1], 1.0 / LEARNING)

    def compare(self, opinion: Opinion, weight: float) -> None:
        """Note whether a reading is wild for its witness."""
        self.strange += weight / STRANGE * ((opinion.nis > WILD) - self.strange)

    def weight(self, time: int) -> float:
        """Return how much of a second has passed since the reading before, at most one, and note this one."""
        elapsed = 1.0 if self.heard is None else (time - self.heard) / SECOND
        self.heard = time
        return min(1.0, max(0.0, elapsed))


@dataclass
class Group:
    """Sensors that would lie together; those that do not say where the vehicle is follow those that do."""

    place: int
    sensors: dict[str, Judged] = field(default_factory=dict[str, Judged])
    lie: Lie = field(default_factory=Lie)
    accuser: int | None = None
    pace: float = 0.0

    def note(self, surprise: float, weight: float) -> None:
        """Note by how many nats a velocity surprised the witness, for the average of the last seconds."""
        self.pace += weight / STRANGE * (min(SHARED, surprise) - self.pace)

    def support(self, time: int) -> float:
        """Return the nats that the velocity adds to what speaks against the position; none if it has been silent."""
        heard = [sensor.heard for sensor in self.sensors.values() if not sensor.absolute and sensor.heard]
        return self.pace if heard and time - max(heard) < STRANGE * SECOND else 0.0

    @property
    def flagged(self) -> bool:
        """Whether one of it that says where the vehicle is has been caught, or all of it."""
        leading = [sensor.flagged for sensor in self.sensors.values() if sensor.absolute]
        return any(leading) if leading else all(sensor.flagged for sensor in self.sensors.values())

    def believes(self, sensor: Judged) -> bool:
        """Say whether one of it is believed: who does not say where the vehicle is may go its own way."""
        if self.flagged and not sensor.absolute:
            return not sensor.flagged and self.lie.leaves_alone
        return not sensor.flagged

    @property
    def absolute(self) -> bool:
        """Whether one of it says where the vehicle is."""
        return any(sensor.absolute for sensor in self.sensors.values())

    @property
    def ranging(self) -> bool:
        """Whether it is a beacon: its ranges alone place nobody."""
        return any(sensor.ranging for sensor in self.sensors.values())

    @property
    def agreed(self) -> bool:
        """Whether one of it that says where the vehicle is has ever earned trust, or, where none does, any of it."""
        leading = [sensor.agreed for sensor in self.sensors.values() if sensor.absolute]
        return any(leading) if leading else any(sensor.agreed for sensor in self.sensors.values())


def group_of(name: str, sample: Sample) -> str:
    """Return the group of a sensor: a receiver's position and velocity are one, each beacon is its own."""
    kind, _, rest = name.partition("/")
    return (
        f"receiver/{rest}/{sample.source}" if kind in ("position", "velocity") else f"{name}/{sample.source}"
    )
