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
from filters.kernels.expectations import (
    expect_heading,
    expect_position,
    expect_range,
    expect_velocity,
    expect_wheel_speed,
)
from filters.linearised.lateness import look_back_at_place, look_back_at_velocity
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
    """What was measured, beside what every live member leads to expect, and zeros for the others; m is 1 or 2.

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
        self._along: Matrix = np.zeros(members)
        self._about: Matrix = np.zeros(members)
        self._walked: Matrix = np.zeros(size)

    def set(self, member: int, mean: ArrayLike, covariance: ArrayLike) -> None:
        """Have a member hold this Gaussian from now on.

        Raises
        ------
        ValueError
            Numbers or shapes that make no Gaussian of these dimensions; the member is unchanged then.
        """
        self._set(slice(member, member + 1), mean, covariance)

    def set_all(self, mean: ArrayLike, covariance: ArrayLike) -> None:
        """Have every member hold this Gaussian from now on; see :meth:`set`."""
        self._set(slice(None), mean, covariance)

    def set_some(self, members: list[int], mean: ArrayLike, covariance: ArrayLike) -> None:
        """Have some members hold this Gaussian from now on; see :meth:`set`."""
        self._set(members, mean, covariance)

    def _set(self, members: slice | list[int], mean: ArrayLike, covariance: ArrayLike) -> None:
        belief = checked_gaussian("bank", mean, covariance)
        if belief.mean.shape != (len(self.names),):
            raise ValueError(f"bank: a mean of {', '.join(self.names)} is needed, got {belief.mean.shape}")
        belief.mean[2] = (belief.mean[2] + math.pi) % (2.0 * math.pi) - math.pi
        self.mean[members] = belief.mean
        self.covariance[members] = belief.covariance
        self.live[members] = True

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
        np.add(along, distance_variance, out=self._along)
        np.add(about, turn_variance, out=self._about)
        np.multiply(self._walk_variances, duration, out=self._walked)
        move.direct(
            self.mean,
            self.covariance,
            self.live,
            control.distance,
            control.turn,
            duration,
            self._along,
            self._about,
            self._walked,
        )

    def expect(self, sensor: Any, measurement: Any) -> Expectations:
        """Linearise a measurement of one of :data:`BATCHED`'s sensors at every live member's mean.

        Raises
        ------
        TypeError
            A sensor model that is not among them.
        ValueError
            Residuals that are not finite.
        """
        kind: type = cast(Any, type)(sensor)
        make = BATCHED.get(kind)
        if make is None:
            known = ", ".join(kind.__name__ for kind in BATCHED)
            raise TypeError(f"bank: {kind.__name__} is not among {known}")
        said = make(sensor, self.rows, self.mean, self.live, measurement)
        if said is None:
            raise ValueError(f"bank: residuals must be finite, got a measurement of {measurement}")
        return said

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
        """
        members, measured = expectations.residual.shape
        limit = math.inf if gate is None else (chi_square.quantile(gate, measured) if gate > 0.0 else -1.0)
        said = Corrections(np.empty(members), np.empty(members), np.empty(members, np.bool_))
        correct.direct(self.mean, self.covariance, chosen & self.live, *expectations, limit, *said)
        return said


def _room(mean: Matrix, components: int) -> Expectations:
    """Return expectations of nothing, for a kernel to write the live members' into."""
    members, size = mean.shape
    return Expectations(
        np.zeros((members, components)),
        np.zeros((members, components, size)),
        np.zeros((members, components)),
    )


def _row(rows: Rows, name: str | None) -> int:
    return -1 if name is None else rows[name]


def _expect_position(
    sensor: Position, rows: Rows, mean: Matrix, live: Flags, measurement: PositionMeasurement
) -> Expectations | None:
    sigma_north = sensor.sigma if measurement.sigma_north is None else measurement.sigma_north
    sigma_east = sigma_north if measurement.sigma_east is None else measurement.sigma_east
    said = _room(mean, 2)
    finite = expect_position.direct(
        mean, live, measurement.north, measurement.east, *sensor.lever, sigma_north, sigma_east, *said
    )
    if finite and sensor.delay is not None:
        residual, jacobian = said.residual[live], said.jacobian[live]
        look_back_at_place(sensor, measurement, rows[sensor.delay], mean[live], residual, jacobian)
        said.residual[live], said.jacobian[live] = residual, jacobian
    return said if finite else None


def _expect_velocity(
    sensor: Velocity, rows: Rows, mean: Matrix, live: Flags, measurement: VelocityMeasurement
) -> Expectations | None:
    sigma = sensor.sigma if measurement.sigma is None else measurement.sigma
    scale = _row(rows, sensor.scale)
    said = _room(mean, 2)
    finite = expect_velocity.direct(
        mean, live, measurement.north, measurement.east, measurement.speed, scale, sigma, *said
    )
    if finite and sensor.delay is not None:
        residual, jacobian = said.residual[live], said.jacobian[live]
        look_back_at_velocity(sensor, measurement, rows[sensor.delay], scale, mean[live], residual, jacobian)
        said.residual[live], said.jacobian[live] = residual, jacobian
    return said if finite else None


def _expect_range(
    sensor: Range, rows: Rows, mean: Matrix, live: Flags, measurement: RangeMeasurement
) -> Expectations | None:
    sigma = sensor.sigma if measurement.sigma is None else measurement.sigma
    scale, bias = _row(rows, sensor.scale), _row(rows, sensor.bias)
    distance, north, east, down = measurement[:4]
    said = _room(mean, 1)
    finite = expect_range.direct(mean, live, distance, north, east, down, scale, bias, sigma, *said)
    return said if finite else None


def _expect_heading(
    sensor: Heading, rows: Rows, mean: Matrix, live: Flags, measurement: HeadingMeasurement
) -> Expectations | None:
    sigma = sensor.sigma if measurement.sigma is None else measurement.sigma
    said = _room(mean, 1)
    finite = expect_heading.direct(mean, live, measurement.heading, _row(rows, sensor.bias), sigma, *said)
    return said if finite else None


def _expect_wheel_speed(
    sensor: WheelSpeed, rows: Rows, mean: Matrix, live: Flags, measurement: WheelSpeedMeasurement
) -> Expectations | None:
    speed, rolled, yaw_rate, right, _ = measurement
    gyro, odometry = rows[GYRO_BIAS], rows[ODOMETRY_SCALE]
    scale, bias = _row(rows, sensor.scale), _row(rows, sensor.bias)
    sigma = sensor.spread(measurement)
    said = _room(mean, 1)
    finite = expect_wheel_speed.direct(
        mean, live, speed, rolled, yaw_rate, right, gyro, odometry, scale, bias, sigma, *said
    )
    return said if finite else None


BATCHED: Mapping[type, Callable[[Any, Rows, Matrix, Flags, Any], Expectations | None]] = MappingProxyType(
    {
        Heading: _expect_heading,
        Position: _expect_position,
        Range: _expect_range,
        Velocity: _expect_velocity,
        WheelSpeed: _expect_wheel_speed,
    }
)
"""How each sensor model of the particle filter is expected by all live members at once; ``None``: not finite."""
