"""The figure of marginal.md, drawn from the project's own code: python docs/figures.py marginal.

python docs/filters/marginal.py prints the numbers of the page.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from filters.kernels.compile import Float32Array
from filters.marginal import MarginalFilter
from filters.mixed import MixedObservation, MixedStep
from filters.particle_set import ParticleSet
from service.textbook.style import BLUE, ORANGE

SEEDS, STEPS, REFERENCE = 100, 30, 20_000
COUNTS = (25, 50, 100, 200, 400, 800)
TRANSITION = np.array([[1.0, 0.3, 0.0], [0.0, 0.92, -0.3], [0.0, 0.3, 0.92]])
STATES = ("a", "l1", "l2", "l3")
Array = NDArray[np.float64]


class Readings(NamedTuple):
    """What was measured at one step."""

    square: float
    linear: float


class Mixed:
    """a' = atan a + l1 + w, l' = F l + r: one sampled state, three linear ones."""

    nonlinear = ("a",)
    linear = ("l1", "l2", "l3")
    angles: tuple[int, ...] = ()

    def begin(self, control: None, duration: float) -> MixedStep:
        return MixedStep(
            offset=np.zeros(1),
            coupling=np.array([[1.0, 0.0, 0.0]]),
            noise=np.array([[0.01]]),
            transition=TRANSITION,
            drift=np.zeros(3),
            linear_noise=0.01 * np.eye(3),
        )

    def move(self, particles: ParticleSet, first: int, last: int, increments: Float32Array) -> None:
        a = particles.columns[0, first:last]
        a[:] = np.arctan(a) + increments[0, : last - first]


class MixedSensor:
    """z = (0.1 a² sign a, l1 - l2 + l3) + e."""

    def begin(self, measurement: Readings) -> MixedObservation:
        coupling = np.array([[0.0, 0.0, 0.0], [1.0, -1.0, 1.0]])
        return MixedObservation(np.array(measurement), coupling, 0.1 * np.eye(2))

    def expect(
        self, particles: ParticleSet, first: int, last: int, measurement: Readings, expected: Float32Array
    ) -> None:
        a = particles.columns[0, first:last]
        expected[0, : last - first] = 0.1 * a * np.abs(a)
        expected[1, : last - first] = 0.0


class Plain:
    """The same model with every state sampled: four increments, nothing linear. It is the plain particle filter."""

    nonlinear = STATES
    linear: tuple[str, ...] = ()
    angles: tuple[int, ...] = ()

    def begin(self, control: None, duration: float) -> MixedStep:
        empty = np.zeros((0, 0))
        return MixedStep(np.zeros(4), np.zeros((4, 0)), 0.01 * np.eye(4), empty, np.zeros(0), empty)

    def move(self, particles: ParticleSet, first: int, last: int, increments: Float32Array) -> None:
        state = particles.columns[:, first:last]
        state[0] = np.arctan(state[0]) + state[1]
        state[1:] = TRANSITION.astype(np.float32) @ state[1:]
        state += increments[:, : last - first]


class PlainSensor:
    """The same sensor of sampled states."""

    def begin(self, measurement: Readings) -> MixedObservation:
        return MixedObservation(np.array(measurement), np.zeros((2, 0)), 0.1 * np.eye(2))

    def expect(
        self, particles: ParticleSet, first: int, last: int, measurement: Readings, expected: Float32Array
    ) -> None:
        a, one, two, three = particles.columns[:, first:last]
        expected[0, : last - first] = 0.1 * a * np.abs(a)
        expected[1, : last - first] = one - two + three


def world(seed: int) -> tuple[Array, list[Readings]]:
    """A truth, (STEPS, 4), and its measurements."""
    rng = np.random.default_rng(1000 + seed)
    a, linear = rng.normal(), rng.normal(size=3)
    truth: list[list[float]] = []
    readings: list[Readings] = []
    for _ in range(STEPS):
        a = math.atan(a) + linear[0] + 0.1 * rng.normal()
        linear = TRANSITION @ linear + 0.1 * rng.normal(size=3)
        truth.append([a, *linear])
        square, seen = math.sqrt(0.1) * rng.normal(size=2)
        readings.append(Readings(0.1 * a * abs(a) + square, linear[0] - linear[1] + linear[2] + seen))
    return np.array(truth), readings


def marginal_means(readings: list[Readings], count: int, seed: int) -> Array:
    """Means of the marginalised filter."""
    belief = MarginalFilter(Mixed(), capacity=count, seed=seed)
    start = np.random.default_rng(seed).normal(size=count)
    belief.initialize({"a": start, "l1": 0.0, "l2": 0.0, "l3": 0.0}, np.eye(3))
    return means(belief, MixedSensor(), readings)


def plain_means(readings: list[Readings], count: int, seed: int) -> Array:
    """Means of the plain filter."""
    belief = MarginalFilter(Plain(), capacity=count, seed=seed)
    start = np.random.default_rng(seed).normal(size=(4, count))
    belief.initialize(dict(zip(STATES, start, strict=True)), np.zeros((0, 0)))
    return means(belief, PlainSensor(), readings)


def means(belief: MarginalFilter[None], sensor: MixedSensor | PlainSensor, readings: list[Readings]) -> Array:
    """Run a filter that resamples at each step."""
    rows: list[Array] = []
    for reading in readings:
        belief.predict(None, 1.0)
        belief.correct(sensor, reading)
        rows.append(belief.moments().mean)
        belief.resample()
    return np.array(rows)


class Errors(NamedTuple):
    """Mean squared error of each seed and count, (SEEDS, counts): to the truth, and to the converged answer."""

    truth: Array
    converged: Array


def compare() -> tuple[Errors, Errors]:
    """Errors of the marginalised and of the plain filter on the same measurements."""
    squares = np.zeros((2, 2, SEEDS, len(COUNTS)))
    for seed in range(SEEDS):
        truth, readings = world(seed)
        converged = marginal_means(readings, REFERENCE, seed + SEEDS)
        for k, count in enumerate(COUNTS):
            for which, run in enumerate((marginal_means, plain_means)):
                said = run(readings, count, seed)
                squares[which, 0, seed, k] = np.mean((said - truth) ** 2)
                squares[which, 1, seed, k] = np.mean((said - converged) ** 2)
    return Errors(*squares[0]), Errors(*squares[1])


def root_mean(squares: Array) -> tuple[Array, Array, Array]:
    """Root mean square over seeds, with the ends of its 95 % interval by bootstrap."""
    chosen = np.random.default_rng(1).integers(0, len(squares), (2000, len(squares)))
    drawn = np.sqrt(squares[chosen].mean(axis=1))
    low, high = np.quantile(drawn, (0.025, 0.975), axis=0)
    return np.sqrt(squares.mean(axis=0)), low, high


def ratio(ours: Array, theirs: Array) -> tuple[float, float, float]:
    """Ratio of two root mean squares over the same seeds, with its 95 % interval by bootstrap."""
    chosen = np.random.default_rng(1).integers(0, len(ours), (4000, len(ours)))
    drawn = np.sqrt(ours[chosen].mean(axis=1) / theirs[chosen].mean(axis=1))
    low, high = np.quantile(drawn, (0.025, 0.975))
    return math.sqrt(ours.mean() / theirs.mean()), float(low), float(high)


def picture(ours: Errors, theirs: Errors) -> Figure:
    """Draw both filters' errors by the number of particles."""
    figure, axes = plt.subplots(1, 2, figsize=(8.2, 3.3), layout="constrained")
    titles = ("from the answer of 20,000 particles", "from the truth")
    for axis, kind, title in zip(axes, ("converged", "truth"), titles, strict=True):
        for errors, colour, mark, label in (
            (theirs, ORANGE, "s", "plain: four states sampled"),
            (ours, BLUE, "o", "marginalised: one sampled, three linear"),
        ):
            middle, low, high = root_mean(getattr(errors, kind))
            axis.fill_between(COUNTS, low, high, color=colour, alpha=0.2, linewidth=0)
            axis.plot(COUNTS, middle, color=colour, marker=mark, markersize=4, label=label)
        axis.set_xscale("log")
        axis.set_xticks(COUNTS, [str(count) for count in COUNTS])
        axis.minorticks_off()
        axis.set_xlabel("particles")
        axis.set_title(title, fontsize=9)
    axes[0].set_yscale("log")
    axes[0].set_ylabel("error of the mean, root mean square\n(unit of the states)")
    axes[1].set_ylim(0.3, None)
    axes[0].legend(loc="lower left")
    return figure


FIGURES = {"error": lambda: picture(*compare())}

if __name__ == "__main__":
    marginal, plain = compare()
    for k, count in enumerate(COUNTS[:-2]):
        for kind in ("converged", "truth"):
            few, many = getattr(marginal, kind)[:, k], getattr(plain, kind)[:, k + 2]
            print(
                f"{kind}: {count} marginalised {math.sqrt(few.mean()):.4f}, {COUNTS[k + 2]} plain "
                f"{math.sqrt(many.mean()):.4f}, ratio {ratio(few, many)[0]:.3f} "
                f"({ratio(few, many)[1]:.3f} to {ratio(few, many)[2]:.3f})"
            )
