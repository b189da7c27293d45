"""The Kalman filter: the exact belief where everything is linear and Gaussian.

Prediction and correction as in Table 3.1 of *Probabilistic Robotics*, with Joseph's form of the covariance,
which stays symmetric and positive whatever the rounding of the gain. The same correction serves the extended
Kalman filter (:mod:`filters.extended_kalman`), which brings an innovation and a Jacobian of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters import chi_square
from filters.kernels import kalman as kernels

Matrix = NDArray[np.float64]

LOG_TWO_PI = kernels.LOG_TWO_PI


class Correction(NamedTuple):
    """What a measurement did.

    Attributes
    ----------
    innovation : (measured,) float64
        Measured minus expected, of the components that were measured; angles in [-pi, pi].
    innovation_covariance : (measured, measured) float64
        What was to be expected of it.
    nis : float
        Normalised innovation squared: chi-square with ``measured`` degrees of freedom if the model is right.
    log_evidence : float
        Logarithm of the density that the belief gave to the measurement; 0 where nothing was measured.
    accepted : bool
        False if the gate kept it out; the belief is unchanged then.
    """

    innovation: Matrix
    innovation_covariance: Matrix
    nis: float
    log_evidence: float
    accepted: bool


class Gaussian(NamedTuple):
    """A mean, (n,), and a covariance, (n, n)."""

    mean: Matrix
    covariance: Matrix


class Expectation(NamedTuple):
    """What was measured, beside what a state leads to expect.

    Attributes
    ----------
    measured : (m,) float64
        z; NaN among its components means that this one was not measured.
    expected : (m,) float64
        C x, or h(x).
    jacobian : (m, n) float64
        H: C itself, or the derivative of h at x.
    noise : (m, m) float64
        Q, the covariance of the measurement's noise.
    angles : tuple of int
        Components that are angles: their innovation is taken in [-pi, pi].
    """

    measured: Matrix
    expected: Matrix
    jacobian: Matrix
    noise: Matrix
    angles: tuple[int, ...] = ()


class KalmanFilter:
    """A Gaussian belief under linear motion and linear measurements.

    Parameters
    ----------
    mean : (n,) array
        Of the state.
    covariance : (n, n) array
        Symmetric, positive semi-definite.
    angles : sequence of int, optional
        Components of the state that are angles, radians: they are kept in [-pi, pi].

    Raises
    ------
    ValueError
        Shapes that do not fit, numbers that are not finite, a covariance that is not symmetric or has a
        negative variance.
    """

    def __init__(self, mean: ArrayLike, covariance: ArrayLike, angles: Sequence[int] = ()) -> None:
        self.mean: Matrix
        self.covariance: Matrix
        self.mean, self.covariance = checked_gaussian("Kalman filter", mean, covariance)
        self.angles = checked_angles("Kalman filter", angles, self.mean.size)
        wrap(self.mean, self.angles)

    def predict(
        self,
        transition: ArrayLike,
        noise: ArrayLike,
        control_gain: ArrayLike | None = None,
        control: ArrayLike | None = None,
    ) -> None:
        """Move the belief: x = A x + B u, C = A C Aᵀ + R.

        Parameters
        ----------
        transition : (n, n) array
            A.
        noise : (n, n) array
            R, the covariance of the motion's noise over this prediction.
        control_gain, control : (n, m) and (m,) array, optional
            B and u; both or neither.

        Raises
        ------
        ValueError
            Shapes that do not fit, numbers that are not finite, a control without a gain; the belief is
            unchanged then.
        """
        size = self.mean.size
        matrix = _matrix(transition)
        spread = _matrix(noise)
        require_shape("Kalman prediction: transition", matrix, (size, size))
        require_shape("Kalman prediction: noise", spread, (size, size))
        mean = matrix @ self.mean
        if (control_gain is None) != (control is None):
            raise ValueError("Kalman prediction: control_gain and control are needed together, got only one")
        if control_gain is not None and control is not None:
            command = np.array(control, np.float64, ndmin=1)
            gain = _matrix(control_gain)
            require_shape("Kalman prediction: control_gain", gain, (size, command.size))
            mean = mean + gain @ command
        covariance = symmetric(matrix @ self.covariance @ matrix.T + spread)
        require_finite("Kalman prediction", mean, covariance)
        wrap(mean, self.angles)
        self.mean, self.covariance = mean, covariance

    def correct(
        self,
        measurement: ArrayLike,
        model: ArrayLike,
        noise: ArrayLike,
        angles: Sequence[int] = (),
        gate: float | None = None,
    ) -> Correction:
        """Weigh in a measurement z = C x + v; NaN among its components means that this one was not measured.

        Parameters
        ----------
        measurement : (m,) array
            z.
        model : (m, n) array
            C.
        noise : (m, m) array
            Q, the covariance of v. What it says of components that were not measured is not read.
        angles : sequence of int, optional
            Components of the measurement that are angles: their innovation is taken in [-pi, pi].
        gate : float, optional
            Probability with which a measurement that the model is right about passes; the rest is kept out.

        Returns
        -------
        Correction
            Of the components that were measured.

        Raises
        ------
        ValueError
            Shapes that do not fit, an infinite measurement, or numbers in ``model`` or ``noise`` that are not
            finite; the belief is unchanged then.
        numpy.linalg.LinAlgError
            The innovation's covariance is not positive; the belief is unchanged then.
        """
        z = np.array(measurement, np.float64, ndmin=1)
        observation = _matrix(model)
        require_shape("Kalman correction: model", observation, (z.size, self.mean.size))
        expectation = Expectation(z, observation @ self.mean, observation, _matrix(noise), tuple(angles))
        belief, correction = corrected(Gaussian(self.mean, self.covariance), expectation, gate)
        wrap(belief.mean, self.angles)
        self.mean, self.covariance = belief
        return correction


def corrected(
    belief: Gaussian, expectation: Expectation, gate: float | None = None
) -> tuple[Gaussian, Correction]:
    """Weigh a measurement into a Gaussian, with Joseph's form of the covariance.

    With S = H C Hᵀ + Q and K = C Hᵀ S⁻¹::

        ν = z - expected,   x += K ν,   C = (I - K H) C (I - K H)ᵀ + K Q Kᵀ
        NIS = νᵀ S⁻¹ ν,   log evidence = -(NIS + log det S + m log 2π) / 2

    Parameters
    ----------
    belief : Gaussian
        Before; it is not written to.
    expectation : Expectation
        What was measured and what the belief's mean leads to expect.
    gate : float, optional
        Probability with which a right measurement passes: the NIS must not exceed this quantile of chi-square.

    Raises
    ------
    ValueError
        Shapes that do not fit, or numbers that are not finite, NaN for what was not measured apart.
    numpy.linalg.LinAlgError
        S is not positive.
    """
    z, expected, jacobian, noise, angles = expectation
    require_shape("Kalman correction: expected", expected, z.shape)
    require_shape("Kalman correction: model", jacobian, (z.size, belief.mean.size))
    require_shape("Kalman correction: noise", noise, (z.size, z.size))
    residual = z - expected
    wrap(residual, checked_angles("Kalman correction", angles, z.size))
    if np.isnan(z).any():
        measured = np.flatnonzero(~np.isnan(z))
        residual, jacobian = residual[measured], jacobian[measured]
        noise = noise[np.ix_(measured, measured)]
    nu = np.ascontiguousarray(residual)
    if nu.size == 0:
        return belief, Correction(nu, noise, 0.0, 0.0, accepted=True)
    spread, mean, covariance = (
        np.empty_like(noise),
        np.empty_like(belief.mean),
        np.empty_like(belief.covariance),
    )
    fate, nis, log_evidence = kernels.correct.direct(
        np.ascontiguousarray(belief.mean),
        np.ascontiguousarray(belief.covariance),
        nu,
        np.ascontiguousarray(jacobian, np.float64),
        np.ascontiguousarray(noise, np.float64),
        math.inf if gate is None else chi_square.quantile(gate, nu.size),
        spread,
        mean,
        covariance,
    )
    if fate == kernels.NOT_FINITE:
        require_finite("Kalman correction", nu, jacobian, noise)
    if fate == kernels.NOT_POSITIVE:
        raise np.linalg.LinAlgError(
            f"Kalman correction: what is expected has no positive covariance: {spread}"
        )
    accepted = fate == kernels.ACCEPTED
    correction = Correction(nu, spread, nis, log_evidence, accepted)
    return (Gaussian(mean, covariance) if accepted else belief), correction


def joseph(covariance: Matrix, gain: Matrix, observation: Matrix, noise: Matrix) -> Matrix:
    """Return the covariance after a correction: (I - K H) C (I - K H)ᵀ + K Q Kᵀ, right for any gain K."""
    remaining = np.eye(len(covariance)) - gain @ observation
    return symmetric(remaining @ covariance @ remaining.T + gain @ noise @ gain.T)


def wrap(values: Matrix, angles: Sequence[int]) -> None:
    """Bring the named components into [-pi, pi], in place; NaN stays NaN."""
    for k in angles:
        if abs(values[k]) > math.pi:
            values[k] = math.remainder(values[k], 2.0 * math.pi)


def symmetric(matrix: Matrix) -> Matrix:
    """Return the symmetric part: what rounding adds to the rest would grow."""
    return 0.5 * (matrix + matrix.T)


def checked_gaussian(where: str, mean: ArrayLike, covariance: ArrayLike) -> Gaussian:
    """Return copies of a mean and a covariance as float64.

    Raises
    ------
    ValueError
        Shapes that do not fit, numbers that are not finite, a covariance that is not symmetric or has a
        negative variance.
    """
    middle = np.array(mean, np.float64, ndmin=1)
    spread = np.array(covariance, np.float64, ndmin=2)
    size = middle.size
    if middle.shape != (size,) or spread.shape != (size, size):
        raise ValueError(
            f"{where}: mean (n,) and covariance (n, n) are needed, got {middle.shape} and {spread.shape}"
        )
    require_finite(where, middle, spread)
    if size and np.abs(spread - spread.T).max() > 1e-9 * np.abs(spread).max():
        raise ValueError(f"{where}: a covariance must be symmetric, got {spread.tolist()}")
    if (np.diagonal(spread) < 0.0).any():
        raise ValueError(f"{where}: a variance must not be negative, got {np.diagonal(spread).tolist()}")
    return Gaussian(middle, symmetric(spread))


def checked_angles(where: str, angles: Sequence[int], size: int) -> tuple[int, ...]:
    """Return which components are angles.

    Raises
    ------
    ValueError
        There is no such component.
    """
    chosen = tuple(angles)
    if any(not 0 <= k < size for k in chosen):
        raise ValueError(f"{where}: angles must be components 0 to {size - 1}, got {chosen}")
    return chosen


def require_shape(what: str, matrix: Matrix, shape: tuple[int, ...]) -> None:
    """Raise ValueError if a matrix has another shape."""
    if matrix.shape != shape:
        raise ValueError(f"{what} must be {shape}, got {matrix.shape}")


def require_finite(where: str, *arrays: Matrix) -> None:
    """Raise ValueError if a number is not finite."""
    for array in arrays:
        if not np.isfinite(array).all():
            raise ValueError(f"{where}: every number must be finite, got {array.tolist()}")


def _matrix(values: ArrayLike) -> Matrix:
    return np.array(values, np.float64, ndmin=2)
