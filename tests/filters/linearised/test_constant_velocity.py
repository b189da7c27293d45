"""Constant velocity, biased ranges and heights in the shadow: derivatives by differences, noise by its matrix."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from filters.belief import Moments
from filters.extended_kalman import numerical_jacobian
from filters.linearised import LinearisedBiasedRange, LinearisedConstantVelocity, LinearisedDown
from filters.linearised.shadow import ShadowFilter
from filters.motion import FREE, ConstantVelocity, RandomWalk
from filters.motion.learned import Learned
from filters.sensing.biased_range import BiasedRange, BiasedRangeMeasurement
from filters.sensing.down import Down, DownMeasurement

Array = NDArray[np.float64]

SLOW = (RandomWalk("range_scale", 0.01), Learned("range_bias/7", 0.02, 0.3))
MOTION = ConstantVelocity(0.6, 1.0, 3, vertical_noise=0.2)
MODEL = LinearisedConstantVelocity(MOTION, SLOW)
ROWS = {name: row for row, name in enumerate(MODEL.names)}
BIASED = BiasedRange(0.4, scale="range_scale", biases={7: "range_bias/7"}, height="down")
SENSORS: list[tuple[Any, Any, Any]] = [
    (LinearisedBiasedRange(BIASED), BIASED, BiasedRangeMeasurement(10.0, 14.0, -15.0, -1.0, None, 7)),
    (LinearisedBiasedRange(BIASED), BIASED, BiasedRangeMeasurement(10.0, 14.0, -15.0, -1.0, 0.2, 8)),
    (
        LinearisedBiasedRange(BiasedRange(0.4)),
        BiasedRange(0.4),
        BiasedRangeMeasurement(10.0, 14.0, -15.0, 2.0),
    ),
    (LinearisedDown(Down(0.5)), Down(0.5), DownMeasurement(1.5)),
    (LinearisedDown(Down(0.5)), Down(0.5), DownMeasurement(1.5, 0.1)),
]
states = st.lists(st.floats(-5.0, 5.0), min_size=9, max_size=9).map(np.array)


@settings(max_examples=30, deadline=None)
@given(mean=states, duration=st.floats(0.0, 3.0))
def test_the_motion_is_linear_and_its_noise_an_integral(mean: Array, duration: float) -> None:
    moved, jacobian, noise = MODEL.move(mean, FREE, duration)
    numerical = numerical_jacobian(lambda x: MODEL.move(x, FREE, duration).mean, mean)
    np.testing.assert_allclose(jacobian, numerical, atol=1e-8)
    np.testing.assert_allclose(moved, jacobian @ mean, atol=1e-12)
    wanted = np.zeros((9, 9))
    t = duration
    for position, velocity, q in ((0, 3, 0.6), (1, 4, 0.6), (5, 6, 0.2)):
        block = q**2 * np.array([[t**3 / 3, t**2 / 2], [t**2 / 2, t]])
        wanted[np.ix_([position, velocity], [position, velocity])] = block
    wanted[7, 7], wanted[8, 8] = 0.01**2 * t, 0.02**2 * t
    np.testing.assert_allclose(noise, wanted, atol=1e-12)


@pytest.mark.parametrize(("model", "sensor", "measurement"), SENSORS)
@settings(max_examples=20, deadline=None)
@given(mean=states)
def test_a_sensors_jacobian_is_its_derivative(model: Any, sensor: Any, measurement: Any, mean: Array) -> None:
    expectation = model.expect(ROWS, mean, measurement)
    numerical = numerical_jacobian(lambda x: model.expect(ROWS, x, measurement).expected, mean)
    np.testing.assert_allclose(expectation.jacobian, numerical, atol=1e-7)
    centre = dict(zip(MODEL.names, mean.tolist(), strict=True))
    innovation = float((expectation.measured - expectation.expected)[0])
    assert innovation == pytest.approx(sensor.innovation(centre, measurement), abs=1e-12)
    sigma = sensor.sigma if measurement.sigma is None else measurement.sigma
    assert expectation.noise == pytest.approx(np.array([[sigma**2]]))


def test_at_the_beacon_there_is_no_direction() -> None:
    mean = np.zeros(9)
    jacobian = SENSORS[0][0].expect(ROWS, mean, BiasedRangeMeasurement(1.0, 0.0, 0.0, 0.0, None, 7)).jacobian
    np.testing.assert_array_equal(np.flatnonzero(jacobian), [ROWS["range_bias/7"]])


def test_the_shadow_says_position_and_velocity_together() -> None:
    shadow = ShadowFilter(ConstantVelocity(0.5), SLOW)
    size = len(shadow.names)
    variance = np.array([1.0, 2.0, 0.0, 0.5, 0.25, 0.0, 0.1])
    pose = np.diag(variance[:3])
    shadow.initialize(Moments(shadow.names, np.arange(size, dtype=np.float64), pose, variance, np.inf))
    shadow.predict(FREE, 2.0)
    found = shadow.joint(("north", "velocity_north"))
    wanted = np.array(
        [[1.0 + 4 * 0.5 + 0.25 * 8 / 3, 2 * 0.5 + 0.25 * 2], [2 * 0.5 + 0.25 * 2, 0.5 + 0.25 * 2]]
    )
    np.testing.assert_allclose(found.covariance, wanted)
    np.testing.assert_allclose(found.mean, [6.0, 3.0])
    with pytest.raises(KeyError):
        shadow.joint(("speed",))


def test_a_motion_that_is_not_known_is_refused() -> None:
    with pytest.raises(ValueError, match="not among"):
        ShadowFilter(object())  # type: ignore[arg-type]
