"""How the vehicle moved between two instants, from whichever odometry and gyro there is.

Controls come at their own rates and stamps; the filter asks for the motion between arbitrary times (from one
measurement to the next, from the horizon to now). So each control is kept as a *total* over time, distance rolled and
angle turned, and any interval is a difference of two interpolated totals. Where the total is not known (a gap in the
data, a counter that restarted) the seconds without knowledge are totalled beside it.

Several messages often say the same thing (ArduPilot sends three kinds of IMU message). Adding them up would count one
gyro thrice; the one that ranks first speaks, and the next one when it has fallen silent.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from typing import NamedTuple

from drivers.sample import (
    ActuatorCommand,
    Attitude,
    Inertial,
    MotionCommand,
    MotorSpeed,
    Odometer,
    Rotation,
    Sample,
    Speed,
)

SECOND = 1_000_000_000
GAP = SECOND // 2
"""A rate is taken to hold for this long; what lies beyond is unknown."""

SILENCE = SECOND
"""A source that said nothing for this long gives way to the next one in rank."""

SPEED_WINDOW = SECOND // 10
"""Over which a speed is the mean."""

FASTEST = 1e4
FASTEST_TURN = 1e3
"""m/s and rad/s. What is faster, or not finite, is no motion but a counter that jumped or a broken number: it would
stay in the totals for ever."""


class Motion(NamedTuple):
    """What a control says of an interval: the total, and for how many seconds of it nothing is known."""

    total: float
    unknown: float


class Track:
    """A total over time, as a piecewise linear function; bounded in memory.

    Times are nanoseconds on the one clock; they must not run backwards (:meth:`extend` refuses).
    """

    def __init__(self) -> None:
        self._times: list[int] = []
        self._totals: list[float] = []
        self._unknown: list[float] = []

    @property
    def latest(self) -> int | None:
        """Time of the last entry, or ``None``."""
        return self._times[-1] if self._times else None

    @property
    def earliest(self) -> int | None:
        """Time of the first entry still kept, or ``None``."""
        return self._times[0] if self._times else None

    def extend(self, time: int, increment: float, unknown: float = 0.0) -> bool:
        """Append the point that lies ``increment`` further at ``time``; ``False`` if ``time`` is not newer."""
        if not self._times:
            self._times.append(time)
            self._totals.append(0.0)
            self._unknown.append(0.0)
            return True
        if time <= self._times[-1]:
            return False
        self._times.append(time)
        self._totals.append(self._totals[-1] + increment)
        self._unknown.append(self._unknown[-1] + unknown)
        return True

    def forget(self, before: int) -> None:
        """Drop the entries older than ``before``, keeping one to interpolate from."""
        keep = bisect_right(self._times, before) - 1
        if keep > 64:
            del self._times[:keep], self._totals[:keep], self._unknown[:keep]

    def between(self, start: int, end: int) -> Motion:
        """Return the motion from ``start`` to ``end`` (nanoseconds), interpolated; beyond the last point, held."""
        total_start, unknown_start = self._at(start)
        total_end, unknown_end = self._at(end)
        return Motion(total_end - total_start, unknown_end - unknown_start)

    def totals(self, times: Sequence[int]) -> list[float]:
        """Return the total at each of ``times``, all from one beginning."""
        return [self._at(time)[0] for time in times]

    def rate(self, time: int) -> float:
        """Return the mean rate over :data:`SPEED_WINDOW` about ``time``, per second."""
        half = SPEED_WINDOW // 2
        return self.between(time - half, time + half).total / (SPEED_WINDOW / SECOND)

    def _at(self, time: int) -> tuple[float, float]:
        times = self._times
        if not times:
            return 0.0, time / SECOND
        if time >= times[-1]:
            return self._held(time)
        if time <= times[0]:
            return self._totals[0], self._unknown[0] - (times[0] - time) / SECOND
        after = bisect_right(times, time)
        share = (time - times[after - 1]) / (times[after] - times[after - 1])
        return (
            self._totals[after - 1] + share * (self._totals[after] - self._totals[after - 1]),
            self._unknown[after - 1] + share * (self._unknown[after] - self._unknown[after - 1]),
        )

    def _held(self, time: int) -> tuple[float, float]:
        """Extrapolate beyond the last point with the rate of the last tenth of a second, for at most ``GAP``."""
        last = self._times[-1]
        beyond = time - last
        first = max(0, bisect_left(self._times, last - SECOND // 10) - 1)
        span = last - self._times[first]
        known = span > 0 and span <= SECOND
        held = min(beyond, GAP) if known else 0
        rate = (self._totals[-1] - self._totals[first]) / span if known else 0.0
        return self._totals[-1] + rate * held, self._unknown[-1] + (beyond - held) / SECOND


class RateTrack(Track):
    """A track fed with rates: each holds, trapezoidally, until the next; a gap is unknown beyond ``GAP``."""

    def __init__(self) -> None:
        super().__init__()
        self._rate = 0.0

    def append(self, time: int, rate: float) -> bool:
        """Append ``rate`` (per second) measured at ``time``."""
        latest = self.latest
        elapsed = 0 if latest is None else time - latest
        if latest is not None and elapsed == 0:
            done = True  # the same instant again (a message with two motors): the later value knows more
        elif elapsed > GAP:
            done = self.extend(time, self._rate * GAP / SECOND, (elapsed - GAP) / SECOND)
        else:
            done = self.extend(time, 0.5 * (self._rate + rate) * elapsed / SECOND)
        if done:
            self._rate = rate
        return done


class TotalTrack(Track):
    """A track fed with a counter that may start anew: a new epoch, and whatever it missed is unknown.

    Attributes
    ----------
    jumps : int
        How often the counter moved farther than anything can; that stretch is unknown, too.
    """

    def __init__(self) -> None:
        super().__init__()
        self.jumps = 0
        self._last: tuple[object, tuple[float, ...]] | None = None

    def append(self, time: int, distance: tuple[float, ...], epoch: object) -> bool:
        """Append the wheels' totals at ``time``; the vehicle's is their mean.

        ``epoch`` is whatever tells one counter from another; between two of them the distance is unknown.
        """
        elapsed = 0.0 if self.latest is None else (time - self.latest) / SECOND
        step = self._step(distance, epoch)
        if step is not None and elapsed > 0.0 and not abs(step) <= FASTEST * elapsed:
            self.jumps += 1
            step = None
        done = self.extend(time, 0.0, elapsed) if step is None else self.extend(time, step)
        if done:
            self._last = (epoch, distance)
        return done

    def _step(self, distance: tuple[float, ...], epoch: object) -> float | None:
        """Return how far the wheels' mean moved since the last totals; ``None`` if these are of another counter."""
        if self._last is None or self._last[0] != epoch or len(self._last[1]) != len(distance):
            return None
        return sum(now - before for now, before in zip(distance, self._last[1], strict=True)) / len(distance)


class Source(NamedTuple):
    """One speaker of a control: who, by which link, and how high it ranks (lower is better)."""

    rank: int
    link: str
    name: str


class Choice:
    """The one source of a control that speaks now: the best in rank that has not fallen silent."""

    def __init__(self) -> None:
        self.source: Source | None = None
        self._heard = 0

    def accepts(self, source: Source, time: int) -> bool:
        """Say whether ``source`` speaks; a better one takes over at once, a worse one after a silence."""
        current = self.source
        if current is None or source == current or source < current or time - self._heard > SILENCE:
            self.source = source
            self._heard = time
            return True
        return False


YAW_RATE_RANKS = {
    "HIGHRES_IMU": 0,
    "RAW_IMU": 1,
    "SCALED_IMU": 2,
    "SCALED_IMU2": 3,
    "SCALED_IMU3": 4,
    "ahrs.RawIMU": 5,
}
"""Floating point before integers (RAW_IMU counts whole mrad/s); the first unit before the second."""


WHEELS = "wheels"
WHEELS_RANK = 150
"""Yaw rate from two wheels: after any gyro and the autopilot's attitude, before what was merely commanded."""


class Throttle(NamedTuple):
    """The actuator that drives: its channel, from 1, and the speed (m/s) at a command of 1."""

    channel: int
    speed: float


class Controls:
    """Distance and turn of a ground vehicle over time.

    Parameters
    ----------
    wheel_radius : float or None
        Metres; makes motor speeds a distance.
    wheel_track : float or None
        Metres between the left wheel (the first) and the right one; makes two wheels a yaw rate.
    speed_from, yaw_rate_from : str
        ``auto``, or the one source (as the wire names it) that may speak.
    throttle : Throttle or None
        Which actuator drives; its command is the last resort for the speed.

    Attributes
    ----------
    out_of_order, implausible : int
        Readings that were not used: older than the one before of the same speaker, or no motion at all.
    """

    def __init__(
        self,
        wheel_radius: float | None = None,
        wheel_track: float | None = None,
        speed_from: str = "auto",
        yaw_rate_from: str = "auto",
        throttle: Throttle | None = None,
    ) -> None:
        self.wheel_radius = wheel_radius
        self.wheel_track = wheel_track
        self.speed_from = speed_from
        self.yaw_rate_from = yaw_rate_from
        self.throttle = throttle
        self.out_of_order = 0
        self.implausible = 0
        self._motors: dict[tuple[str, str], dict[int, tuple[int, float]]] = {}
        self._difference: tuple[int, float, object] | None = None
        self._distance: Track = Track()
        self._turn: Track = Track()
        self._speaker = Choice()
        self._gyro = Choice()

    @property
    def sources(self) -> tuple[str | None, str | None]:
        """Who speaks for the distance and for the turn, as the wire names them."""
        distance, turn = self._speaker.source, self._gyro.source
        return (distance.name if distance else None, turn.name if turn else None)

    @property
    def earliest(self) -> int | None:
        """Time of the first control of any kind, or ``None``."""
        times = [t for t in (self._distance.earliest, self._turn.earliest) if t is not None]
        return min(times, default=None)

    def take(self, sample: Sample) -> bool:
        """Use ``sample`` if it is a control; return whether it was one (used or outranked)."""
        reading = sample.reading
        if isinstance(reading, Inertial):
            if reading.angular_velocity is not None:
                self._take_yaw_rate(
                    sample,
                    reading.angular_velocity[2],
                    YAW_RATE_RANKS.get(sample.source, len(YAW_RATE_RANKS)),
                )
            return True
        if isinstance(reading, Rotation):
            self._take_yaw_rate(sample, reading.yaw_rate, -1)
            return True
        if isinstance(reading, Attitude):
            if reading.angular_velocity is not None:
                self._take_yaw_rate(sample, reading.angular_velocity[2], 100)
            return True
        return self._take_distance(sample)

    def _take_distance(self, sample: Sample) -> bool:
        reading = sample.reading
        if isinstance(reading, Odometer):
            self._take_odometer(sample, reading)
            return True
        if isinstance(reading, Speed):
            self._take_speed(sample, reading.speed, 1)
            return True
        if isinstance(reading, MotorSpeed):
            if self.wheel_radius is not None:
                self._take_motor(sample, reading, self.wheel_radius)
            return True
        if isinstance(reading, MotionCommand):
            if reading.velocity is not None:
                north, east, _ = reading.velocity
                self._take_speed(sample, north if reading.body else math.hypot(north, east), 3)
            if reading.yaw_rate is not None:
                self._take_yaw_rate(sample, reading.yaw_rate, 200)
            return True
        if isinstance(reading, ActuatorCommand):
            self._take_command(sample, reading)
            return True
        return False

    def _take_odometer(self, sample: Sample, reading: Odometer) -> None:
        if not reading.distance:
            self.implausible += 1
        elif self._may_speak(self._speaker, self.speed_from, sample, 0):
            self._feed_total(sample, reading)
            self._turn_of_wheels(sample, reading)

    def _take_motor(self, sample: Sample, reading: MotorSpeed, radius: float) -> None:
        """Feed the mean speed of the motors of one source that have been heard lately."""
        speed = reading.angular_speed * radius
        if not abs(speed) <= FASTEST:
            self.implausible += 1
            return
        motors = self._motors.setdefault((sample.link, sample.source), {})
        motors[reading.index] = (sample.time, speed)
        heard = [speed for time, speed in motors.values() if sample.time - time <= SILENCE]
        self._take_speed(sample, math.fsum(heard) / len(heard), 2)

    def _take_command(self, sample: Sample, reading: ActuatorCommand) -> None:
        throttle = self.throttle
        if throttle is not None and throttle.channel <= len(reading.channels):
            command = reading.channels[throttle.channel - 1]
            if command is not None:
                self._take_speed(sample, command * throttle.speed, 4)

    def _turn_of_wheels(self, sample: Sample, reading: Odometer) -> None:
        """Feed the yaw rate of a vehicle whose left and right wheels roll different ways."""
        if self.wheel_track is None or len(reading.distance) < 2:
            return
        difference, previous = reading.distance[0] - reading.distance[1], self._difference
        epoch = (sample.link, sample.source, reading.epoch)
        self._difference = (sample.time, difference, epoch)
        if previous is None or previous[2] != epoch:
            return
        elapsed = sample.time - previous[0]
        if 0 < elapsed < GAP:
            rate = (difference - previous[1]) / self.wheel_track * SECOND / elapsed
            self._take_yaw_rate(sample, rate, WHEELS_RANK, WHEELS)

    @staticmethod
    def _may_speak(choice: Choice, wanted: str, sample: Sample, rank: int, name: str = "") -> bool:
        name = name or sample.source
        if wanted not in ("auto", name):
            return False
        return choice.accepts(Source(rank, sample.link, name), sample.time)

    def _feed_total(self, sample: Sample, reading: Odometer) -> None:
        track = self._distance
        if not isinstance(track, TotalTrack):
            track = self._distance = TotalTrack()
        jumps = track.jumps
        self.out_of_order += not track.append(
            sample.time, reading.distance, (sample.link, sample.source, reading.epoch)
        )
        self.implausible += track.jumps - jumps

    def _take_speed(self, sample: Sample, speed: float, rank: int) -> None:
        if not abs(speed) <= FASTEST:
            self.implausible += 1
            return
        if not self._may_speak(self._speaker, self.speed_from, sample, rank):
            return
        if not isinstance(self._distance, RateTrack):
            self._distance = RateTrack()
        self.out_of_order += not self._distance.append(sample.time, speed)

    def _take_yaw_rate(self, sample: Sample, rate: float, rank: int, name: str = "") -> None:
        if not abs(rate) <= FASTEST_TURN:
            self.implausible += 1
            return
        if not self._may_speak(self._gyro, self.yaw_rate_from, sample, rank, name):
            return
        if not isinstance(self._turn, RateTrack):
            self._turn = RateTrack()
        self.out_of_order += not self._turn.append(sample.time, rate)

    def distance(self, start: int, end: int) -> Motion:
        """Return metres rolled between two times, and the seconds of them without knowledge."""
        return self._distance.between(start, end)

    def turn(self, start: int, end: int) -> Motion:
        """Return radians turned clockwise between two times, and the seconds of them without knowledge."""
        return self._turn.between(start, end)

    def distances(self, times: Sequence[int]) -> list[float]:
        """Return the metres rolled up to each of ``times``, from one beginning."""
        return self._distance.totals(times)

    def turns(self, times: Sequence[int]) -> list[float]:
        """Return the radians turned up to each of ``times``, from one beginning."""
        return self._turn.totals(times)

    def speed(self, time: int) -> float:
        """Return the forward speed about ``time``, m/s."""
        return self._distance.rate(time)

    def yaw_rate(self, time: int) -> float:
        """Return the yaw rate about ``time``, rad/s."""
        return self._turn.rate(time)

    def forget(self, before: int) -> None:
        """Drop what lies before ``before`` (nanoseconds) and is no longer needed."""
        self._distance.forget(before)
        self._turn.forget(before)
