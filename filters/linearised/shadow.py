"""The shadow filter: an extended Kalman filter that takes the particle filter's controls, sensors and measurements.

It runs beside the particle filter on the same samples: for comparison, and to speak when there is time for too few
particles. Where the belief is one Gaussian both agree; where it is not, the shadow is what the particles are for.
It has no outlier part. A gate on the normalised innovation keeps a reading out instead, and counts it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, cast

import numpy as np

from filters.belief import STILL, Displacement, Evidence, Joint, Moments
from filters.extended_kalman import ExtendedKalmanFilter, LinearisedMotion, LinearisedSensor
from filters.kalman import Matrix, symmetric
from filters.linearised.altitude import LinearisedAltitude
from filters.linearised.bearing import LinearisedBearing
from filters.linearised.biased_range import LinearisedBiasedRange
from filters.linearised.constant_velocity import LinearisedConstantVelocity
from filters.linearised.down import LinearisedDown
from filters.linearised.free_velocity import LinearisedFreeVelocity
from filters.linearised.heading import LinearisedHeading
from filters.linearised.position import LinearisedPosition
from filters.linearised.range import LinearisedRange
from filters.linearised.range_bearing import LinearisedRangeBearing
from filters.linearised.speed import LinearisedGroundSpeed, LinearisedWheelSpeed
from filters.linearised.unicycle import LinearisedUnicycle
from filters.linearised.velocity import LinearisedVelocity
from filters.motion.constant_velocity import ConstantVelocity
from filters.motion.learned import SlowState
from filters.motion.model import Motion
from filters.motion.unicycle import Unicycle
from filters.sensing import Bearing, Heading, Position, Range, RangeBearing, Sensor, Velocity
from filters.sensing.altitude import Altitude
from filters.sensing.biased_range import BiasedRange
from filters.sensing.down import Down
from filters.sensing.free_velocity import FreeVelocity
from filters.sensing.speed import GroundSpeed, WheelSpeed

LINEARISED: Mapping[type, Callable[[Any], LinearisedSensor[Any]]] = MappingProxyType(
    {
        Altitude: LinearisedAltitude,
        Bearing: LinearisedBearing,
        BiasedRange: LinearisedBiasedRange,
        Down: LinearisedDown,
        GroundSpeed: LinearisedGroundSpeed,
        FreeVelocity: LinearisedFreeVelocity,
        Heading: LinearisedHeading,
        Position: LinearisedPosition,
        Range: LinearisedRange,
        RangeBearing: LinearisedRangeBearing,
        Velocity: LinearisedVelocity,
        WheelSpeed: LinearisedWheelSpeed,
    }
)
"""Which linearised model stands for which sensor model."""

MOTIONS: Mapping[type, Callable[[Any, Sequence[SlowState]], LinearisedMotion[Any]]] = MappingProxyType(
    {Unicycle: LinearisedUnicycle, ConstantVelocity: LinearisedConstantVelocity}
)
"""Which linearised model stands for which motion model."""

_POSE = 3


class ShadowFilter:
    """An extended Kalman filter over all the dimensions of a particle filter.

    Parameters
    ----------
    motion : Motion
        The particle filter's, one of :data:`MOTIONS` or derived from one: its noises and walks are used, and what it
        has learned is not touched.
    slow : sequence of RandomWalk or Learned
        Further states that only wander, as the particle filter has them.
    gate : float
        Probability with which a measurement that the model is right about passes.

    Attributes
    ----------
    rejections : int
        How many measurements the gate has kept out since the last :meth:`initialize`.

    Raises
    ------
    ValueError
        A gate outside (0, 1), or a motion model that has no linearised counterpart.
    """

    def __init__(self, motion: Motion[Any, Any], slow: Sequence[SlowState] = (), gate: float = 0.999) -> None:
        if not 0.0 < gate < 1.0:
            raise ValueError(f"shadow filter: gate is a probability in (0, 1), got {gate}")
        make = next((MOTIONS[kind] for kind in type(motion).__mro__ if kind in MOTIONS), None)
        if make is None:
            known = ", ".join(kind.__name__ for kind in MOTIONS)
            raise ValueError(f"shadow filter: {type(motion).__name__} is not among {known}")
        model = make(motion, slow)
        size = len(model.names)
        self._filter = ExtendedKalmanFilter[Any](model, np.zeros(size), np.zeros((size, size)))
        self._gate = gate
        self.rejections = 0

    @property
    def names(self) -> tuple[str, ...]:
        """Its dimensions: those of the particle filter with the same motion and slow states."""
        return self._filter.names

    @property
    def mean(self) -> Matrix:
        """Mean, (n,) float64, at the horizon."""
        return self._filter.mean

    @property
    def covariance(self) -> Matrix:
        """Covariance, (n, n) float64, at the horizon."""
        return self._filter.covariance

    def initialize(self, moments: Moments) -> None:
        """Start from the moments of another belief, such as the particle filter's.

        Dimensions that follow its own are left out.

        Raises
        ------
        ValueError
            Moments of other dimensions, or that are no Gaussian's; the belief is unchanged then.
        """
        size = len(self.names)
        if moments.names[:size] != self.names:
            raise ValueError(
                f"shadow filter: moments of {', '.join(self.names)} are needed, got {', '.join(moments.names)}"
            )
        covariance = np.diag(np.asarray(moments.variance, np.float64)[:size])
        covariance[:_POSE, :_POSE] = moments.pose_covariance
        self._filter.set(moments.mean[:size], covariance)
        self.rejections = 0

    def predict(self, control: Any, duration: float) -> None:
        """Move the belief; see :meth:`filters.particle.ParticleFilter.predict`."""
        self._filter.predict(control, duration)

    def weigh(self, sensor: Sensor[Any], measurement: tuple[float | None, ...]) -> Evidence:
        """Weigh in a measurement of a particle filter's sensor model; components that are NaN were not measured.

        Returns
        -------
        Evidence
            ``log_mean`` is the log density that the belief gave to the measurement, whether or not it passed
            the gate; ``accepted`` is False if the sensor refused it or the gate kept it out.

        Raises
        ------
        TypeError
            A sensor model that has no linearised counterpart.
        ValueError
            The measurement is infinite; the belief is unchanged then.
        """
        make = LINEARISED.get(type(sensor))
        if make is None:
            known = ", ".join(kind.__name__ for kind in LINEARISED)
            raise TypeError(f"shadow filter: {type(sensor).__name__} is not among {known}")
        if sensor.refusal(measurement) is not None:
            return Evidence(math.nan, math.nan, accepted=False)
        correction = self._filter.correct(make(sensor), measurement, self._gate)
        self.rejections += not correction.accepted
        nu = correction.innovation
        innovation = float(nu[0]) if nu.size == 1 else float(np.linalg.norm(nu))
        return Evidence(correction.log_evidence, innovation, correction.accepted)

    def moments(self, displacement: Displacement | None = None) -> Moments:
        """Mean and covariance after a displacement along the vehicle's own heading, to first order.

        The effective sample size is infinite: nothing was sampled.
        """
        forward, right, turn = STILL if displacement is None else displacement
        mean = self._filter.mean.copy()
        sine, cosine = math.sin(mean[2]), math.cos(mean[2])
        swing = (forward * cosine - right * sine, forward * sine + right * cosine)
        mean[:_POSE] += (*swing, turn)
        mean[2] = cast(float, (mean[2] + math.pi) % (2.0 * math.pi) - math.pi)
        jacobian = np.eye(_POSE)
        jacobian[0, 2], jacobian[1, 2] = -swing[1], swing[0]
        pose = symmetric(jacobian @ self._filter.covariance[:_POSE, :_POSE] @ jacobian.T)
        variance = np.diagonal(self._filter.covariance).copy()
        variance[:_POSE] = np.diagonal(pose)
        return Moments(self.names, mean, pose, variance, math.inf)

    def joint(self, names: Sequence[str]) -> Joint:
        """Mean and covariance of some dimensions together.

        Raises
        ------
        KeyError
            There is no dimension of one of the names.
        """
        rows = [self._filter.rows[name] for name in names]
        return Joint(tuple(names), self._filter.mean[rows], self._filter.covariance[np.ix_(rows, rows)])
