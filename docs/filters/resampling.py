"""The figures of resampling.md, drawn from the project's own code: python docs/figures.py resampling."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from filters.resampling import SCHEMES, ByHypothesis
from service.textbook.style import BLUE, GREEN, GREY, ORANGE, RED

COLOURS = {"multinomial": RED, "residual": ORANGE, "stratified": GREEN, "systematic": BLUE}
LINES = {"multinomial": "-", "residual": "--", "stratified": "-.", "systematic": "-"}


def variance() -> Figure:
    """How far a source's copies stray from their expectation, by scheme: measured over 4,000 runs."""
    rng = np.random.default_rng(1)
    weights = np.sort(rng.uniform(0.0, 3.0, 200)).astype(np.float32)
    expected = 200 * weights / weights.sum()
    shuffled = rng.permutation(200)
    figure, axis = plt.subplots(figsize=(6.8, 3.6), layout="constrained")
    for name, scheme in SCHEMES.items():
        copies = np.array(
            [
                np.bincount(scheme(weights[shuffled], 200, 1.0 - rng.random()), minlength=200)
                for _ in range(4000)
            ]
        )
        sigma = np.zeros(200)
        sigma[shuffled] = copies.std(axis=0)
        axis.plot(expected, sigma, color=COLOURS[name], linestyle=LINES[name], linewidth=1.3, label=name)
    axis.set_xlabel("expected copies N·w of a source")
    axis.set_ylabel("standard deviation of its copies")
    axis.set_ylim(0, None)
    axis.set_xlim(0, expected[-1])
    axis.legend(loc="upper left", ncols=2)
    return figure


def hypotheses() -> Figure:
    """Two hypotheses that are equally likely, resampled again and again: the share of the first."""
    count, rounds = 400, 300
    figure, axes = plt.subplots(1, 3, figsize=(8.6, 2.9), sharey=True, layout="constrained")
    for axis, name in zip(axes, ("multinomial", "systematic", "by hypothesis"), strict=True):
        rng = np.random.default_rng(2)
        for _ in range(12):
            labels = np.arange(count) % 2
            shares = [0.5]
            for _ in range(rounds):
                likelihood = rng.exponential(size=count).astype(np.float32)
                for label in (0, 1):  # the measurement says nothing about which of the two it is
                    likelihood[labels == label] /= likelihood[labels == label].mean()
                scheme = ByHypothesis(labels) if name == "by hypothesis" else SCHEMES[name]
                labels = rng.permutation(labels[scheme(likelihood, count, 1.0 - rng.random())])
                shares.append(float((labels == 0).mean()))
                if shares[-1] in (0.0, 1.0):
                    break
            axis.plot(shares, color=BLUE if name == "by hypothesis" else GREY, linewidth=0.8, alpha=0.8)
        axis.set_title(name, fontsize=9)
        axis.set_xlabel("resamplings")
        axis.set_xlim(0, rounds)
    axes[0].set_ylabel("share of the first hypothesis")
    axes[0].set_ylim(-0.02, 1.02)
    return figure


FIGURES = {"variance": variance, "hypotheses": hypotheses}
STYLE = {"savefig.dpi": 130}
