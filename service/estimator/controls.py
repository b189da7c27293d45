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
from service.config.belief import Motion as MotionSettings
from service.config.belief import Sensor
from service.estimator.track import (
    FASTEST,
    FASTEST_TURN,
    GAP,
    SECOND,
    Motion,
    RateTrack,
    TotalTrack,
    Track,
)
from service.estimator.wheels import Wheels

SILENCE = SECOND
"""A source that said nothing for this long gives way to the next one in rank."""


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


SENSORS = "sensors"
"""What the speed is from that all ``[[sensor]]`` of kind speed say together."""

SENSORS_RANK = 1
"""After totals of an odometer, before any single speed."""

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
    yaw_rate_delay : int
        By how much a gyro's yaw rate is older than its stamp, nanoseconds.
    wheels : Wheels or None
        The speed sensors, if there are any.

    Attributes
    ----------
    heard : int
        How often the motion may have become another one: samples taken, and what was forgotten.
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
        yaw_rate_delay: int = 0,
        wheels: Wheels | None = None,
    ) -> None:
        self.wheel_radius = wheel_radius
        self.wheel_track = wheel_track
        self.speed_from = speed_from
        self.yaw_rate_from = yaw_rate_from
        self.throttle = throttle
        self.yaw_rate_delay = yaw_rate_delay
        self.heard = 0
        self.out_of_order = 0
        self.implausible = 0
        self._wheels = wheels
        self._doubt = RateTrack()
        self._motors: dict[tuple[str, str], dict[int, tuple[int, float]]] = {}
        self._difference: tuple[int, float, object] | None = None
        self._distance: Track = Track()
        self._turn: Track = Track()
        self._push = RateTrack()
        self._pusher = Choice()
        self._speaker = Choice()
        self._gyro = Choice()

    @property
    def sources(self) -> tuple[str | None, str | None]:
        """Who speaks for the distance and for the turn, as the wire names them."""
        distance, turn = self._speaker.source, self._gyro.source
        return (distance.name if distance else None, turn.name if turn else None)

    @property
    def feels_turns(self) -> bool:
        """Whether the turn is what an inertial sensor felt, not what wheels did or were told to do."""
        source = self._gyro.source
        return source is not None and source.rank < WHEELS_RANK

    @property
    def earliest(self) -> int | None:
        """Time of the first control of any kind, or ``None``."""
        times = [t for t in (self._distance.earliest, self._turn.earliest) if t is not None]
        return min(times, default=None)

    def take(self, sample: Sample) -> bool:
        """Use ``sample`` if it is a control; return whether it was one (used or outranked)."""
        self.heard += 1
        reading = sample.reading
        if isinstance(reading, Inertial):
            if reading.angular_velocity is not None:
                rank = YAW_RATE_RANKS.get(sample.source, len(YAW_RATE_RANKS))
                self._take_gyro(sample, reading.angular_velocity[2], rank)
            if reading.specific_force is not None:
                self._take_push(sample, reading.specific_force[0])
            return True
        if isinstance(reading, Rotation):
            self._take_gyro(sample, reading.yaw_rate, -1)
            return True
        if isinstance(reading, Attitude):
            if reading.angular_velocity is not None:
                self._take_gyro(sample, reading.angular_velocity[2], 100)
            return True
        if self._wheels is not None and self._wheels.wants(sample):
            self._take_wheels(sample, self._wheels)
            return not isinstance(reading, Odometer) or self._take_distance(sample)
        return self._take_distance(sample)

    def holds(self, sample: Sample) -> bool:
        """Say whether a speed is the control, or part of it."""
        source = self._speaker.source
        if source is None or source.name == SENSORS:
            return source is not None
        return (source.link, source.name) == (sample.link, sample.source)

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
                self._take_yaw_rate(sample, reading.yaw_rate, sample.time, 200)
            return True
        if isinstance(reading, ActuatorCommand):
            self._take_command(sample, reading)
            return True
        return False

    def _take_wheels(self, sample: Sample, wheels: Wheels) -> None:
        """Feed the speed that all speed sensors make together, where nothing better speaks."""
        fused = wheels.take(sample, self._turn.rate)
        if fused is None or self.speed_from not in ("auto", SENSORS):
            return
        if not self._speaker.accepts(Source(SENSORS_RANK, "", SENSORS), sample.time):
            return
        if not isinstance(self._distance, RateTrack):
            self._distance = RateTrack()
        self.out_of_order += not self._distance.append(fused.time, fused.speed)
        self._doubt.append(fused.time, fused.density)

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
            self._take_yaw_rate(sample, rate, sample.time, WHEELS_RANK, WHEELS)

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

    def _take_gyro(self, sample: Sample, rate: float, rank: int) -> None:
        """Feed what a gyro says: of the time before its filter delayed it."""
        self._take_yaw_rate(sample, rate, sample.time - self.yaw_rate_delay, rank)

    def _take_yaw_rate(self, sample: Sample, rate: float, time: int, rank: int, name: str = "") -> None:
        if not abs(rate) <= FASTEST_TURN:
            self.implausible += 1
            return
        if not self._may_speak(self._gyro, self.yaw_rate_from, sample, rank, name):
            return
        if not isinstance(self._turn, RateTrack):
            self._turn = RateTrack()
        self.out_of_order += not self._turn.append(time, rate)

    def _take_push(self, sample: Sample, force: float) -> None:
        """Feed the specific force along the vehicle: what it is pushed with, and of gravity what a slope adds."""
        rank = YAW_RATE_RANKS.get(sample.source, len(YAW_RATE_RANKS))
        if abs(force) <= FASTEST and self._pusher.accepts(
            Source(rank, sample.link, sample.source), sample.time
        ):
            self._push.append(sample.time, force)

    @property
    def counted(self) -> bool:
        """Whether the distance is what wheels have counted."""
        return isinstance(self._distance, TotalTrack)

    def gained(self, start: int, end: int) -> Motion:
        """Return by how much an accelerometer says that the speed has changed between two times, m/s."""
        return self._push.between(start, end)

    def distance(self, start: int, end: int) -> Motion:
        """Return metres rolled between two times, and the seconds of them without knowledge."""
        return self._distance.between(start, end)

    def doubt(self, start: int, end: int) -> float:
        """Return the variance (m²) that the speed sensors themselves leave of the distance between two times."""
        source = self._speaker.source
        if source is None or source.name != SENSORS:
            return 0.0
        return max(0.0, self._doubt.between(start, end).total)

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
        self.heard += 1
        self._distance.forget(before)
        self._doubt.forget(before)
        self._turn.forget(before)
        self._push.forget(before)


def controls_of(settings: MotionSettings, sensors: Sequence[Sensor] = ()) -> Controls:
    """Return the controls that ``[motion]`` asks for, with the speed sensors among ``sensors``."""
    throttle = None
    speeds = any(sensor.kind == "speed" for sensor in sensors)
    if settings.throttle_channel is not None:
        throttle = Throttle(settings.throttle_channel, settings.throttle_speed)
    return Controls(
        settings.wheel_radius,
        settings.wheel_track,
        settings.speed_from,
        settings.yaw_rate_from,
        throttle,
        round(settings.yaw_rate_delay_ms * 1e6),
        Wheels(sensors, settings.wheel_radius) if speeds else None,
    )
