"""A unicycle that may stand: then it does not move at all, and what its gyro reads is its bias.

A zero-velocity update without the velocity: the pose stays as it is, exactly, and a reading z of the gyro over a time T
is a measurement of the bias with variance r = noise² / T. With m and V the mean and variance of the particles' own
values, and P what their paths leave open::

    K = (V + P) / (V + P + r),   m' = m + K (z - m)
    b' = m' + sqrt(1 - K) (b - m),   P' = (1 - K) P

the mean and the whole variance come out as a Kalman filter's; the particles keep their places in the set (the square
root form of an ensemble filter: Tippett et al., "Ensemble square root filters", Monthly Weather Review 131, 2003).
What the reading says by way of the bias of where the vehicle had been is left out.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from contextlib import contextmanager

import numpy as np

from filters.kernels.compile import Float32Array
from filters.motion.unicycle import Unicycle, UnicycleControl

GYRO_NOISE = 1e-3
"""Of the reading of a gyro that stands, rad/s times the square root of a second: quantisation and vibration in it."""


class StandingUnicycle(Unicycle):
    """Unicycle motion, and standing still; its noise is what was stated, or the share of it that was learned.

    Attributes
    ----------
    distance_share, turn_share : float
        Of the stated variances: what the noise turned out to be.
    """

    distance_share = turn_share = 1.0
    _learned = False

    @contextmanager
    def as_learned(self) -> Generator[None]:
        """Have the noise be what was learned, not what was stated, for as long as this lasts."""
        self._learned = True
        try:
            yield
        finally:
            self._learned = False

    def noise_variances(self, control: UnicycleControl, duration: float) -> tuple[float, float]:
        """Return the variances that a control leaves open; what it says of itself (a gap) is no one's to share."""
        if not self._learned:
            return super().noise_variances(control, duration)
        along, about = super().noise_variances(control._replace(distance_sigma=0.0, turn_sigma=0.0), duration)
        return (
            self.distance_share * along + control.distance_sigma**2,
            self.turn_share * about + control.turn_sigma**2,
        )

    def stand(
        self,
        biases: Float32Array,
        weights: Float32Array,
        turn: float,
        duration: float,
        noise: float = GYRO_NOISE,
    ) -> None:
        """Let time pass without motion, and learn the gyro's bias.

        Parameters
        ----------
        biases : (n,) float32
            The particles' own values; changed in place.
        weights : (n,) float32
            Theirs, up to a factor.
        turn : float
            What the gyro says that was turned, radians.
        duration : float
            Seconds; nothing is learned from none.
        noise : float
            Of the gyro's rate, rad/s times the square root of a second.

        Raises
        ------
        ValueError
            A number that is negative or not finite where it may not be; nothing has changed then.
        """
        if not (0.0 <= duration < math.inf and 0.0 < noise < math.inf and math.isfinite(turn)):
            raise ValueError(
                f"standing: finite numbers are needed, duration not negative, noise positive; got turn {turn}, "
                f"duration {duration}, noise {noise}"
            )
        if duration == 0.0:
            return
        open_variance = self._bias_variance + self.gyro_bias_walk**2 * duration
        self._scale_variance += self.odometry_scale_walk**2 * duration
        total = float(weights.sum(dtype=np.float64))
        mean = float(biases @ weights) / total
        away = biases - np.float32(mean)
        spread = float((away * away) @ weights) / total + open_variance
        gain = spread / (spread + noise * noise / duration)
        biases[:] = (
            np.float32(mean + gain * (turn / duration - mean)) + np.float32(math.sqrt(1.0 - gain)) * away
        )
        self._bias_variance = (1.0 - gain) * open_variance
