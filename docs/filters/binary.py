"""The figures of binary.md, drawn from the project's own code: python docs/figures.py binary."""

from __future__ import annotations

import math

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from filters.binary import BinaryBayesFilter
from service.textbook.style import BLUE, GREY, ORANGE, RED


def liar() -> Figure:
    """One cell, a sensor that is right four times in five and then lies; with and without a limit."""
    rng = np.random.default_rng(1)
    steps, lie, end = 220, (80, 110), 170
    truth = np.arange(steps) < end
    says = np.where(rng.random(steps) < 0.8, truth, ~truth)
    says[lie[0] : lie[1]] = False
    figure, axis = plt.subplots(figsize=(6.8, 3.4), layout="constrained")
    for limit, colour, label in ((math.inf, GREY, "without a limit"), (6.0, BLUE, "limit 6")):
        belief = BinaryBayesFilter(limit=limit)
        rows = []
        for occupied in says:
            belief.update(0.8 if occupied else 0.2)
            rows.append(float(belief.log_odds))
        axis.step(np.arange(steps), rows, where="post", color=colour, linewidth=1.3, label=label)
    axis.axvspan(*lie, color=ORANGE, alpha=0.2, linewidth=0)
    axis.text(sum(lie) / 2, 78, "it lies", ha="center", va="top", color="#a04000")
    axis.axvline(end, color=RED, linewidth=1)
    axis.text(end + 2, 78, "the door opens", va="top", color=RED)
    axis.axhline(0.0, color="black", linewidth=0.8)
    axis.set_ylim(-18, 80)
    axis.set_xlim(0, steps)
    axis.set_xlabel("measurement")
    axis.set_ylabel("log odds that the cell is occupied")
    axis.legend(loc="upper left")
    return figure


def trust() -> Figure:
    """Two sensors' health from whether their readings fit, when sensors may fail and be mended."""
    rng = np.random.default_rng(2)
    rate, seconds = 5, 60
    broken = (20.0, 40.0)
    belief = BinaryBayesFilter(0.95, shape=(2,))
    rows = []
    for time in np.arange(0, seconds, 1 / rate):
        fails = broken[0] <= time < broken[1]
        fits = rng.random(2) < np.array([0.15 if fails else 0.95, 0.95])
        belief.predict(1e-3 / rate, 0.02 / rate)
        belief.update_forward(np.where(fits, 0.95, 0.05), np.where(fits, 0.3, 0.7))
        rows.append((time, *belief.belief))
    time, first, second = np.array(rows).T
    figure, axis = plt.subplots(figsize=(6.8, 2.8), layout="constrained")
    axis.axvspan(*broken, color=ORANGE, alpha=0.2, linewidth=0, label="the first one is broken")
    axis.step(time, first, where="post", color=BLUE, label="first sensor")
    axis.step(time, second, where="post", color=GREY, linestyle="--", label="second sensor")
    axis.set_ylim(-0.02, 1.02)
    axis.set_xlim(0, seconds)
    axis.set_xlabel("time, s (five readings a second)")
    axis.set_ylabel("probability of being sound")
    axis.legend(loc="lower right", ncols=3, bbox_to_anchor=(1.0, 1.0))
    return figure


FIGURES = {"liar": liar, "trust": trust}
