"""Constant velocity beside the other linearised models; it is linear, so nothing is lost.

On each axis position' = position + velocity T, with white-noise acceleration (:mod:`filters.motion.constant_velocity`);
slow states walk, and the heading's row stands still.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from filters.extended_kalman import Transition
from filters.kalman import Matrix
from filters.motion.constant_velocity import ConstantVelocity, FreeControl, add_acceleration
from filters.motion.learned import SlowState

_AXES = (("north", "velocity_north"), ("east", "velocity_east"), ("down", "velocity_down"))


class LinearisedConstantVelocity:
    """Constant-velocity motion.

    Parameters
    ----------
    motion : ConstantVelocity
        Its densities are used; what it has learned is not.
    slow : sequence of RandomWalk or Learned
        Further states that only wander, such as a range's bias.
    """

    angles = (2,)

    def __init__(self, motion: ConstantVelocity, slow: Sequence[SlowState] = ()) -> None:
        self.names = (*motion.names, *(walk.name for walk in slow))
        axes = _AXES[: motion.dimensions]
        densities = [motion.acceleration_noise, motion.acceleration_noise, motion.vertical_noise]
        self._variances = np.square(densities[: motion.dimensions])
        self._positions = np.array([self.names.index(position) for position, _ in axes])
        self._velocities = np.array([self.names.index(velocity) for _, velocity in axes])
        walks = {walk.name: walk.walk for walk in slow}
        self._walk_variances = np.square([walks.get(name, 0.0) for name in self.names])

    def move(self, mean: Matrix, control: FreeControl, duration: float) -> Transition:
        """Say the motion at ``mean``; see :class:`filters.extended_kalman.LinearisedMotion`."""
        jacobian = np.eye(mean.size)
        jacobian[self._positions, self._velocities] = duration
        noise = np.diag(self._walk_variances * duration)
        add_acceleration(noise, self._positions, self._velocities, self._variances, duration)
        return Transition(jacobian @ mean, jacobian, noise)
