"""Every linearised model: its Jacobian against numerical differentiation, its values against the particle filter's."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from filters.extended_kalman import LinearisedSensor, numerical_jacobian
from filters.linearised import (
    LinearisedBearing,
    LinearisedHeading,
    LinearisedPosition,
    LinearisedRange,
    LinearisedRangeBearing,
    LinearisedUnicycle,
    LinearisedVelocity,
)
from filters.motion import RandomWalk, Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.sensing import (
    Bearing,
    BearingMeasurement,
    Heading,
    HeadingMeasurement,
    Position,
    PositionMeasurement,
    Range,
    RangeBearing,
    RangeBearingMeasurement,
    RangeMeasurement,
    Velocity,
    VelocityMeasurement,
)

Array = NDArray[np.float64]

SLOW = tuple(RandomWalk(name, 0.01) for name in ("range_scale", "range_bias", "heading_bias", "gnss_delay"))
MOTION = LinearisedUnicycle(Unicycle(0.1, 0.05, 0.01, 0.02, 0.03, 0.04), SLOW)
ROWS = {name: row for row, name in enumerate(MOTION.names)}

SENSORS: dict[str, tuple[Any, Any]] = {
    "range": (Range(0.5), RangeMeasurement(10.0, 12.0, -15.0, 2.0)),
    "range with scale and bias": (
        Range(0.5, scale="range_scale", bias="range_bias"),
        RangeMeasurement(10.0, 12.0, -15.0, 0.0, 0.3),
    ),
    "position": (Position(1.0), PositionMeasurement(1.0, 2.0)),
    "position with a lever": (Position(1.0, lever=(1.5, -0.4)), PositionMeasurement(1.0, 2.0, 0.5, 0.7)),
    "velocity": (Velocity(0.2), VelocityMeasurement(1.0, 0.5, 1.2)),
    "velocity with a scale": (
        Velocity(0.2, scale="odometry_scale"),
        VelocityMeasurement(1.0, 0.5, -1.2, 0.1),
    ),
    "position of an unknown delay": (
        Position(1.0, lever=(1.5, -0.4), delay="gnss_delay"),
        PositionMeasurement(1.0, 2.0, 0.5, 0.7, 3.0, 0.8),
    ),
    "velocity of an unknown delay": (
        Velocity(0.2, scale="odometry_scale", delay="gnss_delay"),
        VelocityMeasurement(1.0, 0.5, 1.2, 0.1, -0.6),
    ),
    "heading": (Heading(0.1), HeadingMeasurement(2.0)),
    "bearing": (Bearing(0.1), BearingMeasurement(0.3, 12.0, -15.0)),
    "bearing that says its sigma": (Bearing(0.1), BearingMeasurement(0.3, 12.0, -15.0, 0.2)),
    "range and bearing": (RangeBearing(0.2, 0.1), RangeBearingMeasurement(11.0, 0.3, 12.0, -15.0)),
    "range and bearing that say their sigmas": (
        RangeBearing(0.2, 0.1),
        RangeBearingMeasurement(11.0, 0.3, 12.0, -15.0, 0.4, 0.3),
    ),
    "heading with a bias": (Heading(0.1, bias="heading_bias"), HeadingMeasurement(2.0, 0.05)),
}
LINEARISED: dict[type, Any] = {
    Range: LinearisedRange,
    Position: LinearisedPosition,
    Velocity: LinearisedVelocity,
    Heading: LinearisedHeading,
    Bearing: LinearisedBearing,
    RangeBearing: LinearisedRangeBearing,
}
MODELS: dict[str, tuple[LinearisedSensor[Any], Any]] = {
    name: (LINEARISED[type(sensor)](sensor), measurement) for name, (sensor, measurement) in SENSORS.items()
}

states = st.builds(
    lambda place, rest: np.array([*place, *rest]),
    st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0)),
    st.tuples(
        st.floats(-3.1, 3.1),
        st.floats(-0.2, 0.2),
        st.floats(0.7, 1.4),
        st.floats(0.8, 1.2),
        st.floats(-1.0, 1.0),
        st.floats(-0.5, 0.5),
        st.floats(-0.3, 0.3),
    ),
)


@pytest.mark.parametrize("name", MODELS)
@settings(max_examples=25, deadline=None)
@given(mean=states)
def test_a_sensors_jacobian_is_its_derivative(name: str, mean: Array) -> None:
    """To 1e-8 relative to the largest entry: central differences with a step of 1e-6 have about 1e-9."""
    model, measurement = MODELS[name]
    expectation = model.expect(ROWS, mean, measurement)
    numerical = numerical_jacobian(
        lambda x: model.expect(ROWS, x, measurement).expected, mean, angles=expectation.angles
    )
    np.testing.assert_allclose(
        expectation.jacobian, numerical, atol=1e-8 * max(1.0, float(np.abs(numerical).max()))
    )


@settings(max_examples=50, deadline=None)
@given(mean=states, distance=st.floats(-3.0, 3.0), turn=st.floats(-1.0, 1.0), duration=st.floats(0.0, 2.0))
def test_the_unicycles_jacobian_is_its_derivative(
    mean: Array, distance: float, turn: float, duration: float
) -> None:
    control = UnicycleControl(distance, turn)
    numerical = numerical_jacobian(lambda x: MOTION.move(x, control, duration).mean, mean, angles=(2,))
    np.testing.assert_allclose(MOTION.move(mean, control, duration).jacobian, numerical, atol=1e-8)


@settings(max_examples=50, deadline=None)
@given(mean=states, distance=st.floats(-3.0, 3.0), turn=st.floats(-1.0, 1.0), duration=st.floats(0.01, 2.0))
def test_the_unicycles_noise_is_that_of_its_distance_turn_and_walks(
    mean: Array, distance: float, turn: float, duration: float
) -> None:
    """Each source of noise, pushed through the motion by numerical differentiation, to 1e-8."""

    def moved(source: Array) -> Array:
        walked = mean + np.concatenate([np.zeros(3), source[2:]])
        noisy = UnicycleControl(distance + source[0] / walked[4], turn + source[1])  # of the true distance
        return MOTION.move(walked, noisy, duration).mean

    derivative = numerical_jacobian(moved, np.zeros(2 + 6), angles=(2,))
    # the division by the scale, above, must not let the scale's own walk in
    derivative[:, 3] = numerical_jacobian(
        lambda x: MOTION.move(mean + x * (np.arange(9) == 4), UnicycleControl(distance, turn), duration).mean,
        np.zeros(1),
        angles=(2,),
    )[:, 0]
    variance = duration * np.square([0.1, 0.05, 0.01, 0.02, 0.01, 0.01, 0.01, 0.01])
    variance[0] += 0.03**2 * abs(distance)
    variance[1] += 0.04**2 * abs(turn)
    expected = (derivative * variance) @ derivative.T
    np.testing.assert_allclose(
        MOTION.move(mean, UnicycleControl(distance, turn), duration).noise, expected, atol=1e-8
    )


def test_a_stretch_that_was_not_measured_adds_what_it_says() -> None:
    still = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    noise = MOTION.move(still, UnicycleControl(0.0, 0.0, 2.0, 0.3), 0.0).noise
    np.testing.assert_allclose(np.diagonal(noise)[:3], [4.0, 0.0, 0.09], atol=1e-15)


@pytest.mark.parametrize("name", SENSORS)
@settings(max_examples=10, deadline=None)
@given(mean=states)
def test_what_is_expected_is_what_the_particle_filter_expects(name: str, mean: Array) -> None:
    sensor, measurement = SENSORS[name]
    model, _ = MODELS[name]
    expectation = model.expect(ROWS, mean, measurement)
    residual = expectation.measured - expectation.expected
    ours = math.remainder(residual[0], 2 * math.pi) if 0 in expectation.angles else float(residual[0])
    if residual.size == 2 and not expectation.angles:
        ours = math.hypot(*residual)
    theirs = sensor.innovation(dict(zip(MOTION.names, mean.tolist(), strict=True)), measurement)
    assert ours == pytest.approx(theirs, abs=1e-12)


def test_the_unicycle_moves_as_the_particle_filters_does() -> None:
    """The centre, which the particle filter moves in float32: to 2e-6."""
    quiet = Unicycle(0.0, 0.0, 0.0, 0.0)
    belief = ParticleFilter(quiet, capacity=1, seed=1)
    start = {"north": 1.0, "east": -2.0, "heading": 0.7, "gyro_bias": 0.05, "odometry_scale": 1.1}
    belief.initialize({name: [value] for name, value in start.items()})
    control = UnicycleControl(0.8, 0.3)
    belief.predict(control, 0.5)
    moved = LinearisedUnicycle(quiet).move(np.array(list(start.values())), control, 0.5).mean
    np.testing.assert_allclose(moved, belief.columns[:, 0], atol=2e-6)


def test_where_there_is_no_direction_the_derivative_is_zero() -> None:
    at_beacon = np.array([12.0, -15.0, 0.3, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    for name in ("range with scale and bias", "bearing", "range and bearing"):
        model, measurement = MODELS[name]
        jacobian = model.expect(ROWS, at_beacon, measurement).jacobian
        assert np.isfinite(jacobian).all()
        assert (jacobian[:, :2] == 0.0).all()


def test_what_makes_no_sense_is_refused() -> None:
    with pytest.raises(ValueError, match="finite"):
        MOTION.move(np.zeros(9), UnicycleControl(math.nan, 0.0), 0.1)
