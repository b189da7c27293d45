"""A vehicle or tag of which nothing is measured but where it is: constant velocity, in two or three dimensions.

In two dimensions the height is a state all the same where nothing but ranges could tell it: a slow column, so that what
is not known of it is in the belief, and the ranges may learn it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.sample import AnyReading
from filters.belief import Belief, Displacement, Moments
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
from filters.sensing.down import Down, DownMeasurement
from service.config import Configuration
from service.estimate import Triangle, Triple
from service.estimator.carrier import Carrier, Pose
from service.estimator.controls import Controls, controls_of
from service.estimator.height import CLIMB, Height, down_of, height_state
from service.estimator.start import Anchor, sensor_states
from service.estimator.track import SECOND
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
        self.controls: Controls = controls_of(settings)
        self.slow_states: list[SlowState] = sensor_states(configuration)
        self._height = Height() if height_state(configuration) is None else None
        if self._height is None and settings.dimensions == 2:
            self.slow_states.append(RandomWalk(DOWN, CLIMB))

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
        self._names = _PLANE if motion.dimensions == 2 else _SPACE
        self._axes = motion.dimensions
        self._densities = np.array(
            [motion.acceleration_noise] * 2 + [motion.vertical_noise] * (self._axes - 2)
        )
        self.displacement: Displacement | None = None

    def at(self, belief_time: int, now: int) -> Pose:
        """Return the belief carried from ``belief_time`` to ``now`` (nanoseconds)."""
        duration = (now - belief_time) / SECOND
        joint = self._belief.joint(self._names)
        before, covariance_before = joint.mean, joint.covariance
        mean, covariance = carried(before, covariance_before, self._densities, duration)
        step = mean - before
        self.displacement = Displacement(float(step[0]), float(step[1]), 0.0)
        moments = self._belief.moments(self.displacement)
        pose = np.zeros((3, 3))
        pose[:2, :2] = covariance[:2, :2]
        return Pose(
            moments,
            pose,
            None,
            self._down(moments, mean, covariance),
            *self._velocity(mean[self._axes :], covariance[self._axes :, self._axes :]),
            radius(pose[:2, :2], 0.95),
        )

    def _down(
        self, moments: Moments, mean: NDArray[np.float64], covariance: NDArray[np.float64]
    ) -> tuple[float, float, float, float] | None:
        if self._axes > 2:
            return float(mean[2]), float(covariance[2, 2]), float(covariance[0, 2]), float(covariance[1, 2])
        height = self._vehicle.height
        if DOWN not in moments.names:
            return None if height is None else (*height, 0.0, 0.0)
        joint = self._belief.joint(("north", "east", DOWN))
        nd, ed, dd = joint.covariance[2]
        return float(joint.mean[2]), float(dd), float(nd), float(ed)

    def _velocity(
        self, mean: NDArray[np.float64], covariance: NDArray[np.float64]
    ) -> tuple[Triple, Triangle]:
        (nn, ne), ee = covariance[0, :2], covariance[1, 1]
        plane = float(nn), float(ne), float(ee)
        if self._axes == 2:
            return (float(mean[0]), float(mean[1]), None), (plane[0], plane[1], None, plane[2], None, None)
        nd, ed, dd = (float(value) for value in covariance[:, 2])
        return (float(mean[0]), float(mean[1]), float(mean[2])), (plane[0], plane[1], nd, plane[2], ed, dd)
