"""The figures of recovery.md, drawn from the project's own code: python docs/figures.py recovery."""

from __future__ import annotations

import math
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from filters.annealed import AnnealedSampler
from filters.grid import Axis, Grid
from filters.histogram import HistogramFilter
from filters.motion import RandomWalk, Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.proposals import Ring, Rings
from filters.recovery import AugmentedRecovery
from filters.regularization import Preserving, Spreading
from filters.sensing import Range, RangeMeasurement
from service.textbook.style import BLUE, GREEN, GREY, ORANGE, RED

BEACONS = ((-40.0, -40.0), (45.0, -35.0), (0.0, 50.0))
COUNT, TICK, TAKEN, STEPS = 2000, 0.1, 100, 200


class Run(NamedTuple):
    """Error (m) and share at each step."""

    errors: list[float]
    shares: list[float]


def kidnapped_run(evidence_from: str) -> Run:
    """Three ranges a step; at step 100 the vehicle is carried off by 50 m."""
    rng, sensor = np.random.default_rng(1), Range(0.5, outliers=0.05, span=200.0)
    belief = ParticleFilter(Unicycle(0.3, 0.1, 0.0, 0.0), capacity=COUNT, seed=1)
    start = {name: rng.normal(0.0, 0.3, COUNT) for name in ("north", "east", "heading")}
    belief.initialize(start | {"gyro_bias": np.zeros(COUNT), "odometry_scale": np.ones(COUNT)})
    recovery, run = AugmentedRecovery(0.02, 0.3), Run([], [])
    for step in range(STEPS):
        north, east = (0.0, 0.0) if step < TAKEN else (30.0, -40.0)
        belief.predict(UnicycleControl(0.0, 0.0), TICK)
        rings = []
        for n, e in BEACONS:
            z = math.hypot(north - n, east - e) + 0.5 * rng.standard_normal()
            evidence = belief.weigh(sensor, RangeMeasurement(z, n, e))
            rings.append(Ring(n, e, z, 0.5))
            if evidence_from == "unnormalised":
                recovery.observe("range", evidence.log_mean)
        if evidence_from == "normalised":
            recovery.observe("range", math.log((belief.weights / belief.weights.sum()).mean()))
        mean = belief.moments().mean
        run.errors.append(math.hypot(mean[0] - north, mean[1] - east))
        run.shares.append(recovery.share)
        injected = round(recovery.share * COUNT)
        if injected > 0:
            belief.inject(Rings(rings).draw(injected, rng))
        else:
            belief.resample()
    return run


def kidnapped() -> Figure:
    """Error and share of a kidnapped belief, with recovery and without."""
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(6.8, 4.4), sharex=True, layout="constrained", height_ratios=(3, 2)
    )
    time = (np.arange(STEPS) + 1) * TICK
    for name, colour, line in (
        ("nothing", GREY, ":"),
        ("normalised", ORANGE, "--"),
        ("unnormalised", BLUE, "-"),
    ):
        run = kidnapped_run(name)
        label = "no recovery" if name == "nothing" else f"{name} evidence"
        above.semilogy(time, run.errors, color=colour, linestyle=line, label=label)
        if name != "nothing":
            below.plot(time, run.shares, color=colour, linestyle=line)
    for axis in (above, below):
        axis.axvline(TAKEN * TICK, color=RED, linewidth=1)
    above.text(TAKEN * TICK - 0.2, 30.0, "carried off by 50 m", color=RED, ha="right", va="center")
    above.set_ylabel("error of the mean, m")
    above.legend(loc="upper left", bbox_to_anchor=(0.0, 0.8))
    below.set_ylabel("share drawn anew")
    below.set_ylim(-0.02, 1.0)
    below.set_xlabel("time, s (three ranges each 0.1 s, sigma 0.5 m)")
    return figure


def rings() -> Figure:
    """Places drawn from one range, two, and three, jointly."""
    places = [Ring(0.0, 0.0, 20.0, 0.8), Ring(5.0, 25.0, 18.0, 0.8), Ring(-22.0, 12.0, 30.0, 0.8)]
    figure, axes = plt.subplots(1, 3, figsize=(8.6, 3.2), sharey=True, layout="constrained")
    for number, axis in enumerate(axes, 1):
        drawn = Rings(places[:number]).draw(1500, np.random.default_rng(1))
        axis.scatter(
            drawn["east"], drawn["north"], s=3, color=BLUE, alpha=0.35, linewidths=0, rasterized=True
        )
        axis.plot([r.east for r in places[:number]], [r.north for r in places[:number]], "^", color="black")
        axis.set_title(f"{number} {'range' if number == 1 else 'ranges'}", fontsize=9)
        axis.set_aspect("equal")
        axis.set_xlim(-24, 40)
        axis.set_ylim(-28, 28)
        axis.set_xlabel("east, m")
    axes[0].set_ylabel("north, m")
    return figure


def kernels() -> Figure:
    """A slow state that nothing measures, resampled by what the pose measured: its values and their spread."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.2, 3.1), layout="constrained")
    for label, rule, colour, line in (
        ("copies only", None, RED, "-"),
        ("Spreading", Spreading(), GREEN, "--"),
        ("Preserving", Preserving(), BLUE, "-"),
    ):
        rng = np.random.default_rng(5)
        belief = ParticleFilter(
            Unicycle(1.0, 0.0, 0.0, 0.0), capacity=200, seed=1, slow=[RandomWalk("range_bias", 0.0)]
        )
        start = {name: np.zeros(200) for name in ("north", "east", "heading", "gyro_bias")}
        belief.initialize(start | {"odometry_scale": np.ones(200), "range_bias": rng.normal(0.0, 0.3, 200)})
        values, spread = [200], [0.3]
        for _ in range(300):
            belief.predict(UnicycleControl(0.0, 0.0), 1.0)
            belief.weigh(Range(0.3, outliers=0.0), RangeMeasurement(100.0, -100.0, 0.0))
            if rule is None:
                belief.resample()
            else:
                belief.resample_regularized(["range_bias"], rule)
            values.append(np.unique(belief.column("range_bias")).size)
            spread.append(float(belief.column("range_bias").std()))
        left.semilogy(values, color=colour, linestyle=line, label=label)
        right.semilogy(spread, color=colour, linestyle=line)
    right.axhline(0.3, color=GREY, linewidth=1, linestyle=":")
    right.set_ylim(1e-2, 30.0)
    left.set_ylabel("different values of 200")
    right.set_ylabel("sigma of the slow state, m")
    for axis in (left, right):
        axis.set_xlabel("resamplings")
    left.legend(loc="center right")
    return figure


def search() -> Figure:
    """A vehicle that drove an arc of 12 m between 24 ranges of sigma 0.5 m, anywhere in a field of 170 m square."""
    rng = np.random.default_rng(4)
    there = np.linspace(0.0, 12.0, 24)  # the way so far: forward and right of where it began
    forward, right = 30.0 * np.sin(there / 30.0), 30.0 - 30.0 * np.cos(there / 30.0)
    truth = np.array([[20.0, -15.0, 0.9]])

    def distances(points: np.ndarray) -> np.ndarray:
        sine, cosine = np.sin(points[:, 2:]), np.cos(points[:, 2:])
        north = points[:, :1] + forward * cosine - right * sine
        east = points[:, 1:2] + forward * sine + right * cosine
        beacons = np.array([BEACONS[k % 3] for k in range(24)]).T
        return np.hypot(north - beacons[0], east - beacons[1])

    measured = distances(truth)[0] + 0.5 * rng.standard_normal(24)

    def log_likelihood(points: np.ndarray) -> np.ndarray:
        square = ((distances(points) - measured) / 0.5) ** 2
        return 0.5 * np.logaddexp(math.log(0.95 / 1.25) - 0.5 * square, math.log(0.05 / 200.0)).sum(axis=1)

    grid = HistogramFilter(Grid((Axis(-85.0, 85.0, 64), Axis(-85.0, 85.0, 64))))
    for k, (north, east) in enumerate(
        BEACONS
    ):  # the first range to each, widened by the way since and by a cell
        wide = 3.0
        grid.update(
            lambda at, n=north, e=east, z=measured[k], w=wide: (
                -0.25 * ((np.hypot(at[0] - n, at[1] - e) - z) / w) ** 2
            )
        )
    points = np.column_stack([grid.draw(2048, rng), rng.uniform(-math.pi, math.pi, 2048)])

    def log_start(at: np.ndarray) -> np.ndarray:
        with np.errstate(divide="ignore"):
            return np.log(grid.evaluate(at[:, :2]) / (2.0 * math.pi))

    sampler = AnnealedSampler(points, log_start, log_likelihood, rng, wraps=(2,))
    figure, (axes, below) = plt.subplots(2, 4, figsize=(8.2, 4.4), layout="constrained", height_ratios=(2, 1))
    axes[0].imshow(
        np.sqrt(grid.belief), origin="lower", extent=(-85, 85, -85, 85), cmap="Blues", interpolation="nearest"
    )
    axes[0].set_title("grid: where the mass is", fontsize=9)
    for axis, least in zip(axes[1:], (0.0, 0.02, 1.0), strict=True):
        while sampler.share < least or not least:
            if sampler.advance() or not least:
                break
        sampler.finish() if least == 1.0 else None
        at = sampler.points
        axis.scatter(at[::3, 1], at[::3, 0], s=3, color=BLUE, alpha=0.4, linewidths=0, rasterized=True)
        axis.set_title(f"points, b = {sampler.share:.3g}", fontsize=9)
        under = below[list(axes).index(axis)]
        under.hist(at[:, 2], bins=60, range=(-math.pi, math.pi), color=BLUE, histtype="stepfilled")
        under.axvline(truth[0, 2], color=RED, linewidth=1)
        under.set_xlabel("heading, rad")
        under.set_yticks([])
        axis.set_yticks([])
        under.grid(visible=False)
    below[0].axis("off")
    for axis in axes:
        axis.plot([e for _, e in BEACONS], [n for n, _ in BEACONS], "^", color="black", markersize=4)
        axis.plot(truth[:, 1], truth[:, 0], "o", markerfacecolor="none", color=RED, markersize=8)
        axis.set_aspect("equal")
        axis.set_xlim(-85, 85)
        axis.set_ylim(-85, 85)
        axis.grid(visible=False)
        axis.set_xlabel("east, m")
    axes[0].set_ylabel("north, m")
    return figure


FIGURES = {"kidnapped": kidnapped, "rings": rings, "kernels": kernels, "search": search}
STYLE = {"savefig.dpi": 130}
