"""The figures of docs/filters.md, drawn from the project's own code: python docs/figures.py [FOLDER].

Every number in them is computed by ``filters``; nothing is traced by hand. Seeded: the same figures every time.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from filters import kld
from filters.kernels import elementary, random
from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.particle_set import ParticleSet
from filters.sensing import Heading, HeadingMeasurement, Range, RangeMeasurement

BLUE, RED, GREY, GREEN, ORANGE = "#2166ac", "#b2182b", "#666666", "#1b7837", "#d95f02"
STYLE = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "axes.axisbelow": True,
    "legend.frameon": False,
    "svg.hashsalt": "beliefd",
    "savefig.bbox": "tight",
}

# --- a rover in a yard with three beacons -----------------------------------------------------------------------

BEACONS = ((-22.0, -12.0), (24.0, -16.0), (4.0, 26.0))
YARD = 32.0
COUNT = 40_000
TICK = 0.1
RANGE_SIGMA = 0.5


class Moment(NamedTuple):
    """What is kept of one tick: seconds, readings so far, truth, cloud, effective share, whether it resampled."""

    time: float
    readings: int
    truth: tuple[float, float, float]
    cloud: NDArray[np.float32]
    share: float
    resampled: bool


def drive() -> Iterator[Moment]:
    """Yield the belief of a rover that knows nothing of its place, tick by tick; one range each 0.1 s."""
    rng = np.random.default_rng(7)
    motion = Unicycle(0.1, 0.02, 1e-4, 1e-4)
    belief = ParticleFilter(motion, capacity=COUNT, seed=7)
    belief.initialize(
        {
            "north": rng.uniform(-YARD, YARD, COUNT),
            "east": rng.uniform(-YARD, YARD, COUNT),
            "heading": rng.uniform(-math.pi, math.pi, COUNT),
            "gyro_bias": np.zeros(COUNT),
            "odometry_scale": np.ones(COUNT),
        }
    )
    beacon_range = Range(RANGE_SIGMA)
    north, east, heading = -10.0, -4.0, 0.6
    yield Moment(0.0, 0, (north, east, heading), belief.cloud(3000).copy(), 1.0, False)
    for tick in range(1, 151):
        distance, turn = 1.2 * TICK, 0.12 * TICK
        north += distance * math.cos(heading + 0.5 * turn)
        east += distance * math.sin(heading + 0.5 * turn)
        heading += turn
        belief.predict(UnicycleControl(distance, turn), TICK)
        place = BEACONS[(tick - 1) % 3]
        measured = math.hypot(north - place[0], east - place[1]) + RANGE_SIGMA * rng.standard_normal()
        belief.weigh(beacon_range, RangeMeasurement(measured, *place))
        belief.normalize()
        share = belief.effective_sample_size / belief.count
        cloud = belief.cloud(3000).copy()
        worn = share < 0.5
        if worn:
            belief.resample()
            cloud = belief.cloud(3000).copy()
        yield Moment(tick * TICK, tick, (north, east, heading), cloud, share, worn)


def yard(moments: list[Moment]) -> Figure:
    """Particles from a wide start, as ranges come in."""
    chosen = ((0, YARD + 2), (1, YARD + 2), (2, YARD + 2), (3, YARD + 2), (30, 4.0), (150, 4.0))
    figure, axes = plt.subplots(2, 3, figsize=(8.6, 5.9), layout="constrained")
    track = np.array([moment.truth for moment in moments])
    for axis, (tick, half) in zip(axes.flat, chosen, strict=True):
        moment = moments[tick]
        north, east, _ = moment.truth if half < YARD else (0.0, 0.0, 0.0)
        axis.scatter(moment.cloud[:, 1], moment.cloud[:, 0], s=2, color=BLUE, alpha=0.25, linewidths=0)
        axis.plot(track[: tick + 1, 1], track[: tick + 1, 0], color=RED, linewidth=1)
        axis.plot(moment.truth[1], moment.truth[0], "x", color=RED, markersize=7, markeredgewidth=1.6)
        axis.plot([place[1] for place in BEACONS], [place[0] for place in BEACONS], "^", color="black")
        words = "range" if moment.readings == 1 else "ranges"
        zoomed = ", closer" if half < YARD else ""
        axis.set_title(f"{moment.time:.1f} s, {moment.readings} {words}{zoomed}", fontsize=9)
        axis.set_aspect("equal")
        axis.set_xlim(east - half, east + half)
        axis.set_ylim(north - half, north + half)
    for axis in axes[1]:
        axis.set_xlabel("east, m")
    for axis in axes[:, 0]:
        axis.set_ylabel("north, m")
    return figure


def effective(moments: list[Moment]) -> Figure:
    """Effective sample size over the same drive, and when it was resampled."""
    figure, axis = plt.subplots(figsize=(6.8, 2.9), layout="constrained")
    driven = moments[1:]
    time = [moment.time for moment in driven]
    axis.plot(time, [moment.share for moment in driven], color=BLUE, linewidth=1.2, label="before resampling")
    worn = [(moment.time, moment.share) for moment in driven if moment.resampled]
    axis.plot(*zip(*worn, strict=True), "v", color=RED, markersize=4, linestyle="none", label="resampled")
    axis.axhline(0.5, color=GREY, linewidth=1, linestyle="--", label="threshold")
    axis.set_xlabel("time, s")
    axis.set_ylabel("effective sample size / particles")
    axis.set_ylim(0, 1.02)
    axis.set_xlim(0, 15.1)
    axis.legend(loc="lower right", ncols=3, bbox_to_anchor=(1.0, 1.0))
    return figure


# --- how many particles, how much of a reading ------------------------------------------------------------------


def bound() -> Figure:
    """The KLD bound against occupied bins."""
    figure, axis = plt.subplots(figsize=(5.2, 3.2), layout="constrained")
    bins = np.unique(np.geomspace(2, 3000, 120).astype(int))
    for error, colour in ((0.01, BLUE), (0.02, GREEN), (0.05, ORANGE)):
        needed = [kld.bound(int(k), error, 0.99) for k in bins]
        axis.loglog(bins, needed, color=colour, label=f"error {error:g} nat")
    axis.set_xlabel("occupied bins k")
    axis.set_ylabel("particles n (probability 0.99)")
    axis.legend()
    return figure


def outlier() -> Figure:
    """Log likelihood of a range, with and without the outlier part, by the sensor model itself."""
    innovation = np.linspace(-5.0, 5.0, 1001)
    figure, axis = plt.subplots(figsize=(5.2, 3.2), layout="constrained")
    lines = ((0.0, GREY, "Gaussian"), (0.05, BLUE, "5 % outliers"), (0.3, ORANGE, "30 % outliers"))
    for outliers, colour, label in lines:
        particles = ParticleSet(("north", "east", "heading"), innovation.size)
        particles.count = innovation.size
        particles.columns[0] = 20.0 - innovation
        sensor = Range(RANGE_SIGMA, outliers=outliers)
        constant = sensor.weigh(particles, 0, particles.count, RangeMeasurement(20.0, 0.0, 0.0))
        axis.plot(innovation, constant + particles.log_weights, color=colour, label=label)
    axis.set_ylim(-16, 0.5)
    axis.set_xlabel("measured minus expected range, m (sigma 0.5 m)")
    axis.set_ylabel("log likelihood, log(1/m)")
    axis.legend(loc="lower center")
    return figure


# --- gyro bias and odometry scale, marginalised -----------------------------------------------------------------


def bias() -> Figure:
    """A gyro's bias learned from headings, with what the filter claims to know of it."""
    rng = np.random.default_rng(3)
    count, rate, true_bias = 2000, 10, 0.02
    motion = Unicycle(0.05, 0.01, 1e-4, 1e-4, gyro_bias_sigma=0.03)
    belief = ParticleFilter(motion, capacity=count, seed=3)
    belief.initialize(
        {name: np.zeros(count) for name in ("north", "east", "gyro_bias")}
        | {"heading": rng.normal(0.0, 0.05, count), "odometry_scale": np.ones(count)}
    )
    compass, rows = Heading(0.05), []
    for tick in range(60 * rate):
        belief.predict(UnicycleControl(0.1, true_bias / rate), 1.0 / rate)  # it drives straight on
        if tick % rate == rate - 1:
            belief.weigh(compass, HeadingMeasurement(0.05 * rng.standard_normal()))
            belief.normalize()
        moments = belief.moments()
        given_path = motion.conditional_variances["gyro_bias"]
        rows.append((moments.mean[3], moments.variance[3] - given_path, given_path))
        if belief.effective_sample_size < 0.5 * count:
            belief.resample()
    mean, spread, conditional = np.array(rows).T
    time = (np.arange(len(rows)) + 1) / rate
    sigma = np.sqrt(spread + conditional)
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(6.8, 4.2), sharex=True, layout="constrained", height_ratios=(3, 2)
    )
    above.fill_between(
        time, mean - 2 * sigma, mean + 2 * sigma, color=BLUE, alpha=0.2, linewidth=0, label="± 2 sigma"
    )
    above.plot(time, mean, color=BLUE, label="mean")
    above.axhline(true_bias, color=RED, linewidth=1, label="truth")
    above.set_ylabel("gyro bias, rad/s")
    above.legend(loc="upper right", ncols=3)
    below.semilogy(time, np.sqrt(spread), color=ORANGE, label="of the particles' means")
    below.semilogy(time, np.sqrt(conditional), color=GREEN, label="given a path, shared by all")
    below.set_ylabel("sigma, rad/s")
    below.set_xlabel("time, s (a heading each second, sigma 0.05 rad)")
    below.legend(loc="upper right")
    return figure


# --- arithmetic -------------------------------------------------------------------------------------------------

Scalar = Callable[[np.float32], float]


def applied(function: Scalar, points: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return a compiled function at every point."""
    return np.array([function(point) for point in points], np.float64)


def arithmetic() -> Figure:
    """Errors of the polynomials against float64."""
    rng = np.random.default_rng(1)
    unit = float(np.finfo(np.float32).eps) / 2.0
    angle = rng.uniform(-4.0 * math.pi, 4.0 * math.pi, 6000).astype(np.float32)
    positive = np.exp(rng.uniform(-20.0, 20.0, 6000)).astype(np.float32)
    power = rng.uniform(-87.0, 20.0, 6000).astype(np.float32)
    exact = {
        name: points.astype(np.float64) for name, points in (("a", angle), ("p", positive), ("e", power))
    }
    sine = applied(lambda x: elementary.sincos(x)[0], angle) - np.sin(exact["a"])
    cosine = applied(lambda x: elementary.sincos(x)[1], angle) - np.cos(exact["a"])
    truth = np.log(exact["p"])
    logarithm = (applied(elementary.log, positive) - truth) / np.maximum(np.abs(truth), 1.0)
    exponential = applied(elementary.exp, power) / np.exp(exact["e"]) - 1.0
    panels = (
        (angle, sine, "sincos, sine: absolute error", "angle, rad"),
        (angle, cosine, "sincos, cosine: absolute error", "angle, rad"),
        (truth, logarithm, "log: error / max(1, |log x|)", "log x"),
        (power, exponential, "exp: relative error", "x"),
    )
    figure, axes = plt.subplots(2, 2, figsize=(8.2, 4.6), layout="constrained")
    for axis, (x, error, title, label) in zip(axes.flat, panels, strict=True):
        axis.plot(x, error / unit, ".", color=BLUE, markersize=1.2)
        axis.set_title(title, fontsize=9)
        axis.set_xlabel(label)
        axis.axhline(0.0, color=GREY, linewidth=0.8)
    for axis in axes[:, 0]:
        axis.set_ylabel("error, units of 2⁻²⁴")
    return figure


def normals() -> Figure:
    """Frequency of the normals against the Gaussian, down to the tails."""
    block, blocks = 1 << 17, 64
    noise = np.zeros((2, block), np.float32)
    edges = np.arange(-6.0, 6.01, 0.1)
    counts = np.zeros(edges.size - 1)
    key = random.key(5, 0)
    for step in range(blocks):
        random.normal_pairs(0, block, step, key, noise, 0)
        counts += np.histogram(noise, edges)[0]
    total = 2 * block * blocks
    middles = 0.5 * (edges[1:] + edges[:-1])
    share = np.array(
        [0.5 * (math.erf(b / math.sqrt(2)) - math.erf(a / math.sqrt(2))) for a, b in pairwise(edges)]
    )
    expected = total * share
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(6.8, 4.6), sharex=True, layout="constrained", height_ratios=(3, 2)
    )
    seen = counts > 0
    above.semilogy(middles, expected, color=RED, linewidth=1.2, label="Gaussian")
    above.semilogy(middles[seen], counts[seen], ".", color=BLUE, markersize=4, label=f"{total:,} normals")
    above.set_ylim(0.3, None)
    above.set_ylabel("count in a bin of 0.1")
    above.legend(loc="upper right")
    enough = expected > 5
    below.axhspan(-2, 2, color=GREY, alpha=0.15, linewidth=0)
    below.plot(
        middles[enough],
        (counts - expected)[enough] / np.sqrt(expected[enough]),
        ".",
        color=BLUE,
        markersize=4,
    )
    below.set_ylabel("(count - expected)\n/ √expected")
    below.set_xlabel("value, sigma")
    below.set_ylim(-4.5, 4.5)
    return figure


def main(folder: Path) -> None:
    """Write every figure into a folder."""
    plt.rcParams.update(STYLE)
    folder.mkdir(parents=True, exist_ok=True)
    moments = list(drive())
    figures = {
        "yard.png": yard(moments),
        "effective.svg": effective(moments),
        "kld.svg": bound(),
        "outlier.svg": outlier(),
        "bias.svg": bias(),
        "arithmetic.png": arithmetic(),
        "normals.svg": normals(),
    }
    for name, figure in figures.items():
        metadata = {"Date": None} if name.endswith(".svg") else {}
        figure.savefig(folder / name, dpi=110, metadata=metadata)
        plt.close(figure)
        print(folder / name)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "figures")
