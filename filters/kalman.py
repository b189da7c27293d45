"""The Kalman filter: the exact belief where everything is linear and Gaussian.

Prediction and correction as in Table 3.1 of *Probabilistic Robotics*, with Joseph's form of the covariance,
which stays symmetric and positive whatever the rounding of the gain.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Matrix = NDArray[np.float64]


class Correction(NamedTuple):
    """What a measurement did.

    Attributes
    ----------
    innovation : (measured,) float64
        Measured minus expected.
    innovation_covariance : (measured, measured) float64
        What was to be expected of it.
    nis : float
        Normalised innovation squared: chi-square with ``measured`` degrees of freedom if the model is right.
    """

    innovation: Matrix
    innovation_covariance: Matrix
    nis: float


class KalmanFilter:
    """A Gaussian belief under linear motion and linear measurements.

    Parameters
    ----------
    mean : (n,) array
        Of the state.
    covariance : (n, n) array
        Symmetric, positive semi-definite.

    Raises
    ------
    ValueError
        Shapes that do not fit, or numbers that are not finite.
    """

    def __init__(self, mean: ArrayLike, covariance: ArrayLike) -> None:
        self.mean: Matrix = np.array(mean, np.float64, ndmin=1)
        self.covariance: Matrix = np.array(covariance, np.float64, ndmin=2)
        size = self.mean.size
        if self.mean.shape != (size,) or self.covariance.shape != (size, size):
            raise ValueError(
                f"Kalman filter: mean (n,) and covariance (n, n) are needed, got {self.mean.shape} and "
                f"{self.covariance.shape}"
            )
        _require_finite("Kalman filter", self.mean, self.covariance)

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
            B and u.

        Raises
        ------
        ValueError
            Numbers that are not finite; the belief is unchanged then.
        """
        matrix = _matrix(transition)
        spread = _matrix(noise)
        mean = matrix @ self.mean
        if control_gain is not None and control is not None:
            mean = mean + _matrix(control_gain) @ np.array(control, np.float64, ndmin=1)
        covariance = matrix @ self.covariance @ matrix.T + spread
        _require_finite("Kalman prediction", mean, covariance)
        self.mean, self.covariance = mean, covariance

    def correct(self, measurement: ArrayLike, model: ArrayLike, noise: ArrayLike) -> Correction:
        """Weigh in a measurement z = C x + v; NaN among its components means that this one was not measured.

        Parameters
        ----------
        measurement : (m,) array
            z.
        model : (m, n) array
            C.
        noise : (m, m) array
            Q, the covariance of v.

        Returns
        -------
        Correction
            Of the components that were measured.

        Raises
        ------
        ValueError
            An infinite measurement, or numbers in ``model`` or ``noise`` that are not finite; the belief is
            unchanged then.
        numpy.linalg.LinAlgError
            The innovation's covariance has no inverse.
        """
        z = np.array(measurement, np.float64, ndmin=1)
        measured = np.flatnonzero(~np.isnan(z))
        z = z[measured]
        observation = _matrix(model)[measured]
        spread = _matrix(noise)[np.ix_(measured, measured)]
        _require_finite("Kalman correction", z, observation, spread)
        innovation = z - observation @ self.mean
        innovation_covariance = observation @ self.covariance @ observation.T + spread
        gain = np.linalg.solve(innovation_covariance, observation @ self.covariance).T
        nis = float(innovation @ np.linalg.solve(innovation_covariance, innovation))
        remaining = np.eye(self.mean.size) - gain @ observation
        self.mean = self.mean + gain @ innovation
        self.covariance = remaining @ self.covariance @ remaining.T + gain @ spread @ gain.T
        return Correction(innovation, innovation_covariance, nis)


def _matrix(values: ArrayLike) -> Matrix:
    return np.array(values, np.float64, ndmin=2)


def _require_finite(where: str, *arrays: Matrix) -> None:
    for array in arrays:
        if not np.isfinite(array).all():
            raise ValueError(f"{where}: every number must be finite, got {array.tolist()}")
