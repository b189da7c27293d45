"""The vehicle as the estimator sees it: its motion model with its controls, and the height that a plane leaves out.

A ground vehicle's belief is planar. Its height is a state of its own, a random walk in a Kalman filter of one
dimension, corrected by whatever fix brings an altitude; ranges need it, and it comes out with an honest variance.
"""

from __future__ import annotations

import math

import numpy as np

from drivers.sample import AnyReading, GeodeticPosition, LocalPosition
from filters.belief import Displacement
from filters.kalman import KalmanFilter
from filters.motion.prediction import IntervalNoise
from filters.motion.slow import RandomWalk
from filters.motion.unicycle import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from service.config import Configuration
from service.estimator.controls import Controls, Throttle
from service.estimator.start import Anchor
from service.estimator.track import SECOND, SPEED_WINDOW
from service.geodesy import LocalFrame

UNKNOWN_SPEED = 2.0
"""m/s; how fast a vehicle may move while its odometry is silent (one standard deviation)."""

UNKNOWN_YAW_RATE = 0.5
"""rad/s; the same for a silent gyro."""

PERSISTENCE = 2.0
"""Seconds for which such an unknown motion goes on in one direction: it adds up faster than noise."""

CLIMB = 0.05
"""m per √s; how fast the height wanders, uncorrected."""

SENSOR_WALK = 1e-4
"""Per √s; how fast a sensor's scale or bias wanders."""

CHORDS = 4
"""Into how many chords the way from the horizon to now is cut."""


class Vehicle:
    """Motion model, controls and height of the vehicle of a configuration.

    Attributes
    ----------
    motion : Unicycle
        What moves the particles.
    controls : Controls
        What was rolled and turned, and when.
    slow_states : list[RandomWalk]
        Slow states that the sensors ask for.
    """

    def __init__(self, configuration: Configuration) -> None:
        settings = configuration.motion
        self.motion = Unicycle(
            settings.speed_noise,
            settings.yaw_rate_noise,
            settings.gyro_bias_walk,
            settings.odometry_scale_walk,
            slip_noise=settings.slip_noise,
            turn_noise=settings.turn_noise,
            gyro_bias_sigma=settings.gyro_bias_sigma,
            odometry_scale_sigma=settings.odometry_scale_sigma,
        )
        self.controls = Controls(
            settings.wheel_radius,
            settings.wheel_track,
            settings.speed_from,
            settings.yaw_rate_from,
            None
            if settings.throttle_channel is None
            else Throttle(settings.throttle_channel, settings.throttle_speed),
        )
        states = [
            f"{s.kind}_{state}" for s in configuration.sensor for state in s.estimate if state != "delay"
        ]
        self.slow_states = [RandomWalk(state, SENSOR_WALK) for state in dict.fromkeys(states)]
        self._height: KalmanFilter | None = None

    # --- on the plane -------------------------------------------------------------------------------------------

    def predict(self, belief: ParticleFilter[UnicycleControl], start: int, end: int) -> None:
        """Move the particles by what the controls say of ``start`` to ``end`` (nanoseconds)."""
        duration = (end - start) / SECOND
        belief.predict(self.control(start, end), duration)
        if self._height is not None:
            self._height.predict(np.eye(1), np.array([[CLIMB**2 * duration]]))

    def control(self, start: int, end: int) -> UnicycleControl:
        """Return what odometer and gyro say of ``start`` to ``end``, with what is unknown of it as a sigma."""
        distance, turn = self.controls.distance(start, end), self.controls.turn(start, end)
        return UnicycleControl(
            distance.total,
            turn.total,
            UNKNOWN_SPEED * math.sqrt(2.0 * PERSISTENCE * max(0.0, distance.unknown)),
            UNKNOWN_YAW_RATE * math.sqrt(2.0 * PERSISTENCE * max(0.0, turn.unknown)),
        )

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
        """Return the process noise of an interval, as the motion model has it."""
        return IntervalNoise(*self.motion.noise_variances(self.control(start, end), (end - start) / SECOND))

    def speed_variance(self, time: int) -> float:
        """Return the variance of the speed that is published for ``time``, (m/s)².

        Where the odometry is silent the vehicle may drive as it likes.
        """
        silent = self.controls.distance(time - SPEED_WINDOW // 2, time + SPEED_WINDOW // 2).unknown
        return self.motion.speed_noise**2 + UNKNOWN_SPEED**2 * min(1.0, silent * SECOND / SPEED_WINDOW)

    # --- height -------------------------------------------------------------------------------------------------

    def stand_at(self, anchor: Anchor | None) -> None:
        """Begin the height anew where ``anchor`` has it, if it does."""
        self._height = None
        if anchor is not None and anchor.position[2] is not None:
            self._height = KalmanFilter(np.array([anchor.position[2]]), np.array([[anchor.sigma[2] ** 2]]))

    @property
    def height(self) -> tuple[float, float] | None:
        """Down (m) and its variance (m²), or ``None`` while unknown."""
        if self._height is None:
            return None
        return float(self._height.mean[0]), float(self._height.covariance[0, 0])

    @property
    def down(self) -> float:
        """Down, or the origin's own height while unknown."""
        height = self.height
        return 0.0 if height is None else height[0]

    def level(self, reading: AnyReading, frame: LocalFrame | None, repeats: float) -> None:
        """Correct the height by a position that brings one.

        Its errors are as alike from fix to fix as those of the plane: ``repeats`` fixes share one, and each counts so
        much less.
        """
        measured = _down_of(reading, frame)
        if measured is None:
            return
        down, sigma = measured
        if self._height is None:
            self._height = KalmanFilter(np.array([down]), np.array([[sigma**2]]))
        else:
            self._height.correct(np.array([down]), np.eye(1), np.array([[repeats * sigma**2]]))


def _down_of(reading: AnyReading, frame: LocalFrame | None) -> tuple[float, float] | None:
    """Return the down and its sigma that a position reading says, or ``None``."""
    if isinstance(reading, GeodeticPosition) and reading.altitude is not None and frame is not None:
        sigma = reading.sigma_vertical or 2.0 * (reading.sigma_horizontal or 3.0)
        return frame.origin.altitude - reading.altitude, sigma
    if isinstance(reading, LocalPosition) and reading.down is not None:
        return reading.down, reading.sigma_vertical or 2.0 * (reading.sigma_horizontal or 1.0)
    return None
