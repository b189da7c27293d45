"""The extended Kalman filter: against least squares over the whole history, filterpy and a Gauss-Newton by hand."""

from __future__ import annotations

import math
from collections.abc import Mapping

import filterpy.kalman
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from filters.extended_kalman import ExtendedKalmanFilter, Transition, numerical_jacobian
from filters.kalman import Expectation, KalmanFilter

Array = NDArray[np.float64]


class Linear:
    """x' = A x + B u + w."""

    angles = ()

    def __init__(self, transition: Array, gain: Array, noise: Array) -> None:
        self.names = tuple(f"x{k}" for k in range(len(transition)))
        self.transition, self.gain, self.noise = transition, gain, noise

    def move(self, mean: Array, control: Array, duration: float) -> Transition:
        return Transition(self.transition @ mean + self.gain @ control, self.transition, self.noise)


class Seen:
    """z = C x + v."""

    def __init__(self, model: Array, noise: Array) -> None:
        self.model, self.noise = model, noise

    def expect(self, rows: Mapping[str, int], mean: Array, measurement: Array) -> Expectation:
        return Expectation(measurement, self.model @ mean, self.model, self.noise)


def spread(rng: np.random.Generator, size: int) -> Array:
    """A covariance whose components are correlated, of condition below about a hundred."""
    root = rng.normal(size=(size, size))
    return root @ root.T / size + 0.2 * np.eye(size)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), size=st.integers(1, 4), measured=st.integers(1, 3))
def test_it_equals_batch_least_squares_where_all_is_linear(seed: int, size: int, measured: int) -> None:
    """Both filters, to 1e-9: control, correlated noises, missing components, and a step with none at all."""
    rng = np.random.default_rng(seed)
    steps = 12
    transition = np.linalg.qr(rng.normal(size=(size, size)))[0] * rng.uniform(0.8, 1.05)
    gain = rng.normal(size=(size, 2))
    model = rng.normal(size=(measured, size))
    motion_noise, sensor_noise, start_spread = spread(rng, size), spread(rng, measured), spread(rng, size)
    start = rng.normal(size=size)
    linear = KalmanFilter(start, start_spread)
    extended = ExtendedKalmanFilter(Linear(transition, gain, motion_noise), start, start_spread)
    sensor = Seen(model, sensor_noise)
    rows: list[Array] = []
    right: list[Array] = []

    def add(blocks: dict[int, Array], value: Array, covariance: Array) -> None:
        row = np.zeros((value.size, size * (steps + 1)))
        for k, block in blocks.items():
            row[:, size * k : size * (k + 1)] = block
        root = np.linalg.inv(np.linalg.cholesky(covariance))
        rows.append(root @ row)
        right.append(root @ value)

    add({0: np.eye(size)}, start, start_spread)
    for k in range(steps):
        control, z = rng.normal(size=2), rng.normal(size=measured)
        z[rng.random(measured) < 0.3] = np.nan
        if k == 5:
            z[:] = np.nan
        linear.predict(transition, motion_noise, gain, control)
        extended.predict(control, 0.1)
        by_linear = linear.correct(z, model, sensor_noise)
        by_extended = extended.correct(sensor, z)
        assert by_extended.nis == pytest.approx(by_linear.nis, abs=1e-9)
        add({k: -transition, k + 1: np.eye(size)}, gain @ control, motion_noise)
        seen = np.flatnonzero(~np.isnan(z))
        if seen.size:
            add({k + 1: model[seen]}, z[seen], sensor_noise[np.ix_(seen, seen)])
    a, b = np.concatenate(rows), np.concatenate(right)
    information = a.T @ a
    mean = np.linalg.solve(information, a.T @ b)[-size:]
    covariance = np.linalg.inv(information)[-size:, -size:]
    for belief in (linear, extended):
        np.testing.assert_allclose(belief.mean, mean, atol=1e-9)
        np.testing.assert_allclose(belief.covariance, covariance, atol=1e-9)


class Pendulum:
    """Angle and rate of a pendulum; the control is a torque."""

    names = ("angle", "rate")
    angles = (0,)

    def move(self, mean: Array, control: float, duration: float) -> Transition:
        angle, rate = mean
        moved = np.array([angle + rate * duration, rate + (control - math.sin(angle)) * duration])
        jacobian = np.array([[1.0, duration], [-math.cos(angle) * duration, 1.0]])
        return Transition(moved, jacobian, np.diag([1e-4, 1e-3]) * duration)


class Shade:
    """Where the bob's shadow falls, and how fast it moves."""

    noise = np.diag([0.01, 0.04])

    def expect(self, rows: Mapping[str, int], mean: Array, measurement: tuple[float, float]) -> Expectation:
        angle, rate = mean
        expected = np.array([math.sin(angle), rate * math.cos(angle)])
        jacobian = np.array([[math.cos(angle), 0.0], [-rate * math.sin(angle), math.cos(angle)]])
        return Expectation(np.array(measurement), expected, jacobian, self.noise)


def test_it_equals_filterpy_on_a_pendulum() -> None:
    """filterpy's EKF has the same correction in Joseph's form; its prediction is given our Jacobian: 1e-10."""
    motion, sensor = Pendulum(), Shade()
    rng = np.random.default_rng(4)
    other = filterpy.kalman.ExtendedKalmanFilter(dim_x=2, dim_z=2)
    other.x, other.P, other.R = np.array([0.4, 0.0]), np.diag([0.2, 0.1]), Shade.noise
    belief = ExtendedKalmanFilter(motion, other.x, other.P)
    truth = np.array([0.7, 0.1])
    for _ in range(100):
        control = 0.1 * rng.standard_normal()
        truth = motion.move(truth, control, 0.05).mean
        z = sensor.expect({}, truth, (0.0, 0.0)).expected + rng.multivariate_normal([0, 0], Shade.noise)
        moved = motion.move(other.x, control, 0.05)
        other.x, other.P = moved.mean, moved.jacobian @ other.P @ moved.jacobian.T + moved.noise
        other.update(
            z,
            lambda x: sensor.expect({}, x, (0.0, 0.0)).jacobian,
            lambda x: sensor.expect({}, x, (0.0, 0.0)).expected,
        )
        belief.predict(control, 0.05)
        belief.correct(sensor, (float(z[0]), float(z[1])))
        np.testing.assert_allclose(belief.mean, other.x, atol=1e-10)
        np.testing.assert_allclose(belief.covariance, other.P, atol=1e-10)
    assert np.abs(belief.mean - truth).max() < 0.3


def test_an_angle_is_kept_on_its_circle() -> None:
    belief = ExtendedKalmanFilter(Pendulum(), [3.1, 1.0], np.eye(2))
    belief.predict(0.0, 0.1)
    assert belief.mean[0] == pytest.approx(3.2 - 2 * math.pi)


def test_a_bad_start_is_refused() -> None:
    with pytest.raises(ValueError, match="angle, rate"):
        ExtendedKalmanFilter(Pendulum(), [0.0], [[1.0]])
    belief = ExtendedKalmanFilter(Pendulum(), [0.0, 0.0], np.eye(2))
    with pytest.raises(ValueError, match="finite"):
        belief.set([math.nan, 0.0], np.eye(2))
    assert belief.mean.tolist() == [0.0, 0.0]


def test_bad_input_is_refused_and_harms_nothing() -> None:
    belief = ExtendedKalmanFilter(Pendulum(), [0.1, 0.2], np.eye(2))
    for duration in (-0.1, math.inf, math.nan):
        with pytest.raises(ValueError, match="duration"):
            belief.predict(0.0, duration)
    with pytest.raises(ValueError, match="finite"):
        belief.predict(math.inf, 0.1)
    with pytest.raises(ValueError, match="finite"):
        belief.correct(Shade(), (math.inf, 0.0))
    assert belief.mean.tolist() == [0.1, 0.2]
    assert np.array_equal(belief.covariance, np.eye(2))


def test_a_gate_keeps_out_what_is_beyond_it() -> None:
    belief = ExtendedKalmanFilter(Pendulum(), [0.0, 0.0], 0.01 * np.eye(2))
    correction = belief.correct(Shade(), (9.0, 0.0), gate=0.999)
    assert not correction.accepted
    assert correction.nis > 1000.0
    assert belief.mean.tolist() == [0.0, 0.0]
    assert belief.correct(Shade(), (0.1, 0.0), gate=0.999).accepted


def test_numerical_differentiation_of_what_is_known() -> None:
    jacobian = numerical_jacobian(lambda x: np.array([x[0] * x[1], math.sin(x[1])]), [3.0, 0.5])
    np.testing.assert_allclose(jacobian, [[0.5, 3.0], [0.0, math.cos(0.5)]], atol=1e-9)
    turned = numerical_jacobian(
        lambda x: np.array([math.remainder(x[0], 2 * math.pi)]), [math.pi], angles=(0,)
    )
    np.testing.assert_allclose(turned, [[1.0]], atol=1e-9)
