"""The unicycle linearised: pose, gyro bias, odometry scale and any slow states beside them, as one Gaussian.

With d, t the control's distance and turn over a time T, d' = s d, t' = t - b T and m = heading + t'/2::

    g:  north += d' cos m,   east += d' sin m,   heading += t'

            heading      gyro bias b        odometry scale s
    north   -d' sin m    +d' sin m T/2      d cos m
    east    +d' cos m    -d' cos m T/2      d sin m
    heading  1           -T                 0

are the rows of its Jacobian G beyond the identity. Noise of distance and turn enters by the same derivatives; bias,
scale and slow states walk before they act, as they do in :class:`filters.motion.Unicycle`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from filters.extended_kalman import Transition
from filters.kalman import Matrix
from filters.kernels.rolling import linearise
from filters.motion.learned import SlowState
from filters.motion.unicycle import Unicycle, UnicycleControl


class LinearisedUnicycle:
    """Unicycle motion to first order.

    Parameters
    ----------
    motion : Unicycle
        Its noises and walks are used; what it has learned is not.
    slow : sequence of RandomWalk or Learned
        Further states that only wander, such as a range scale.
    """

    angles = (2,)

    def __init__(self, motion: Unicycle, slow: Sequence[SlowState] = ()) -> None:
        self._motion = motion
        self.names = (*motion.names, *(walk.name for walk in slow))
        walks = [0.0, 0.0, 0.0, motion.gyro_bias_walk, motion.odometry_scale_walk, *(s.walk for s in slow)]
        self._walk_variances = np.square(np.array(walks, np.float64))

    def move(self, mean: Matrix, control: UnicycleControl, duration: float) -> Transition:
        """Linearise the motion at ``mean``; see :class:`filters.extended_kalman.LinearisedMotion`."""
        if not all(map(math.isfinite, control)):
            raise ValueError(f"unicycle: every number of the control must be finite, got {control}")
        size = mean.size
        moved, jacobian, noise = np.empty(size), np.zeros((size, size)), np.zeros((size, size))
        variances = self._motion.noise_variances(control, duration)
        walks, start = self._walk_variances, np.ascontiguousarray(mean, np.float64)
        linearise.direct(
            start, control.distance, control.turn, duration, *variances, walks, moved, jacobian, noise
        )
        return Transition(moved, jacobian, noise)
