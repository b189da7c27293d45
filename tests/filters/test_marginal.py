"""The marginalised filter: the Kalman filter where all is linear, the unicycle as it marginalises, the plain filter."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

from filters.kalman import KalmanFilter
from filters.kernels.compile import Float32Array
from filters.marginal import MarginalFilter, draw
from filters.mixed import MixedMotion, MixedObservation, MixedStep
from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.particle_set import ParticleSet
from filters.sensing import Heading, HeadingMeasurement, Range, RangeMeasurement

Array = NDArray[np.float64]
NONE = np.zeros(0)


class Readings(NamedTuple):
    values: tuple[float, ...]


class AllLinear:
    """l' = F l + d + r: nothing to sample."""

    nonlinear: tuple[str, ...] = ()
    angles: tuple[int, ...] = ()

    def __init__(self, transition: Array, noise: Array) -> None:
        self.linear = tuple(f"l{k}" for k in range(len(transition)))
        self.transition, self.noise = transition, noise

    def begin(self, control: Array, duration: float) -> MixedStep:
        size = len(self.transition)
        empty = np.zeros((0, 0))
        return MixedStep(NONE, np.zeros((0, size)), empty, self.transition, control, self.noise)

    def move(self, particles: ParticleSet, first: int, last: int, increments: Float32Array) -> None:
        assert increments.shape[0] == 0


class SeesLinear:
    """z = C l + e."""

    def __init__(self, coupling: Array, noise: Array) -> None:
        self.coupling, self.noise = coupling, noise

    def begin(self, measurement: Readings) -> MixedObservation:
        return MixedObservation(np.array(measurement.values), self.coupling, self.noise)

    def expect(
        self, particles: ParticleSet, first: int, last: int, measurement: Readings, expected: Float32Array
    ) -> None:
        expected[:, : last - first] = 0.0


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), size=st.integers(1, 4))
def test_it_is_the_kalman_filter_where_all_is_linear(seed: int, size: int) -> None:
    """Every particle's mean to float32's digits (2e-6 of the largest), the covariance and evidence to 1e-9 and 1e-5.

    Control, correlated noises, missing components, resampling, blocks and a count that changes included.
    """
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, size, size))
    noises = root @ root.transpose(0, 2, 1) / size + 0.2 * np.eye(size)
    transition = np.linalg.qr(rng.normal(size=(size, size)))[0] * 0.95
    model, spread = rng.normal(size=(2, size)), np.array([[0.5, 0.2], [0.2, 0.4]])
    start = rng.normal(size=size)
    exact = KalmanFilter(start, noises[0])
    belief = MarginalFilter(AllLinear(transition, noises[1]), capacity=50, block=16)
    belief.initialize(
        {name: np.full(40, value) for name, value in zip(belief.names, start, strict=True)}, noises[0]
    )
    scale = 1.0
    for step in range(20):
        control, z = rng.normal(size=size), rng.normal(size=2)
        z[rng.random(2) < 0.3] = np.nan
        exact.predict(transition, noises[1], np.eye(size), control)
        correction = exact.correct(z, model, spread)
        belief.predict(control, 0.1)
        evidence = belief.correct(SeesLinear(model, spread), Readings(tuple(z)))
        assert evidence.log_mean == pytest.approx(correction.log_evidence, abs=1e-4)
        assert evidence.innovation == pytest.approx(np.linalg.norm(correction.innovation), abs=1e-4)
        if step % 5 == 4:
            belief.resample(50)
        scale = max(scale, float(np.abs(exact.mean).max()))
        for name, value in zip(belief.names, exact.mean, strict=True):
            assert np.abs(belief.column(name) - value).max() < 4e-6 * scale
        np.testing.assert_allclose(belief.covariance, exact.covariance, atol=1e-9)
    moments = belief.moments()
    np.testing.assert_allclose(moments.mean, exact.mean, atol=4e-6 * scale)
    np.testing.assert_allclose(moments.covariance, exact.covariance, atol=1e-9)


class Walker:
    """Position sampled, velocity and acceleration linear: x' = x + T v + w."""

    nonlinear = ("position",)
    linear = ("velocity", "acceleration")
    angles: tuple[int, ...] = ()
    coupling = np.array([[0.1, 0.005]])
    noise = np.array([[0.02]])
    transition = np.array([[1.0, 0.1], [0.0, 0.98]])
    linear_noise = np.diag([0.01, 0.05])

    def begin(self, control: None, duration: float) -> MixedStep:
        return MixedStep(
            np.zeros(1), self.coupling, self.noise, self.transition, np.zeros(2), self.linear_noise
        )

    def move(self, particles: ParticleSet, first: int, last: int, increments: Float32Array) -> None:
        particles.columns[0, first:last] += increments[0, : last - first]


class SeesPositionAndVelocity:
    """z = (x, v) + e."""

    def begin(self, measurement: Readings) -> MixedObservation:
        coupling = np.array([[0.0, 0.0], [1.0, 0.0]])
        return MixedObservation(np.array(measurement.values), coupling, np.diag([0.25, 0.5]))

    def expect(
        self, particles: ParticleSet, first: int, last: int, measurement: Readings, expected: Float32Array
    ) -> None:
        expected[0, : last - first] = particles.columns[0, first:last]
        expected[1, : last - first] = 0.0


def walked(count: int, seed: int, steps: int = 10) -> tuple[Array, Array, float, KalmanFilter]:
    """Error of the mean and of the covariance against the Kalman filter, evidence's too, and the Kalman filter."""
    rng = np.random.default_rng(seed)
    transition = np.block([[np.eye(1), Walker.coupling], [np.zeros((2, 1)), Walker.transition]])
    noise = np.zeros((3, 3))
    noise[:1, :1], noise[1:, 1:] = Walker.noise, Walker.linear_noise
    exact = KalmanFilter(np.zeros(3), np.eye(3))
    belief = MarginalFilter(Walker(), capacity=count, seed=seed)
    belief.initialize({"position": rng.normal(size=count), "velocity": 0.0, "acceleration": 0.0}, np.eye(2))
    evidence = 0.0
    for _ in range(steps):
        z = rng.normal(0.0, 1.0, 2)
        exact.predict(transition, noise)
        correction = exact.correct(z, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], np.diag([0.25, 0.5]))
        belief.predict(None, 0.1)
        said = belief.correct(SeesPositionAndVelocity(), Readings(tuple(z)))
        evidence += said.log_mean - correction.log_evidence
        if belief.effective_sample_size < 0.5 * count:
            belief.resample()
    moments = belief.moments()
    return moments.mean - exact.mean, moments.covariance - exact.covariance, evidence, exact


def test_it_converges_to_the_kalman_filter_at_the_rate_of_monte_carlo() -> None:
    """With the sampled part linear too: sixteen times the particles, a quarter of the error.

    Root mean square over 40 seeds of the mean's error in units of sigma: N^-1/2 times a constant below 8; the
    ratio of the two counts within a factor of 1.6 of four (each RMS of 120 numbers is known to about 8 %: 5 sigma).
    """
    errors: dict[int, float] = {}
    for count in (400, 6400):
        scaled = []
        for seed in range(40):
            mean, _, _, exact = walked(count, seed)
            scaled.append(mean / np.sqrt(np.diagonal(exact.covariance)))
        errors[count] = float(np.sqrt(np.mean(np.square(scaled))))
        assert errors[count] < 8.0 / math.sqrt(count)
    assert 4.0 / 1.6 < errors[400] / errors[6400] < 4.0 * 1.6


def test_its_covariance_and_evidence_are_the_kalman_filters() -> None:
    """100,000 particles: covariance to 5 % of its largest entry, the log evidence of 10 measurements to 0.1."""
    _, covariance, evidence, exact = walked(100_000, 1)
    assert np.abs(covariance).max() < 0.05 * exact.covariance.max()
    assert abs(evidence) < 0.1


# ---- the unicycle's own marginalisation, stated for the general class


class MixedUnicycle:
    """What :class:`Unicycle` does by hand: increments (distance, turn), linear states bias and scale."""

    nonlinear = ("north", "east", "heading")
    linear = ("gyro_bias", "odometry_scale")
    angles = (2,)

    def __init__(self, motion: Unicycle) -> None:
        self.motion = motion

    def begin(self, control: UnicycleControl, duration: float) -> MixedStep:
        walk = np.square([self.motion.gyro_bias_walk, self.motion.odometry_scale_walk]) * duration
        return MixedStep(
            np.array([0.0, control.turn]),
            np.array([[0.0, control.distance], [-duration, 0.0]]),
            np.diag(self.motion.noise_variances(control, duration)),
            np.eye(2),
            np.zeros(2),
            np.diag(walk),  # for the next step: Unicycle walks before it moves
        )

    def move(self, particles: ParticleSet, first: int, last: int, increments: Float32Array) -> None:
        distance, turn = increments[:, : last - first]
        north, east, heading = particles.columns[:3, first:last]
        north += distance * np.cos(heading + 0.5 * turn)
        east += distance * np.sin(heading + 0.5 * turn)
        heading += turn
        heading -= 2.0 * np.pi * np.round(heading / (2.0 * np.pi))


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_it_says_what_the_unicycle_says_of_the_same_random_numbers(noise: float) -> None:
    """Particle by particle over 100 steps with headings, ranges and resampling: to float32's digits.

    Bias and scale's means to 2e-5, poses to 1e-3 m (4e-5 of the way), shared variances to 1e-12.
    """
    count, duration = 500, 0.1
    parameters = (noise, noise, 1e-3, 2e-3, 0.01, 0.02)
    motion = Unicycle(*parameters, gyro_bias_sigma=0.05, odometry_scale_sigma=0.1)
    rng = np.random.default_rng(1)
    columns = {
        "north": rng.normal(size=count),
        "east": rng.normal(size=count),
        "heading": rng.uniform(-3.0, 3.0, count),
        "gyro_bias": rng.normal(0.0, 0.01, count),
        "odometry_scale": rng.normal(1.0, 0.02, count),
    }
    theirs = ParticleFilter(motion, capacity=count, seed=9)
    theirs.initialize(columns)
    ours = MarginalFilter(MixedUnicycle(motion), capacity=count, seed=9, block=128)
    walk = np.diag([1e-3**2, 2e-3**2]) * duration
    ours.initialize(columns, np.diag([0.05**2, 0.1**2]) + walk)
    for step in range(100):
        control = UnicycleControl(0.2, 0.03 * math.sin(0.1 * step))
        theirs.predict(control, duration)
        ours.predict(control, duration)
    for name in ours.names:
        ahead = ours.column(name) - theirs.column(name)
        if name == "heading":
            ahead = np.remainder(ahead + math.pi, 2 * math.pi) - math.pi
        assert np.abs(ahead).max() < (1e-3 if name in ours.names[:3] else 2e-5), name
    variances = list(motion.conditional_variances.values())
    np.testing.assert_allclose(np.diagonal(ours.covariance - walk), variances, rtol=1e-9)
    for sensor, measurement in (
        (Heading(0.3), HeadingMeasurement(0.5)),
        (Range(3.0), RangeMeasurement(20, 30, 5)),
    ):
        a, b = ours.weigh(sensor, measurement), theirs.weigh(sensor, measurement)
        assert a.accepted
        assert a.log_mean == pytest.approx(b.log_mean, abs=1e-3)
    a, b = ours.moments(), theirs.moments()
    np.testing.assert_allclose(a.mean, b.mean, atol=2e-3)
    np.testing.assert_allclose(a.covariance[:3, :3], b.pose_covariance, atol=2e-2)
    np.testing.assert_allclose(np.diagonal(a.covariance)[3:], b.variance[3:] + np.diagonal(walk), rtol=1e-3)


# ---- a mixed model: against a plain particle filter written here


class Arctangent:
    """a' = atan a + l1 + w, l' = F l + r (Lindsten and Schön's example): one sampled state, three linear."""

    nonlinear = ("a",)
    linear = ("l1", "l2", "l3")
    angles: tuple[int, ...] = ()
    transition = np.array([[1.0, 0.3, 0.0], [0.0, 0.92, -0.3], [0.0, 0.3, 0.92]])

    def begin(self, control: None, duration: float) -> MixedStep:
        coupling, noise = np.array([[1.0, 0.0, 0.0]]), np.array([[0.01]])
        return MixedStep(np.zeros(1), coupling, noise, self.transition, np.zeros(3), 0.01 * np.eye(3))

    def move(self, particles: ParticleSet, first: int, last: int, increments: Float32Array) -> None:
        a = particles.columns[0, first:last]
        a[:] = np.arctan(a) + increments[0, : last - first]


class SeesSquare:
    """z = (0.1 a² sign a, l1 - l2 + l3) + e."""

    coupling = np.array([[0.0, 0.0, 0.0], [1.0, -1.0, 1.0]])

    def begin(self, measurement: Readings) -> MixedObservation:
        return MixedObservation(np.array(measurement.values), self.coupling, 0.1 * np.eye(2))

    def expect(
        self, particles: ParticleSet, first: int, last: int, measurement: Readings, expected: Float32Array
    ) -> None:
        a = particles.columns[0, first:last]
        expected[0, : last - first] = 0.1 * a * np.abs(a)
        expected[1, : last - first] = 0.0


def plain(readings: Array, count: int, rng: np.random.Generator) -> Array:
    """Means of a bootstrap particle filter over all four states, in plain numpy."""
    a, linear = rng.normal(size=count), rng.normal(size=(3, count))
    means = []
    for z in readings:
        a = np.arctan(a) + linear[0] + 0.1 * rng.normal(size=count)
        linear = Arctangent.transition @ linear + 0.1 * rng.normal(size=(3, count))
        expected = np.stack([0.1 * a * np.abs(a), linear[0] - linear[1] + linear[2]])
        log_weights = -5.0 * np.square(z[:, None] - expected).sum(axis=0)
        share = np.exp(log_weights - log_weights.max())
        share /= share.sum()
        means.append([share @ a, *(linear @ share)])
        chosen = np.searchsorted(np.cumsum(share)[:-1], (rng.random() + np.arange(count)) / count)
        a, linear = a[chosen], linear[:, chosen]
    return np.array(means)


def marginal(readings: Array, count: int, seed: int) -> Array:
    belief = MarginalFilter(Arctangent(), capacity=count, seed=seed)
    start = np.random.default_rng(seed).normal(size=count)
    belief.initialize({"a": start, "l1": 0.0, "l2": 0.0, "l3": 0.0}, np.eye(3))
    means = []
    for z in readings:
        belief.predict(None, 1.0)
        belief.correct(SeesSquare(), Readings(tuple(z)))
        means.append(belief.moments().mean)
        belief.resample()
    return np.array(means)


def test_it_beats_the_plain_filter_with_a_quarter_of_the_particles() -> None:
    """50 seeds, 30 steps: squared error of all states, 50 particles against the plain filter's 200.

    One-sided t-test of the paired difference of logarithms: p < 1e-3, the false alarm of a filter no better.
    """
    ours, theirs = [], []
    for seed in range(50):
        rng = np.random.default_rng(1000 + seed)
        a, linear = rng.normal(), rng.normal(size=3)
        states, measured = [], []
        for _ in range(30):
            a = math.atan(a) + linear[0] + 0.1 * rng.normal()
            linear = Arctangent.transition @ linear + 0.1 * rng.normal(size=3)
            states.append([a, *linear])
            exact = np.array([0.1 * a * abs(a), linear[0] - linear[1] + linear[2]])
            measured.append(exact + math.sqrt(0.1) * rng.normal(size=2))
        truth, readings = np.array(states), np.array(measured)
        ours.append(np.mean((marginal(readings, 50, seed) - truth) ** 2))
        theirs.append(np.mean((plain(readings, 200, rng) - truth) ** 2))
    assert np.mean(ours) < np.mean(theirs)
    assert stats.ttest_rel(np.log(ours), np.log(theirs), alternative="less").pvalue < 1e-3


# ---- arithmetic and refusals


def test_a_draw_has_the_increments_covariance_and_learns_by_the_kalman_gain() -> None:
    rng = np.random.default_rng(3)
    root = rng.normal(size=(3, 3))
    covariance, coupling, noise = root @ root.T, rng.normal(size=(2, 3)), np.array([[0.3, 0.1], [0.1, 0.2]])
    spread, learning, gain = draw(covariance, coupling, noise)
    total = coupling @ covariance @ coupling.T + noise
    np.testing.assert_allclose(spread @ spread.T, total, atol=1e-12)
    np.testing.assert_allclose(gain, covariance @ coupling.T @ np.linalg.inv(total), atol=1e-12)
    np.testing.assert_allclose(learning, gain @ spread, atol=1e-12)


def test_a_draw_that_is_certain_teaches_nothing() -> None:
    spread, learning, gain = draw(np.zeros((1, 1)), np.ones((2, 1)), np.diag([0.0, 4.0]))
    assert spread.tolist() == [[0.0, 0.0], [0.0, 2.0]]
    assert not learning.any()
    assert not gain.any()


@pytest.mark.interpreted
def test_angles_are_averaged_on_their_circle() -> None:
    belief = MarginalFilter(MixedUnicycle(Unicycle(0, 0, 0, 0)), capacity=2)
    belief.initialize(
        {"north": 0, "east": 0, "heading": [3.1, -3.1], "gyro_bias": 0, "odometry_scale": 1}, np.zeros((2, 2))
    )
    moments = belief.moments()
    assert abs(moments.mean[2]) == pytest.approx(math.pi)
    assert moments.covariance[2, 2] == pytest.approx((math.pi - 3.1) ** 2, rel=1e-4)


class SeesHeadingLessBias:
    """An angle of a nonlinear state and a linear one."""

    def begin(self, measurement: Readings) -> MixedObservation:
        return MixedObservation(
            np.array(measurement.values), np.array([[1.0, 0.0]]), np.array([[0.01]]), angles=(0,)
        )

    def expect(
        self, particles: ParticleSet, first: int, last: int, measurement: Readings, expected: Float32Array
    ) -> None:
        expected[0, : last - first] = particles.columns[2, first:last]


@pytest.mark.interpreted
def test_an_angles_innovation_is_wrapped() -> None:
    belief = MarginalFilter(MixedUnicycle(Unicycle(0, 0, 0, 0)), capacity=1)
    belief.initialize(
        {"north": 0, "east": 0, "heading": [3.1], "gyro_bias": 0, "odometry_scale": 1}, np.diag([0.01, 0.0])
    )
    evidence = belief.correct(SeesHeadingLessBias(), Readings((-3.1,)))
    assert evidence.innovation == pytest.approx(2 * math.pi - 6.2, abs=1e-5)
    assert belief.column("gyro_bias")[0] == pytest.approx(0.5 * (2 * math.pi - 6.2), abs=1e-5)


def started(count: int = 8) -> MarginalFilter[None]:
    belief = MarginalFilter(Walker(), capacity=10)
    belief.initialize(
        {"position": np.linspace(-1, 1, count), "velocity": 0.5, "acceleration": 0.0}, np.eye(2)
    )
    return belief


@pytest.mark.interpreted
def test_a_set_that_cannot_explain_a_measurement_is_kept_and_counted() -> None:
    belief = started()
    evidence = belief.correct(SeesPositionAndVelocity(), Readings((1e19, 0.0)))
    assert evidence.log_mean == -math.inf
    assert belief.collapses == 1
    assert belief.effective_sample_size == 8.0


@pytest.mark.interpreted
def test_what_a_sensor_refuses_changes_nothing() -> None:
    belief = started()
    assert not belief.weigh(Range(1.0), RangeMeasurement(-1.0, 0.0, 0.0)).accepted
    assert belief.effective_sample_size == 8.0
    with pytest.raises(ValueError, match="finite"):
        belief.weigh(Range(1.0), RangeMeasurement(math.nan, 0.0, 0.0))


@pytest.mark.parametrize(
    ("columns", "covariance", "match"),
    [
        ({"position": [0.0], "velocity": 0.0}, np.eye(2), "columns must be"),
        ({"position": 0.0, "velocity": 0.0, "acceleration": 0.0}, np.eye(2), "one-dimensional"),
        ({"position": np.zeros(11), "velocity": 0.0, "acceleration": 0.0}, np.eye(2), "1 to 10 particles"),
        ({"position": [math.nan], "velocity": 0.0, "acceleration": 0.0}, np.eye(2), "finite"),
        ({"position": [0.0], "velocity": 0.0, "acceleration": 0.0}, np.eye(3), "covariance"),
    ],
)
def test_a_bad_start_is_refused_and_harms_nothing(
    columns: dict[str, object], covariance: Array, match: str
) -> None:
    belief = started()
    with pytest.raises(ValueError, match=match):
        belief.initialize(columns, covariance)  # type: ignore[arg-type]
    assert belief.count == 8
    assert np.array_equal(belief.covariance, np.eye(2))


def test_bad_input_is_refused_and_harms_nothing() -> None:
    belief = started()
    before = belief.column("velocity").copy()
    for duration in (-1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="duration"):
            belief.predict(None, duration)
    with pytest.raises(ValueError, match="finite"):
        belief.correct(SeesPositionAndVelocity(), Readings((math.inf, 0.0)))
    with pytest.raises(ValueError, match="coupling"):
        belief.correct(SeesHeadingLessBias(), Readings((0.0, 0.0)))
    with pytest.raises(ValueError, match="count"):
        belief.resample(11)
    assert np.array_equal(belief.column("velocity"), before)
    assert np.array_equal(belief.covariance, np.eye(2))


def test_a_step_of_wrong_shape_is_refused() -> None:
    class Wrong(Walker):
        transition = np.eye(3)

    wrong: MixedMotion[None] = Wrong()
    belief = MarginalFilter(wrong, capacity=1)
    belief.initialize({"position": [0.0], "velocity": 0.0, "acceleration": 0.0}, np.eye(2))
    with pytest.raises(ValueError, match="transition"):
        belief.predict(None, 0.1)


def test_a_filter_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="capacity"):
        MarginalFilter(Walker(), capacity=0)
    with pytest.raises(ValueError, match="names"):
        MarginalFilter(AllLinear(np.zeros((0, 0)), np.zeros((0, 0))), capacity=1)
