"""The marginalised (Rao-Blackwellised) particle filter: particles for what is nonlinear, a Kalman filter for the rest.

Schön, Gustafsson and Nordlund, "Marginalized particle filters for mixed linear/nonlinear state-space models", IEEE
TSP 53(7), 2005, their triangular model (Model 2), a little widened. With nonlinear states x in the particles and states
l that are linear and Gaussian once a particle's path is given::

    v = a + A l + w,   w ~ N(0, Q)         the increment that the motion draws
    x' = f(x, v)                           any function of each particle; Model 2 is x' = f(x) + v
    l' = F l + d + r,  r ~ N(0, R)
    z = h(x) + C l + e,  e ~ N(0, S)

Each particle carries its own mean of l as columns. A, F and C are the same for all particles, and so is the covariance
P of l: one matrix, whatever the number of particles. One step draws v with the uncertainty of l in it, takes the draw
as a measurement of l, and moves::

    V = A P Aᵀ + Q = L Lᵀ,   v = a + A l + L n,   l += P Aᵀ L⁻ᵀ n,   P = P - P Aᵀ V⁻¹ A P
    x' = f(x, v),   l = F l + d,   P = F P Fᵀ + R

A measurement weighs each particle by N(z; h(x) + C l, C P Cᵀ + S) and corrects its l by the Kalman gain that all share.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar

import numpy as np

from filters.belief import Evidence
from filters.duration import require_duration
from filters.kalman import LOG_TWO_PI, Matrix, joseph, symmetric, wrap
from filters.kernels import marginal as kernels
from filters.kernels import random
from filters.kernels.compile import Float32Array
from filters.marginal_belief import MarginalBelief
from filters.mixed import MixedMotion, MixedSensor, check_observation, check_step
from filters.sensing.model import Sensor

Control = TypeVar("Control")
M = TypeVar("M")

_SINGULAR = 1e-12
"""A pivot this much smaller than its variance is rounding: that direction of the increment is certain."""


class MarginalFilter(MarginalBelief, Generic[Control]):
    """Particles with a Kalman filter each, which share one covariance.

    With no linear states it is the plain particle filter of Table 4.3; with no nonlinear ones it is the Kalman filter.

    Parameters
    ----------
    motion : MixedMotion
        It says what the columns are.
    capacity : int
        Most particles that there can be; allocated here, once.
    seed : int
        Of all its random numbers.
    block : int
        Particles that are worked on at a time.

    Attributes
    ----------
    covariance, collapses
        Of :class:`filters.marginal_belief.MarginalBelief`.

    Raises
    ------
    ValueError
        A capacity or block below 1, no dimensions, or a name that occurs twice.
    """

    def __init__(
        self, motion: MixedMotion[Control], capacity: int, seed: int = 0, block: int = 32_768
    ) -> None:
        super().__init__(motion.nonlinear, motion.linear, motion.angles, capacity, seed, block)
        self._motion = motion
        self._step = 0

    def predict(self, control: Control, duration: float) -> None:
        """Move every particle, each with its own noise, and learn its linear states from where it went.

        Parameters
        ----------
        control : Control
            As the motion model wants it.
        duration : float
            Seconds, not negative.

        Raises
        ------
        ValueError
            A duration or control that is negative or not finite; nothing has moved then.
        """
        require_duration("predict", duration)
        step = self._motion.begin(control, duration)
        check_step(step, len(self.covariance))
        root, learning, gain = draw(self.covariance, step.coupling, step.noise)
        drawn = joseph(self.covariance, gain, step.coupling, step.noise)
        self.covariance = symmetric(step.transition @ drawn @ step.transition.T + step.linear_noise)
        self._step += 1
        pairs = (step.offset.size + 1) // 2
        keys = [random.key(self._seed, pair) for pair in range(pairs)]
        coupling, spread, learning = _float32(step.coupling), _float32(root), _float32(learning)
        stays = np.array_equal(step.transition, np.eye(len(step.transition))) and not step.drift.any()
        noise = np.zeros((2 * pairs, self._block), np.float32)
        increments = np.zeros((step.offset.size, self._block), np.float32)
        for first, last in self._bounds:
            for pair, key in enumerate(keys):
                random.normal_pairs(first, last, self._step & 0xFFFFFFFF, key, noise, 2 * pair)
            increments[:] = step.offset[:, None]
            means = self._particles.columns[self._sampled :]
            kernels.add_product(coupling, means, first, increments, 0, last - first)
            kernels.add_product(spread, noise, 0, increments, 0, last - first)
            kernels.add_product(learning, noise, 0, means, first, last - first)
            self._motion.move(self._particles, first, last, increments)
            if not stays:
                moved = np.repeat(step.drift.astype(np.float32)[:, None], last - first, axis=1)
                kernels.add_product(_float32(step.transition), means, first, moved, 0, last - first)
                means[:, first:last] = moved

    def correct(self, sensor: MixedSensor[M], measurement: M) -> Evidence:
        """Weigh in a measurement z = h(x) + C l + e; components that are NaN were not measured.

        Returns
        -------
        Evidence
            ``log_mean`` is the log density that the belief gave to what was measured; ``innovation`` the length of the
            weighted mean innovation.

        Raises
        ------
        ValueError
            A measurement that is infinite, or shapes that do not fit; the belief is unchanged then.
        numpy.linalg.LinAlgError
            The innovation's covariance is not positive; the belief is unchanged then.
        """
        observation = sensor.begin(measurement)
        check_observation(observation, len(self.covariance))
        measured, coupling, noise, angles = observation
        seen = np.flatnonzero(~np.isnan(measured))
        c, spread = coupling[seen], noise[np.ix_(seen, seen)]
        covariance = symmetric(c @ self.covariance @ c.T + spread)
        root = np.linalg.cholesky(covariance)
        # what was not measured has a column of zeros: whatever is expected there, it counts for nothing
        whitener = np.zeros((seen.size, measured.size))
        whitener[:, seen] = np.linalg.inv(root)
        gain = np.zeros((len(self.covariance), measured.size))
        gain[:, seen] = np.linalg.solve(covariance, c @ self.covariance).T
        innovation = self._correct_columns(
            lambda first, last, expected: sensor.expect(self._particles, first, last, measurement, expected),
            np.nan_to_num(measured),
            (coupling, whitener, gain),
            angles,
        )
        self.covariance = joseph(self.covariance, gain[:, seen], c, spread)
        constant = -0.5 * seen.size * LOG_TWO_PI - float(np.log(np.diagonal(root)).sum())
        return Evidence(self._normalize(constant), float(np.linalg.norm(innovation[seen])), accepted=True)

    def weigh(self, sensor: Sensor[Any], measurement: tuple[float | None, ...]) -> Evidence:
        """Weigh by a sensor model of :mod:`filters.sensing`, outliers and all.

        It must see nonlinear states only: a linear one it would take as known, at each particle's mean.

        Raises
        ------
        ValueError
            The measurement is not finite; the weights are untouched then.
        """
        for value in measurement:
            if value is not None and not math.isfinite(value):
                raise ValueError(f"{type(sensor).__name__}: a measurement must be finite, got {measurement}")
        if sensor.refusal(measurement) is not None:
            return Evidence(math.nan, math.nan, accepted=False)
        centre = dict(zip(self.names, self.moments().mean.tolist(), strict=True))
        innovation = sensor.innovation(centre, measurement)
        constant = 0.0
        for first, last in self._bounds:
            constant = sensor.weigh(self._particles, first, last, measurement)
        return Evidence(self._normalize(constant), innovation, accepted=True)

    def _correct_columns(
        self,
        expect: Callable[[int, int, Float32Array], None],
        measured: Matrix,
        matrices: tuple[Matrix, Matrix, Matrix],
        angles: Sequence[int],
    ) -> Matrix:
        """Weigh and correct every particle by C, the whitener and the gain; return the weighted mean innovation."""
        coupling, whitener, gain = (_float32(matrix) for matrix in matrices)
        circular = np.zeros(measured.size, np.bool_)
        circular[list(angles)] = True
        z = measured.astype(np.float32)
        residual = np.zeros((measured.size, self._block), np.float32)
        white = np.zeros((len(whitener), self._block), np.float32)
        total = np.zeros(measured.size)
        means = self._particles.columns[self._sampled :]
        for first, last in self._bounds:
            width = last - first
            expect(first, last, residual)
            kernels.add_product(coupling, means, first, residual, 0, width)
            kernels.subtract_from(residual, z, circular, width)
            white[:] = 0.0
            kernels.add_product(whitener, residual, 0, white, 0, width)
            kernels.weigh(white, self._particles.log_weights, first, last)
            kernels.add_product(gain, residual, 0, means, first, width)
            total += residual[:, :width].astype(np.float64) @ self._weights[first:last]
        mean = total / self._sums[0]
        wrap(mean, angles)
        return mean


def draw(covariance: Matrix, coupling: Matrix, noise: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Prepare the draw of an increment v = A l + w and what is learned of l by it.

    Parameters
    ----------
    covariance : (l, l) float64
        P.
    coupling : (k, l) float64
        A.
    noise : (k, k) float64
        Q; some directions may be certain.

    Returns
    -------
    (k, k), (l, k), (l, k) float64
        L with L Lᵀ = A P Aᵀ + Q, lower triangular; J = P Aᵀ L⁻ᵀ, so that l += J n as v += L n; and the Kalman
        gain J L⁻¹. A direction that is certain has a column of zeros in L and J.
    """
    total = symmetric(coupling @ covariance @ coupling.T + noise)
    cross = covariance @ coupling.T
    root = np.zeros_like(total)
    learning = np.zeros_like(cross)
    for j in range(len(total)):
        pivot = total[j, j] - root[j, :j] @ root[j, :j]
        if pivot > _SINGULAR * total[j, j]:
            root[j, j] = math.sqrt(pivot)
            root[j + 1 :, j] = (total[j + 1 :, j] - root[j + 1 :, :j] @ root[j, :j]) / root[j, j]
            learning[:, j] = (cross[:, j] - learning[:, :j] @ root[j, :j]) / root[j, j]
    return root, learning, learning @ np.linalg.pinv(root)


def _float32(matrix: Matrix) -> Float32Array:
    return np.ascontiguousarray(matrix, np.float32)
