"""A vehicle or tag of which nothing is measured but where it is: constant velocity, in two or three dimensions.

In two dimensions the height is a state all the same where nothing but ranges could tell it: a slow column, so that what
is not known of it is in the belief, and the ranges may learn it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.sample import SECOND, AnyReading
from filters.belief import Belief, Displacement, Joint, Moments
from filters.density.gaussian import radius
from filters.motion.constant_velocity import (
    DOWN,
    FREE,
    VELOCITY_DOWN,
    VELOCITY_EAST,
    VELOCITY_NORTH,
    ConstantVelocity,
    FreeControl,
    carried,
)
from filters.motion.learned import SlowState
from filters.motion.slow import RandomWalk
from filters.particle import ParticleFilter
from filters.sensing import Sensor
from filters.sensing.altitude import Altitude
from filters.sensing.down import Down, DownMeasurement
from service.config import Configuration
from service.estimate import Triangle, Triple
from service.estimator.carrier import Carrier, Pose
from service.estimator.controls import Controls, controls_of
from service.estimator.height import Height, climb_of, down_of, height_of, height_state
from service.estimator.start import Anchor, altitude_biases, sensor_states
from service.geodesy import LocalFrame

_PLANE = ("north", "east", VELOCITY_NORTH, VELOCITY_EAST)
_SPACE = ("north", "east", DOWN, VELOCITY_NORTH, VELOCITY_EAST, VELOCITY_DOWN)
_ALTITUDE = Down()


class FreeVehicle:
    """Constant-velocity motion and height; see :class:`service.estimator.vehicle.Vehicle`.

    Its controls are heard (a speed tells how much a stamp matters) and not needed.
    """

    def __init__(self, configuration: Configuration) -> None:
        settings = configuration.motion
        self.motion = ConstantVelocity(
            settings.acceleration_noise,
            settings.velocity_sigma,
            settings.dimensions,
            settings.vertical_noise,
            settings.vertical_sigma,
        )
        self.timing_sigma = settings.timing_sigma
        self.controls: Controls = controls_of(settings)
        self.guided = False
        self.slow_states: list[SlowState] = sensor_states(configuration)
        self._height = height_of(configuration) if height_state(configuration) is None else None
        if self._height is None:
            self.slow_states.extend(altitude_biases(configuration))
        if self._height is None and settings.dimensions == 2:
            self.slow_states.append(RandomWalk(DOWN, climb_of(configuration)))

    def predict(self, belief: ParticleFilter[FreeControl], start: int, end: int) -> None:
        """Move the particles from ``start`` to ``end`` (nanoseconds)."""
        duration = (end - start) / SECOND
        belief.predict(FREE, duration)
        if self._height is not None:
            self._height.wander(duration)

    @staticmethod
    def control(start: int, end: int) -> FreeControl:
        """Return that nothing is known of the way from ``start`` to ``end``."""
        return FREE

    def carrier(self, belief: Belief) -> Carrier:
        """Return what carries ``belief`` to now."""
        return FreeCarrier(self, belief)

    @staticmethod
    def linearisable(moments: Moments) -> bool:
        """Say that the motion is linear whatever the belief."""
        return True

    @property
    def missing(self) -> list[str]:
        """Return that no control is awaited."""
        return []

    # --- height -------------------------------------------------------------------------------------------------

    def stand_at(self, anchor: Anchor | None) -> None:
        """Begin the height anew where ``anchor`` has it, if the particles do not have it themselves."""
        if self._height is not None:
            self._height.begin(anchor)

    @property
    def height(self) -> tuple[float, float] | None:
        """Down (m) and its variance (m²) where the particles do not have it, or ``None``."""
        return None if self._height is None else self._height.moments

    @property
    def down(self) -> float:
        """Down, where the particles do not have it, or 0."""
        return 0.0 if self._height is None else self._height.down

    @property
    def height_biases(self) -> dict[str, tuple[float, float]]:
        """Biases of the altitudes that correct the height, where the particles do not have it."""
        return {} if self._height is None else self._height.biases

    def height_for(self, model: Sensor[Any]) -> Height | None:
        """Return the height, where the particles do not have it, for a measurement of it."""
        return self._height if isinstance(model, Altitude) else None

    def level(
        self,
        belief: ParticleFilter[FreeControl],
        reading: AnyReading,
        frame: LocalFrame | None,
        repeats: float,
    ) -> None:
        """Correct the height by a position that brings one; ``repeats`` fixes share one error."""
        measured = down_of(reading, frame)
        if measured is None:
            return
        down, sigma = measured
        if self._height is not None:
            self._height.correct(down, repeats * sigma**2)
        else:
            belief.weigh(_ALTITUDE, DownMeasurement(down, repeats**0.5 * sigma))


class FreeCarrier:
    """Carries a belief to the letter, for it is linear; see :class:`~service.estimator.carrier.Carrier`."""

    def __init__(self, vehicle: FreeVehicle, belief: Belief) -> None:
        self._vehicle = vehicle
        self._belief = belief
        motion = vehicle.motion
        self._timing = vehicle.timing_sigma
        self._axes = motion.dimensions
        self._moving = 2 * motion.dimensions
        self._standing = DOWN in belief.names and motion.dimensions == 2
        self._names = ((*_PLANE, DOWN) if self._standing else _PLANE) if motion.dimensions == 2 else _SPACE
        self._densities = np.array(
            [motion.acceleration_noise] * 2 + [motion.vertical_noise] * (self._axes - 2)
        )
        self.displacement: Displacement | None = None

    def at(self, belief_time: int, now: int) -> Pose:
        """Return the belief carried from ``belief_time`` to ``now`` (nanoseconds)."""
        duration = (now - belief_time) / SECOND
        joint = self._belief.joint(self._names)
        axes, moving = self._axes, self._moving
        mean, covariance = carried(
            joint.mean[:moving], joint.covariance[:moving, :moving], self._densities, duration
        )
        north, east = (float(mean[axis] - joint.mean[axis]) for axis in range(2))
        self.displacement = Displacement(north, east, 0.0)
        moments = self._belief.moments(self.displacement)
        pose = np.zeros((3, 3))
        going = self._timing * mean[axes : axes + 2]
        pose[:2, :2] = covariance[:2, :2] + np.outer(going, going)
        return Pose(
            moments,
            pose,
            None,
            self._down(joint, mean, covariance, duration),
            *self._velocity(mean[axes:], covariance[axes:, axes:]),
            radius(pose[:2, :2], 0.95),
        )

    def _down(
        self, joint: Joint, mean: NDArray[np.float64], covariance: NDArray[np.float64], duration: float
    ) -> tuple[float, float, float, float] | None:
        """Return down, its variance, and its covariances with north and east."""
        if self._standing:
            last = joint.covariance[self._moving]
            nd, ed = last[:2] + duration * last[2:4]
            return float(joint.mean[self._moving]), float(last[self._moving]), float(nd), float(ed)
        if self._axes > 2:
            return float(mean[2]), float(covariance[2, 2]), float(covariance[0, 2]), float(covariance[1, 2])
        height = self._vehicle.height
        return None if height is None else (*height, 0.0, 0.0)

    @staticmethod
    def _velocity(mean: NDArray[np.float64], covariance: NDArray[np.float64]) -> tuple[Triple, Triangle]:
        nn, ne, ee = float(covariance[0, 0]), float(covariance[0, 1]), float(covariance[1, 1])
        north, east = float(mean[0]), float(mean[1])
        if mean.size == 2:
            return (north, east, None), (nn, ne, None, ee, None, None)
        nd, ed, dd = (float(value) for value in covariance[:, 2])
        return (north, east, float(mean[2])), (nn, ne, nd, ee, ed, dd)
