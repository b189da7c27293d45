"""The extended Kalman filter: a Gaussian belief under motion and measurements that are linearised at its mean.

Table 3.3 of *Probabilistic Robotics*. With x' = g(x, u) + noise, z = h(x) + noise and their Jacobians G and H::

    predict   x = g(x, u)              C = G C Gᵀ + R
    correct   K = C Hᵀ (H C Hᵀ + Q)⁻¹  x += K (z - h(x))   C = (I - K H) C (I - K H)ᵀ + K Q Kᵀ

A model hands over values and Jacobians together, taken at one mean, so that neither can be of another place. The
arithmetic of the correction is the Kalman filter's own. Models of the vehicle and its sensors:
:mod:`filters.linearised`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from filters.duration import require_duration
from filters.kalman import (
    Correction,
    Expectation,
    Gaussian,
    Matrix,
    checked_angles,
    checked_gaussian,
    corrected,
    require_finite,
    require_shape,
    wrap,
)
from filters.kernels.kalman import propagate

Control = TypeVar("Control")
ControlIn = TypeVar("ControlIn", contravariant=True)
Measurement = TypeVar("Measurement", contravariant=True)
M = TypeVar("M")


class Transition(NamedTuple):
    """Where a motion takes a state, to first order.

    Attributes
    ----------
    mean : (n,) float64
        g(x, u).
    jacobian : (n, n) float64
        G, the derivative of g by the state.
    noise : (n, n) float64
        R, the covariance of what the motion adds.
    """

    mean: Matrix
    jacobian: Matrix
    noise: Matrix


class LinearisedMotion(Protocol[ControlIn]):
    """The named requirement of a motion model."""

    @property
    def names(self) -> tuple[str, ...]:
        """The state's dimensions, in their order."""
        ...

    @property
    def angles(self) -> tuple[int, ...]:
        """Which of them are angles, radians."""
        ...

    def move(self, mean: Matrix, control: ControlIn, duration: float) -> Transition:
        """Linearise the motion at ``mean`` over ``duration`` seconds.

        Raises
        ------
        ValueError
            A control that is not finite.
        """
        ...


class LinearisedSensor(Protocol[Measurement]):
    """The named requirement of a sensor model."""

    def expect(self, rows: Mapping[str, int], mean: Matrix, measurement: Measurement) -> Expectation:
        """Linearise the measurement at ``mean``, whose dimensions lie at ``rows``.

        Raises
        ------
        KeyError
            The state lacks a dimension that the sensor refers to.
        """
        ...


class ExtendedKalmanFilter(Generic[Control]):
    """A Gaussian belief, moved and corrected by models that it linearises at its mean.

    Parameters
    ----------
    motion : LinearisedMotion
        It says what the dimensions are.
    mean : (n,) array
        Of the state.
    covariance : (n, n) array
        Symmetric, positive semi-definite.

    Raises
    ------
    ValueError
        Shapes that do not fit the motion's dimensions, numbers that are not finite, a covariance that is not
        symmetric or has a negative variance.
    """

    def __init__(self, motion: LinearisedMotion[Control], mean: ArrayLike, covariance: ArrayLike) -> None:
        self._motion = motion
        self.names = motion.names
        self.rows = {name: row for row, name in enumerate(self.names)}
        self.angles = checked_angles("extended Kalman filter", motion.angles, len(self.names))
        self.mean: Matrix
        self.covariance: Matrix
        self.set(mean, covariance)

    def set(self, mean: ArrayLike, covariance: ArrayLike) -> None:
        """Replace the belief.

        Raises
        ------
        ValueError
            As for the class; the belief is unchanged then.
        """
        belief = checked_gaussian("extended Kalman filter", mean, covariance)
        require_shape(
            f"extended Kalman filter: mean ({', '.join(self.names)})", belief.mean, (len(self.names),)
        )
        wrap(belief.mean, self.angles)
        self.mean, self.covariance = belief

    def predict(self, control: Control, duration: float) -> None:
        """Move the belief by a control.

        Parameters
        ----------
        control : Control
            As the motion model wants it.
        duration : float
            Seconds, not negative.

        Raises
        ------
        ValueError
            A duration or control that is negative or not finite; the belief is unchanged then.
        """
        require_duration("extended Kalman filter", duration)
        mean, jacobian, noise = self._motion.move(self.mean, control, duration)
        covariance = np.empty_like(self.covariance)
        finite = propagate.direct(
            np.ascontiguousarray(jacobian, np.float64),
            self.covariance,
            np.ascontiguousarray(noise, np.float64),
            covariance,
        )
        if not (finite and math.isfinite(mean.sum())):
            require_finite("extended Kalman prediction", mean, covariance)
        wrap(mean, self.angles)
        self.mean, self.covariance = mean, covariance

    def correct(self, sensor: LinearisedSensor[M], measurement: M, gate: float | None = None) -> Correction:
        """Weigh in a measurement; components that are NaN were not measured.

        Parameters
        ----------
        sensor : LinearisedSensor
            The model.
        measurement : Measurement
            As the sensor wants it.
        gate : float, optional
            Probability with which a measurement that the model is right about passes; the rest is kept out, and
            the correction says so.

        Raises
        ------
        ValueError
            Numbers that are not finite; the belief is unchanged then.
        numpy.linalg.LinAlgError
            The innovation's covariance is not positive; the belief is unchanged then.
        """
        expectation = sensor.expect(self.rows, self.mean, measurement)
        belief, correction = corrected(Gaussian(self.mean, self.covariance), expectation, gate)
        wrap(belief.mean, self.angles)
        self.mean, self.covariance = belief
        return correction


def numerical_jacobian(
    function: Callable[[Matrix], Matrix], point: ArrayLike, step: float = 1e-6, angles: Sequence[int] = ()
) -> Matrix:
    """Differentiate a function by central differences: what a model's own Jacobian is to be checked against.

    Parameters
    ----------
    function : (n,) float64 -> (m,) float64
        Smooth at the point.
    point : (n,) array
        Where.
    step : float
        Relative to each component, or absolute where that is below 1. The error is about step² and 1e-16/step.
    angles : sequence of int, optional
        Components of the result that are angles: their differences are taken in [-pi, pi].

    Returns
    -------
    (m, n) float64
    """
    x = np.array(point, np.float64, ndmin=1)
    columns: list[Matrix] = []
    for k in range(x.size):
        width = step * max(1.0, abs(float(x[k])))
        ahead, behind = x.copy(), x.copy()
        ahead[k] += width
        behind[k] -= width
        difference = function(ahead) - function(behind)
        wrap(difference, angles)
        columns.append(difference / (ahead[k] - behind[k]))
    return np.stack(columns, axis=1)
