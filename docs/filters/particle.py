"""The figures of particle.md, drawn from the project's own code: python docs/figures.py particle."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.policy import EffectiveShare, Wear
from filters.resampling import multinomial, systematic
from filters.sensing import Range, RangeMeasurement
from filters.textbook.bias import Step, expected, posterior, simulated
from service.textbook.style import BLUE, GREY, ORANGE, RED

BEACONS = ((-22.0, -12.0), (24.0, -16.0), (4.0, 26.0))
YARD, COUNT, TICK, RANGE_SIGMA = 32.0, 40_000, 0.1, 0.5
Moment = tuple[float, tuple[float, float, float], NDArray[np.float32], float, bool]


def _drive() -> Iterator[Moment]:
    """Yield time, truth, cloud, effective share and whether it resampled, of a rover that starts anywhere."""
    rng = np.random.default_rng(7)
    belief = ParticleFilter(Unicycle(0.1, 0.02, 1e-4, 1e-4), capacity=COUNT, seed=7)
    belief.initialize(
        {
            "north": rng.uniform(-YARD, YARD, COUNT),
            "east": rng.uniform(-YARD, YARD, COUNT),
            "heading": rng.uniform(-math.pi, math.pi, COUNT),
            "gyro_bias": np.zeros(COUNT),
            "odometry_scale": np.ones(COUNT),
        }
    )
    beacon_range, rule = Range(RANGE_SIGMA), EffectiveShare(0.5)
    north, east, heading = -10.0, -4.0, 0.6
    yield 0.0, (north, east, heading), belief.cloud(3000).copy(), 1.0, False
    for tick in range(1, 151):
        distance, turn = 1.2 * TICK, 0.12 * TICK
        north += distance * math.cos(heading + 0.5 * turn)
        east += distance * math.sin(heading + 0.5 * turn)
        heading += turn
        belief.predict(UnicycleControl(distance, turn), TICK)
        place = BEACONS[(tick - 1) % 3]
        measured = math.hypot(north - place[0], east - place[1]) + RANGE_SIGMA * rng.standard_normal()
        belief.weigh(beacon_range, RangeMeasurement(measured, *place))
        wear = Wear(belief.count, belief.effective_sample_size)
        cloud = belief.cloud(3000).copy()
        if rule.due(wear):
            belief.resample()
            cloud = belief.cloud(3000).copy()
        yield tick * TICK, (north, east, heading), cloud, wear.effective_sample_size / COUNT, rule.due(wear)


@cache
def drive() -> list[Moment]:
    """Return the drive that two figures show."""
    return list(_drive())


def yard() -> Figure:
    """Particles from a wide start, as ranges come in."""
    moments = drive()
    chosen = ((0, YARD + 2), (1, YARD + 2), (2, YARD + 2), (3, YARD + 2), (30, 4.0), (150, 4.0))
    figure, axes = plt.subplots(2, 3, figsize=(8.6, 5.9), layout="constrained")
    track = np.array([moment[1] for moment in moments])
    for axis, (tick, half) in zip(axes.flat, chosen, strict=True):
        time, truth, cloud, _, _ = moments[tick]
        north, east, _ = truth if half < YARD else (0.0, 0.0, 0.0)
        axis.scatter(cloud[:, 1], cloud[:, 0], s=2, color=BLUE, alpha=0.25, linewidths=0, rasterized=True)
        axis.plot(track[: tick + 1, 1], track[: tick + 1, 0], color=RED, linewidth=1)
        axis.plot(truth[1], truth[0], "x", color=RED, markersize=7, markeredgewidth=1.6)
        axis.plot([place[1] for place in BEACONS], [place[0] for place in BEACONS], "^", color="black")
        words = "range" if tick == 1 else "ranges"
        axis.set_title(f"{time:.1f} s, {tick} {words}{', closer' if half < YARD else ''}", fontsize=9)
        axis.set_aspect("equal")
        axis.set_xlim(east - half, east + half)
        axis.set_ylim(north - half, north + half)
    for axis in axes[1]:
        axis.set_xlabel("east, m")
    for axis in axes[:, 0]:
        axis.set_ylabel("north, m")
    return figure


def effective() -> Figure:
    """Effective sample size over the same drive, and when it was resampled."""
    figure, axis = plt.subplots(figsize=(6.8, 2.9), layout="constrained")
    driven = drive()[1:]
    axis.plot(
        [m[0] for m in driven], [m[3] for m in driven], color=BLUE, linewidth=1.2, label="before resampling"
    )
    worn = [(m[0], m[3]) for m in driven if m[4]]
    axis.plot(*zip(*worn, strict=True), "v", color=RED, markersize=4, linestyle="none", label="resampled")
    axis.axhline(0.5, color=GREY, linewidth=1, linestyle="--", label="threshold")
    axis.set_xlabel("time, s")
    axis.set_ylabel("effective sample size / particles")
    axis.set_ylim(0, 1.02)
    axis.set_xlim(0, 15.1)
    axis.legend(loc="lower right", ncols=3, bbox_to_anchor=(1.0, 1.0))
    return figure


def bias() -> Figure:
    """Exercise 3: what few particles make of one measurement, exactly and by simulation."""
    prior, step = [0.8, 0.2], [Step(np.eye(2), np.array([0.1, 0.9]))]
    exact = posterior(prior, step)[1]
    counts = (1, 2, 3, 4, 6, 8, 10, 12)
    figure, axis = plt.subplots(figsize=(6.8, 3.2), layout="constrained")
    axis.axhline(exact, color=RED, linewidth=1.2, label="Bayes: p(x | u, z)")
    axis.axhline(prior[1], color=GREY, linewidth=1.2, linestyle="--", label="prediction: p(x | u)")
    axis.plot(counts, [expected(prior, step, m)[1] for m in counts], "o-", color=BLUE, label="by enumeration")
    seen = [simulated(prior, step, m, 4000, seed=m)[1] for m in counts]
    axis.plot(counts, seen, "x", color=ORANGE, markersize=8, label="4,000 simulated filters")
    axis.set_xlabel("particles M")
    axis.set_ylabel("mean share of particles in state 2")
    axis.set_ylim(0, 0.8)
    axis.legend(loc="lower right", ncols=2)
    return figure


def still() -> Figure:
    """Resampling a state that does not move and of which nothing is measured: how many values are left."""
    figure, axis = plt.subplots(figsize=(6.8, 3.0), layout="constrained")
    rng = np.random.default_rng(4)
    for name, scheme, colour, line, width in (
        ("never", None, "#a6dba0", "-", 5.0),
        ("always, Table 4.4", systematic, BLUE, "--", 1.6),
        ("always, multinomial", multinomial, RED, "-", 1.6),
    ):
        values = np.arange(1000)
        left = [1000]
        for _ in range(3000):
            if scheme is not None:
                values = values[scheme(np.ones(1000, np.float32), 1000, 1.0 - rng.random())]
            left.append(np.unique(values).size)
        axis.loglog(np.arange(1, 3002), left, color=colour, linestyle=line, linewidth=width, label=name)
    axis.set_xlabel("resamplings")
    axis.set_ylabel("different particles of 1,000")
    axis.legend(loc="lower left")
    return figure


FIGURES = {"yard": yard, "effective": effective, "bias": bias, "still": still}
STYLE = {"savefig.dpi": 130}
