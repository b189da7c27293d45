"""The figures of discrete.md, drawn from the project's own code: python docs/figures.py discrete."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from filters.discrete import DiscreteBayesFilter
from filters.transition import SparseTransition, transition_over
from service.textbook.style import BLUE, GREY, ORANGE, RED

LENGTH = 40
DOORS = (8, 12, 27)


def corridor() -> SparseTransition:
    """A step of four cells, as often one too short or too long as one in five; the corridor is a ring."""
    place = np.arange(LENGTH)
    step = np.concatenate([(place + move) % LENGTH for move in (3, 4, 5)])
    return SparseTransition(LENGTH, np.tile(place, 3), step, np.repeat([0.1, 0.8, 0.1], LENGTH))


def doors() -> Figure:
    """A robot that knows the doors of a corridor, and not where it is."""
    near_door = np.min([np.abs(np.arange(LENGTH) - door) for door in DOORS], axis=0) == 0
    sees_door = np.where(near_door, 0.8, 0.1)
    belief = DiscreteBayesFilter(range(LENGTH), {"step": corridor()})
    figure, axes = plt.subplots(5, 1, figsize=(6.8, 6.6), sharex=True, layout="constrained")
    truth = 8

    def show(axis: plt.Axes, title: str) -> None:
        axis.bar(np.arange(LENGTH), belief.belief, color=BLUE, width=0.9)
        axis.plot(truth, 0.0, "v", color=RED, markersize=7, clip_on=False)
        for door in DOORS:
            axis.axvspan(door - 0.5, door + 0.5, color=ORANGE, alpha=0.25, linewidth=0)
        axis.set_ylim(0, 1)
        axis.set_title(title, fontsize=9, loc="left")

    show(axes[0], "at the start: every place alike")
    belief.update(sees_door)
    show(axes[1], "a door is seen: one of the three (line 4)")
    belief.predict("step")
    truth += 4
    show(axes[2], "four cells on: moved and blurred (line 3)")
    belief.update(sees_door)
    show(axes[3], "a door again: only one pair of doors is four cells apart")
    for _ in range(2):
        belief.predict("step")
        truth += 4
        belief.update(1.0 - sees_door)
    show(axes[4], "eight cells on, wall seen twice")
    axes[4].set_xlabel("place in the corridor, cells (doors in orange, the robot in red)")
    axes[2].set_ylabel("probability")
    axes[4].set_xlim(-0.6, LENGTH - 0.4)
    return figure


RATES = [[0.0, 0.2, 0.0], [0.1, 0.0, 0.1], [0.1, 0.5, 0.0]]
"""Still, moving, slipping: how often a second each turns into another."""


def mode() -> Figure:
    """Still, moving, slipping, from two speeds with noise."""
    rng = np.random.default_rng(4)
    rate, sigma = 10, 0.3
    time = np.arange(0, 24, 1 / rate)
    wheels = np.where((time > 4) & (time < 20), 1.0, 0.0)
    ground = np.where((time > 4) & (time < 11), 1.0, 0.0) + np.where((time >= 16) & (time < 20), 1.0, 0.0)
    belief = DiscreteBayesFilter(("still", "moving", "slipping"), np.eye(3))
    expected = np.array([[0.0, 0.0], [1.0, 1.0], [1.0, 0.0]])
    passed = transition_over(RATES, 1 / rate)
    rows, measured = [], []
    for truth in zip(wheels, ground, strict=True):
        z = np.array(truth) + sigma * rng.standard_normal(2)
        belief.propagate(passed)
        belief.update_log(-0.5 * np.sum(((z - expected) / sigma) ** 2, axis=1))
        rows.append(belief.belief)
        measured.append(z)
    figure, (above, below) = plt.subplots(2, 1, figsize=(6.8, 4.2), sharex=True, layout="constrained")
    above.plot(time, np.array(measured)[:, 0], ".", color=ORANGE, markersize=3, label="wheels")
    above.plot(time, np.array(measured)[:, 1], "x", color=BLUE, markersize=3, label="over ground")
    above.set_ylabel("measured speed, m/s")
    above.legend(loc="upper right", ncols=2, bbox_to_anchor=(1.0, 1.18))
    below.stackplot(time, np.array(rows).T, colors=(GREY, BLUE, RED), alpha=0.75)
    for x, name in ((2, "still"), (7.5, "moving"), (13.5, "slipping"), (18, "moving"), (22, "still")):
        below.text(x, 0.5, name, ha="center", color="white", weight="bold")
    below.set_ylim(0, 1)
    below.set_xlim(0, time[-1])
    below.set_ylabel("probability of the mode")
    below.set_xlabel("time, s")
    return figure


FIGURES = {"corridor": doors, "mode": mode}
