"""A bank of Gaussians over a unicycle's state: many extended Kalman filters that share their controls.

Each member is what :class:`filters.extended_kalman.ExtendedKalmanFilter` is with the models of this package, and comes
out the same; what differs between them is which measurements they take, where they began, and how much noise their
motion is given. All of them are moved by one call and corrected by one call (:mod:`filters.kernels.bank`), so a dozen
costs little more than one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters import chi_square
from filters.kalman import Matrix, checked_gaussian
from filters.kernels.bank import correct, move
from filters.motion.learned import SlowState
from filters.motion.unicycle import Unicycle, UnicycleControl
from filters.sensing import (
    Heading,
    HeadingMeasurement,
    Position,
    PositionMeasurement,
    Range,
    RangeMeasurement,
    Velocity,
    VelocityMeasurement,
)
from filters.sensing.speed import GYRO_BIAS, ODOMETRY_SCALE, WheelSpeed, WheelSpeedMeasurement

Rows = Mapping[str, int]
Flags = NDArray[np.bool_]


class Expectations(NamedTuple):
    """What was measured, beside what every member leads to expect; m is 1 or 2.

    Attributes
    ----------
    residual : (B, m) float64
        Measured minus expected; angles in [-pi, pi].
    jacobian : (B, m, d) float64
        H of every member.
    noise : (B, m) float64
        Variances of the measurement's components, which are independent.
    """

    residual: Matrix
    jacobian: Matrix
    noise: Matrix


class Corrections(NamedTuple):
    """What a measurement said to every member; NaN for those that were not asked.

    Attributes
    ----------
    nis : (B,) float64
        Normalised innovation squared.
    log_evidence : (B,) float64
        Logarithm of the density that the member gave to the measurement.
    accepted : (B,) bool
        Whether it passed the gate and was weighed in.
    """

    nis: Matrix
    log_evidence: Matrix
    accepted: Flags


class GaussianBank:
    """So many Gaussians over pose, gyro bias, odometry scale and slow states.

    Parameters
    ----------
    motion : Unicycle
        Its noises and walks are used; what it has learned is not.
    slow : sequence of RandomWalk or Learned
        Further states that only wander.
    members : int
        How many there are room for; none is live at first.

    Attributes
    ----------
    names : tuple of str
        The state's dimensions.
    mean : (B, d) float64
    covariance : (B, d, d) float64
    live : (B,) bool
        Which members hold a belief; the others are neither moved nor corrected.

    Raises
    ------
    ValueError
        Fewer than one member.
    """

    def __init__(self, motion: Unicycle, slow: Sequence[SlowState] = (), members: int = 1) -> None:
        if members < 1:
            raise ValueError(f"bank: at least one member, got {members}")
        self._motion = motion
        self.names = (*motion.names, *(walk.name for walk in slow))
        self.rows = {name: row for row, name in enumerate(self.names)}
        size = len(self.names)
        walks = [0.0, 0.0, 0.0, motion.gyro_bias_walk, motion.odometry_scale_walk, *(w.walk for w in slow)]
        self._walk_variances = np.square(np.array(walks, np.float64))
        self.mean: Matrix = np.zeros((members, size))
        self.covariance: Matrix = np.zeros((members, size, size))
        self.live: Flags = np.zeros(members, np.bool_)
        self._ones: Matrix = np.ones(members)

    def set(self, member: int, mean: ArrayLike, covariance: ArrayLike) -> None:
        """Have a member hold this Gaussian from now on.

        Raises
        ------
        ValueError
            Numbers or shapes that make no Gaussian of these dimensions; the member is unchanged then.
        """
        belief = checked_gaussian("bank", mean, covariance)
        if belief.mean.shape != (len(self.names),):
            raise ValueError(f"bank: a mean of {', '.join(self.names)} is needed, got {belief.mean.shape}")
        self.mean[member] = belief.mean
        self.mean[member, 2] = (belief.mean[2] + math.pi) % (2.0 * math.pi) - math.pi
        self.covariance[member] = belief.covariance
        self.live[member] = True

    def predict(
        self,
        control: UnicycleControl,
        duration: float,
        distance_variance: Matrix | float = 0.0,
        turn_variance: Matrix | float = 0.0,
    ) -> None:
        """Move every live member; see :class:`filters.linearised.LinearisedUnicycle`.

        Parameters
        ----------
        control : UnicycleControl
            What odometer and gyro said.
        duration : float
            Seconds, not negative.
        distance_variance, turn_variance : array of (B,), or a number
            Beyond what the motion model has, for every member: m² and rad².

        Raises
        ------
        ValueError
            A number that is negative or not finite; nothing has moved then.
        """
        if not (0.0 <= duration < math.inf and all(map(math.isfinite, control))):
            raise ValueError(f"bank: control and duration must be finite, got {control} over {duration} s")
        along, about = self._motion.noise_variances(control, duration)
        move(
            self.mean,
            self.covariance,
            self.live,
            control.distance,
            control.turn,
            duration,
            self._ones * along + distance_variance,
            self._ones * about + turn_variance,
            self._walk_variances * duration,
        )

    def expect(self, sensor: Any, measurement: Any) -> Expectations:
        """Linearise a measurement of one of :data:`BATCHED`'s sensors at every member's mean.

        Raises
        ------
        TypeError
            A sensor model that is not among them.
        """
        kind: type = cast(Any, type)(sensor)
        make = BATCHED.get(kind)
        if make is None:
            known = ", ".join(kind.__name__ for kind in BATCHED)
            raise TypeError(f"bank: {kind.__name__} is not among {known}")
        return make(sensor, self.rows, self.mean, measurement)

    def correct(self, expectations: Expectations, chosen: Flags, gate: float | None = None) -> Corrections:
        """Weigh a measurement into the chosen members, each by its own expectation of it.

        Parameters
        ----------
        expectations : Expectations
            Of :meth:`expect`, at the means as they still are.
        chosen : (B,) bool
            Who takes it; those that are not live do not.
        gate : float, optional
            Probability with which a measurement that the model is right about passes; a gate of 0 keeps everything
            out, so that the evidence is all that comes of it.

        Raises
        ------
        ValueError
            Residuals that are not finite; nothing has changed then.
        """
        members, measured = expectations.residual.shape
        if not np.isfinite(expectations.residual[self.live]).all():
            raise ValueError(f"bank: residuals must be finite, got {expectations.residual.tolist()}")
        limit = math.inf if gate is None else (chi_square.quantile(gate, measured) if gate > 0.0 else -1.0)
        said = Corrections(np.empty(members), np.empty(members), np.empty(members, np.bool_))
        correct(self.mean, self.covariance, chosen & self.live, *expectations, limit, *said)
        return said


def _expect_position(
    sensor: Position, rows: Rows, mean: Matrix, measurement: PositionMeasurement
) -> Expectations:
    north, east, heading = rows["north"], rows["east"], rows["heading"]
    forward, right = sensor.lever
    sine, cosine = np.sin(mean[:, heading]), np.cos(mean[:, heading])
    ahead, aside = forward * cosine - right * sine, forward * sine + right * cosine
    jacobian = np.zeros((len(mean), 2, mean.shape[1]))
    jacobian[:, 0, north] = jacobian[:, 1, east] = 1.0
    jacobian[:, 0, heading], jacobian[:, 1, heading] = -aside, ahead
    residual = np.stack(
        (measurement.north - mean[:, north] - ahead, measurement.east - mean[:, east] - aside), axis=1
    )
    sigma_north = sensor.sigma if measurement.sigma_north is None else measurement.sigma_north
    sigma_east = sigma_north if measurement.sigma_east is None else measurement.sigma_east
    noise = np.empty_like(residual)
    noise[:] = sigma_north**2, sigma_east**2
    return Expectations(residual, jacobian, noise)


def _expect_velocity(
    sensor: Velocity, rows: Rows, mean: Matrix, measurement: VelocityMeasurement
) -> Expectations:
    heading, scale = rows["heading"], sensor.scale
    speed = measurement.speed * (np.ones(len(mean)) if scale is None else mean[:, rows[scale]])
    sine, cosine = np.sin(mean[:, heading]), np.cos(mean[:, heading])
    jacobian = np.zeros((len(mean), 2, mean.shape[1]))
    jacobian[:, 0, heading], jacobian[:, 1, heading] = -speed * sine, speed * cosine
    if scale is not None:
        jacobian[:, 0, rows[scale]] = measurement.speed * cosine
        jacobian[:, 1, rows[scale]] = measurement.speed * sine
    residual = np.stack((measurement.north - speed * cosine, measurement.east - speed * sine), axis=1)
    sigma = sensor.sigma if measurement.sigma is None else measurement.sigma
    return Expectations(residual, jacobian, np.full_like(residual, sigma**2))


def _expect_range(sensor: Range, rows: Rows, mean: Matrix, measurement: RangeMeasurement) -> Expectations:
    north = mean[:, rows["north"]] - measurement.north
    east = mean[:, rows["east"]] - measurement.east
    distance = np.sqrt(north * north + east * east + measurement.down_difference**2)
    scale = np.ones(len(mean)) if sensor.scale is None else mean[:, rows[sensor.scale]]
    bias = 0.0 if sensor.bias is None else mean[:, rows[sensor.bias]]
    jacobian = np.zeros((len(mean), 1, mean.shape[1]))
    per_metre = np.divide(scale, distance, out=np.zeros(len(mean)), where=distance > 0.0)
    jacobian[:, 0, rows["north"]] = per_metre * north
    jacobian[:, 0, rows["east"]] = per_metre * east
    if sensor.scale is not None:
        jacobian[:, 0, rows[sensor.scale]] = distance
    if sensor.bias is not None:
        jacobian[:, 0, rows[sensor.bias]] = 1.0
    residual = (measurement.distance - scale * distance - bias)[:, None]
    sigma = sensor.sigma if measurement.sigma is None else measurement.sigma
    return Expectations(np.ascontiguousarray(residual), jacobian, np.full_like(residual, sigma**2))


def _expect_heading(
    sensor: Heading, rows: Rows, mean: Matrix, measurement: HeadingMeasurement
) -> Expectations:
    jacobian = np.zeros((len(mean), 1, mean.shape[1]))
    jacobian[:, 0, rows["heading"]] = 1.0
    expected = mean[:, rows["heading"]].copy()
    if sensor.bias is not None:
        jacobian[:, 0, rows[sensor.bias]] = 1.0
        expected += mean[:, rows[sensor.bias]]
    residual = np.remainder(measurement.heading - expected + math.pi, 2.0 * math.pi)[:, None] - math.pi
    sigma = sensor.sigma if measurement.sigma is None else measurement.sigma
    return Expectations(residual, jacobian, np.full_like(residual, sigma**2))


def _expect_wheel_speed(
    sensor: WheelSpeed, rows: Rows, mean: Matrix, measurement: WheelSpeedMeasurement
) -> Expectations:
    odometry, gyro = rows[ODOMETRY_SCALE], rows[GYRO_BIAS]
    turning = measurement.yaw_rate - mean[:, gyro]
    speed = mean[:, odometry] * measurement.rolled - measurement.right * turning
    scale = np.ones(len(mean)) if sensor.scale is None else mean[:, rows[sensor.scale]]
    bias = 0.0 if sensor.bias is None else mean[:, rows[sensor.bias]]
    jacobian = np.zeros((len(mean), 1, mean.shape[1]))
    jacobian[:, 0, odometry] = scale * measurement.rolled
    jacobian[:, 0, gyro] = scale * measurement.right
    if sensor.scale is not None:
        jacobian[:, 0, rows[sensor.scale]] = speed
    if sensor.bias is not None:
        jacobian[:, 0, rows[sensor.bias]] = 1.0
    residual = (measurement.speed - scale * speed - bias)[:, None]
    return Expectations(residual, jacobian, np.full_like(residual, sensor.spread(measurement) ** 2))


BATCHED: Mapping[type, Callable[[Any, Rows, Matrix, Any], Expectations]] = MappingProxyType(
    {
        Heading: _expect_heading,
        Position: _expect_position,
        Range: _expect_range,
        Velocity: _expect_velocity,
        WheelSpeed: _expect_wheel_speed,
    }
)
"""How each sensor model of the particle filter is expected by all members at once."""
