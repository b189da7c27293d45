"""The figures of hypotheses.md, drawn from the project's own code: python docs/figures.py hypotheses."""

from __future__ import annotations

import math

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from filters.density.k_means import KMeans
from filters.hypotheses import Hypotheses
from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.sensing import Range, RangeMeasurement
from service.textbook.style import BLUE, GREEN, GREY, ORANGE, RED

BEACONS = ((0.0, 0.0), (0.0, 40.0))
COUNT, TICK, TURNING, STEPS = 3000, 0.2, 150, 200
COLOURS = (BLUE, ORANGE, GREEN, RED, GREY)


def mirror() -> Figure:
    """Drive along the line of two beacons, with particles on both sides of it, then turn off."""
    rng = np.random.default_rng(4)
    belief = ParticleFilter(Unicycle(0.1, 0.02, 0.0, 0.0), capacity=COUNT, seed=4)
    side = np.where(rng.random(COUNT) < 0.5, 1.0, -1.0)
    belief.initialize(
        {
            "north": -7.0 * side + rng.normal(0.0, 0.5, COUNT),
            "east": rng.normal(5.0, 0.5, COUNT),
            "heading": rng.normal(0.5 * math.pi, 0.1, COUNT),
            "gyro_bias": np.zeros(COUNT),
            "odometry_scale": np.ones(COUNT),
        }
    )
    hypotheses, sensor = Hypotheses(COUNT, 5), Range(0.3, outliers=0.1)
    truth, track = np.array([-7.0, 5.0, 0.5 * math.pi]), []
    figure, (plan, share) = plt.subplots(1, 2, figsize=(9.0, 3.4), width_ratios=(3, 2))
    weights: dict[int, list[tuple[float, float]]] = {}
    for step in range(STEPS):
        rate = 0.25 * math.pi if TURNING <= step < TURNING + 10 else 0.0
        truth += (0.1 * math.cos(truth[2]), 0.1 * math.sin(truth[2]), rate * TICK)
        track.append(truth[:2].copy())
        belief.predict(UnicycleControl(0.1 + rng.normal(0, 0.01), rate * TICK + rng.normal(0, 0.004)), TICK)
        for north, east in BEACONS:
            reading = math.hypot(truth[0] - north, truth[1] - east) + rng.normal(0.0, 0.3)
            late = rng.exponential(3.0) if rng.random() < 0.1 else 0.0
            belief.weigh(sensor, RangeMeasurement(reading + late, north, east, 0.0))
        belief.normalize()
        hypotheses.look(belief.columns, belief.weights, belief.count)
        if belief.effective_sample_size < COUNT / 2:
            belief.resample_by_label(hypotheses.labels, hypotheses.quotas(belief.weights, COUNT, COUNT))
        found = hypotheses.moments(belief.columns, belief.weights, belief.count)
        for each in found:
            weights.setdefault(each.name, []).append((step * TICK, each.weight))
        if step % 25 == 24:
            for each in found:
                colour = COLOURS[(each.name - 1) % len(COLOURS)]
                plan.plot(each.mean[1], each.mean[0], "o", color=colour, ms=3.0 + 7.0 * each.weight)
    plan.plot(*np.array(track).T[::-1], color=GREY, lw=1.0, label="truth")
    plan.plot([east for _, east in BEACONS], [north for north, _ in BEACONS], "k^", label="beacons")
    plan.set(xlabel="east (m)", ylabel="north (m)", aspect="equal")
    plan.legend(loc="center", fontsize=8)
    for name, line in weights.items():
        share.plot(*np.array(line).T, color=COLOURS[(name - 1) % len(COLOURS)], label=f"hypothesis {name}")
    share.axvline(TURNING * TICK, color=GREY, lw=0.8, ls=":")
    share.set(xlabel="time (s)", ylabel="weight", ylim=(-0.02, 1.02))
    share.legend(fontsize=8)
    return figure


def shapes() -> Figure:
    """Ask how many places there are in four sets of particles: by valleys, and by k-means with evidence."""
    rng = np.random.default_rng(2)
    angle, length = rng.uniform(-math.pi, math.pi, 4000), rng.normal(20.0, 0.5, 4000)
    bent = rng.normal(0.0, 0.8, 4000)
    two = np.repeat([-7.0, 7.0], [2800, 1200])
    sets = {
        "two places": np.stack([rng.normal(0, 1, 4000), rng.normal(two, 1)]),
        "a ring": np.stack([length * np.cos(angle), length * np.sin(angle)]),
        "a banana": np.stack([length * np.cos(bent), length * np.sin(bent)]),
        "an area": rng.uniform(-20.0, 20.0, (2, 4000)),
    }
    figure, axes = plt.subplots(1, 4, figsize=(9.0, 2.6))
    for ax, (title, points) in zip(axes, sets.items(), strict=True):
        columns = np.concatenate([points, np.zeros((1, 4000))]).astype(np.float32)
        columns = np.ascontiguousarray(columns[:, rng.permutation(4000)])
        hypotheses = Hypotheses(4000, 3)
        for _ in range(3):
            hypotheses.look(columns, np.ones(4000, np.float32), 4000)
        for label in sorted(hypotheses.names):
            own = columns[:, hypotheses.labels == label][:, ::12]
            ax.plot(own[1], own[0], ".", ms=1.5, color=COLOURS[label % len(COLOURS)])
        mixture = KMeans()(columns[:2].T)
        ax.set_title(f"{title}: {hypotheses.count}\nk-means: {len(mixture.components)}", fontsize=9)
        ax.set(aspect="equal", xticks=[], yticks=[])
    return figure


FIGURES = {"mirror": mirror, "shapes": shapes}
