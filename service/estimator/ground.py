"""A ground vehicle: it rolls forward and turns, and its odometer and gyro say how far."""

from __future__ import annotations

import math
from typing import Any, Protocol

from drivers.sample import SECOND, AnyReading
from filters.belief import Belief, Displacement, Moments
from filters.density.gaussian import radius
from filters.motion.learned import SlowState
from filters.motion.prediction import IntervalNoise, process_covariance, velocity_moments
from filters.motion.standing import GYRO_NOISE, StandingUnicycle
from filters.motion.unicycle import GYRO_BIAS, ODOMETRY_SCALE, UnicycleControl
from filters.particle import ParticleFilter
from filters.sensing import Sensor
from filters.sensing.altitude import Altitude
from service.config import Configuration
from service.estimator.carrier import Carrier, Pose
from service.estimator.controls import Controls, controls_of
from service.estimator.height import Height, down_of, height_of
from service.estimator.pace import UNKNOWN_SPEED, UNKNOWN_YAW_RATE, Pace
from service.estimator.start import Anchor, sensor_states
from service.estimator.track import SPEED_WINDOW, Motion
from service.geodesy import LocalFrame

PERSISTENCE = 2.0
"""Seconds for which an unknown motion goes on in one direction: it adds up faster than noise."""

TELLS_NOTHING = 1e6
"""Noise of a yaw rate, as of :data:`GYRO_NOISE`, that says nothing of its bias: wheels that stand count no turn, and a
command to stand is none to turn, however wrong both are about a turn."""

CHORDS = 4
"""Into how many chords the way from the horizon to now is cut."""

HEADING_KNOWN = 0.35
"""Radians: the standard deviation of the heading from which a sine is a straight line to 2 %."""

_HEADING = 2


class Gait(Protocol):
    """What a ground vehicle wants to know of its motion mode."""

    stands: bool
    """Whether it is certain to stand still over the stretch of the last :meth:`approach`."""

    def approach(self, start: int, end: int) -> None:
        """Take the controls of the stretch that the belief is about to be moved over."""
        ...

    def doubt(self, distance: float, duration: float) -> float:
        """Return the variance (m²) by which a distance is to be doubted, over so many seconds."""
        ...


class Moved(Protocol):
    """A belief that can only be moved as a whole, such as a Gaussian."""

    def predict(self, control: UnicycleControl, duration: float) -> None:
        """Move by a control over so many seconds."""
        ...


class GroundVehicle:
    """Unicycle motion, controls and height; see :class:`service.estimator.vehicle.Vehicle`."""

    def __init__(self, configuration: Configuration) -> None:
        settings = configuration.motion
        self.motion = StandingUnicycle(
            settings.speed_noise,
            settings.yaw_rate_noise,
            settings.gyro_bias_walk,
            settings.odometry_scale_walk,
            slip_noise=settings.slip_noise,
            turn_noise=settings.turn_noise,
            gyro_bias_sigma=settings.gyro_bias_sigma,
            odometry_scale_sigma=settings.odometry_scale_sigma,
        )
        self.controls: Controls = controls_of(settings, configuration.sensor)
        self.guided = True
        self.slow_states: list[SlowState] = sensor_states(configuration)
        self._height = height_of(configuration)
        self._gait: Gait | None = None
        self._speed, self._yaw_rate = Pace(UNKNOWN_SPEED), Pace(UNKNOWN_YAW_RATE)
        self._rolled = (-1, -1, -1, UnicycleControl(0.0, 0.0), 0.0)

    @property
    def stands(self) -> bool:
        """Whether it is certain to stand still over the stretch that was moved last."""
        return self._gait is not None and self._gait.stands

    def heed(self, gait: Gait) -> None:
        """Heed from now on whether the vehicle stands and how far its wheels are to be doubted."""
        self._gait = gait

    def predict(self, belief: ParticleFilter[UnicycleControl] | Moved, start: int, end: int) -> None:
        """Move the particles by what the controls say of ``start`` to ``end`` (nanoseconds).

        A belief that is no set of particles moves by its controls while the vehicle stands, too. A gyro that stands
        reads its bias; wheels and commands do not.
        """
        duration = (end - start) / SECOND
        self._speed.saw(self.controls.speed(end), duration)
        self._yaw_rate.saw(self.controls.yaw_rate(end), duration)
        if self._gait is not None:
            self._gait.approach(start, end)
        if self._gait is not None and self._gait.stands and isinstance(belief, ParticleFilter):
            turn = self.rolled(start, end).turn
            noise = GYRO_NOISE if self.controls.feels_turns else TELLS_NOTHING
            self.motion.stand(belief.column(GYRO_BIAS), belief.weights, turn, duration, noise)
        else:
            with self.motion.as_learned():
                belief.predict(self.control(start, end), duration)
        self._height.wander(duration)

    def control(self, start: int, end: int) -> UnicycleControl:
        """Return what odometer and gyro say of ``start`` to ``end``, doubted as far as the wheels slip."""
        rolled = self.rolled(start, end)
        doubt = self._rolled[4]
        if self._gait is not None:
            doubt += self._gait.doubt(rolled.distance, (end - start) / SECOND)
        return (
            rolled._replace(distance_sigma=math.sqrt(rolled.distance_sigma**2 + doubt)) if doubt else rolled
        )

    def rolled(self, start: int, end: int) -> UnicycleControl:
        """Return what odometer and gyro say of ``start`` to ``end``, with what is unknown of it as a sigma."""
        heard = self.controls.heard
        if self._rolled[:3] == (
            start,
            end,
            heard,
        ):  # belief and companions ask for a stretch one after the other
            return self._rolled[3]
        distance, turn = self.controls.distance(start, end), self.controls.turn(start, end)
        control = UnicycleControl(
            distance.total,
            turn.total,
            self._speed.sigma * _strayed(distance),
            self._yaw_rate.sigma * _strayed(turn),
        )
        self._rolled = (start, end, heard, control, self.controls.doubt(start, end))
        return control

    def displacement(self, start: int, end: int, biases: tuple[float, float]) -> Displacement:
        """Return the body's rigid motion from ``start`` to ``end``, corrected by (gyro bias, odometry scale)."""
        bias, scale = biases
        marks = [start + (end - start) * chord // CHORDS for chord in range(CHORDS + 1)]
        distances, turns = self.controls.distances(marks), self.controls.turns(marks)
        drift = bias * (end - start) / SECOND / CHORDS
        forward = right = turn = 0.0
        for chord in range(CHORDS):
            step = turns[chord + 1] - turns[chord] - drift
            distance = scale * (distances[chord + 1] - distances[chord])
            forward += distance * math.cos(turn + 0.5 * step)
            right += distance * math.sin(turn + 0.5 * step)
            turn += step
        return Displacement(forward, right, turn)

    def noise(self, start: int, end: int) -> IntervalNoise:
        """Return the process noise of an interval, as the particles are moved with it."""
        with self.motion.as_learned():
            return IntervalNoise(
                *self.motion.noise_variances(self.control(start, end), (end - start) / SECOND)
            )

    def speed_variance(self, time: int) -> float:
        """Return the variance of the speed that is published for ``time``, (m/s)².

        Where the odometry is silent the vehicle may drive as it likes.
        """
        silent = self.controls.distance(time - SPEED_WINDOW // 2, time + SPEED_WINDOW // 2).unknown
        return self.motion.speed_noise**2 + self._speed.sigma**2 * min(1.0, silent * SECOND / SPEED_WINDOW)

    def carrier(self, belief: Belief) -> Carrier:
        """Return what carries ``belief`` to now."""
        return GroundCarrier(self, belief)

    @staticmethod
    def linearisable(moments: Moments) -> bool:
        """Say whether the heading is known well enough to linearise about."""
        return float(moments.variance[_HEADING]) <= HEADING_KNOWN**2

    @property
    def missing(self) -> list[str]:
        """What was never heard of the motion, in the user's words."""
        sources = zip(("odometry", "yaw rate"), self.controls.sources, strict=True)
        return [what for what, source in sources if source is None]

    # --- height -------------------------------------------------------------------------------------------------

    def stand_at(self, anchor: Anchor | None) -> None:
        """Begin the height anew where ``anchor`` has it, if it does."""
        self._height.begin(anchor)

    @property
    def height(self) -> tuple[float, float] | None:
        """Down (m) and its variance (m²), or ``None`` while unknown."""
        return self._height.moments

    @property
    def down(self) -> float:
        """Down, or the origin's own height while unknown."""
        return self._height.down

    @property
    def height_biases(self) -> dict[str, tuple[float, float]]:
        """Biases of the altitudes that correct the height, each with its standard deviation, metres."""
        return self._height.biases

    def height_for(self, model: Sensor[Any]) -> Height | None:
        """Return the height, for a measurement of it."""
        return self._height if isinstance(model, Altitude) else None

    def level(
        self,
        belief: ParticleFilter[UnicycleControl],
        reading: AnyReading,
        frame: LocalFrame | None,
        repeats: float,
    ) -> None:
        """Correct the height by a position that brings one.

        Its errors are as alike from fix to fix as those of the plane: ``repeats`` fixes share one, and each counts so
        much less.
        """
        measured = down_of(reading, frame)
        if measured is not None:
            self._height.correct(measured[0], repeats * measured[1] ** 2)


def _strayed(motion: Motion) -> float:
    """Return how far, in seconds of an unknown rate, what is not known of an interval may lead (standard deviation).

    A rate that goes on for :data:`PERSISTENCE` τ (Ornstein, Uhlenbeck) adds up to 2 τ² (t/τ - 1 + exp(-t/τ)) after a
    time t: t² in the beginning, 2 τ t in the end. An interval has what is added between its two ends.
    """
    if motion.unknown <= 0.0:
        return 0.0
    begin = math.exp(-motion.since / PERSISTENCE)
    end = begin * math.exp(-motion.unknown / PERSISTENCE)
    return math.sqrt(2.0 * PERSISTENCE * max(0.0, motion.unknown - PERSISTENCE * (begin - end)))


class GroundCarrier:
    """Carries a planar belief with the controls already received; see :class:`~service.estimator.carrier.Carrier`."""

    def __init__(self, vehicle: GroundVehicle, belief: Belief) -> None:
        self._vehicle = vehicle
        self._belief = belief
        self._biases = (0.0, 1.0)
        self.displacement: Displacement | None = None

    def at(self, belief_time: int, now: int) -> Pose:
        """Return the belief carried from ``belief_time`` to ``now`` (nanoseconds)."""
        vehicle = self._vehicle
        displacement = vehicle.displacement(belief_time, now, self._biases)
        moments = self._belief.moments(displacement)
        index = moments.names.index
        self._biases = (float(moments.mean[index(GYRO_BIAS)]), float(moments.mean[index(ODOMETRY_SCALE)]))
        distance = math.hypot(displacement.forward, displacement.right)
        heading = float(moments.mean[_HEADING])
        noise = vehicle.noise(belief_time, now)
        covariance = moments.pose_covariance + process_covariance(
            distance, heading - 0.5 * displacement.turn, noise
        )
        self.displacement = displacement
        heading_variance = float(covariance[_HEADING, _HEADING])
        speed = vehicle.controls.speed(now) * self._biases[1]
        velocity = velocity_moments(speed, vehicle.speed_variance(now), heading, heading_variance)
        height = vehicle.height
        return Pose(
            moments,
            covariance,
            (heading, heading_variance),
            None if height is None else (*height, 0.0, 0.0),
            (velocity.north, velocity.east, None),
            (velocity.nn, velocity.ne, None, velocity.ee, None, None),
            radius(covariance[:2, :2], 0.95),
        )
