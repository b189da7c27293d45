"""The figures of kld.md, drawn from the project's own code: python docs/figures.py kld."""

from __future__ import annotations

import math

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from filters.kld import Demand, bound
from service.textbook.style import BLUE, GREEN, GREY, ORANGE


def asked() -> Figure:
    """The bound against occupied bins."""
    figure, axis = plt.subplots(figsize=(6.0, 3.3), layout="constrained")
    bins = np.unique(np.geomspace(2, 3000, 120).astype(int))
    for error, colour, line in ((0.01, BLUE, "-"), (0.02, GREEN, "--"), (0.05, ORANGE, "-.")):
        needed = [bound(int(k), error, 0.99) for k in bins]
        axis.loglog(bins, needed, color=colour, linestyle=line, label=f"error {error:g} nat")
    axis.set_xlabel("occupied bins k")
    axis.set_ylabel("particles n (probability 0.99)")
    axis.legend()
    return figure


class Cloud:
    """Weighted particles, without a filter."""

    def __init__(self, sigma: float, count: int) -> None:
        rng = np.random.default_rng(3)
        self.count = count
        self.columns = np.stack(
            [rng.normal(0, sigma, count), rng.normal(0, sigma, count), np.zeros(count)]
        ).astype(np.float32)
        self.weights = rng.exponential(size=count).astype(np.float32)


def draws() -> Figure:
    """Fox's loop for beliefs of different widths: what the bins touched so far ask for, against the draws made."""
    figure, axis = plt.subplots(figsize=(6.0, 3.6), layout="constrained")
    golden = (math.sqrt(5.0) - 1.0) / 2.0
    for sigma, colour in ((0.5, BLUE), (1.0, GREEN), (2.0, ORANGE)):
        cloud = Cloud(sigma, 30_000)
        taken = Demand(0.5, 7.0, error=0.05, minimum=50).draws(cloud, 0.4)
        cumulative = np.cumsum(cloud.weights, dtype=np.float64)
        places = (0.4 + golden * np.arange(taken)) % 1.0 * cumulative[-1]
        chosen = np.searchsorted(cumulative, places, side="right")
        bins: set[tuple[int, int]] = set()
        needed = []
        for north, east in np.floor(cloud.columns[:2, chosen] / 0.5).T.astype(int).tolist():
            bins.add((north, east))
            needed.append(bound(len(bins), 0.05, 0.99, 50))
        label = f"sigma {sigma:g} m: {taken} draws, {len(bins)} bins"
        axis.plot(np.arange(1, taken + 1), needed, color=colour, label=label)
        axis.plot(taken, taken, "o", color=colour, markersize=5)
    end = axis.get_xlim()[1]
    axis.plot([0, end], [0, end], color=GREY, linestyle="--", linewidth=1, label="as many as asked for")
    axis.set_xlim(0, end)
    axis.set_ylim(0, end)
    axis.set_xlabel("draws made")
    axis.set_ylabel("particles that the bins touched ask for")
    axis.legend(loc="lower right")
    return figure


FIGURES = {"bound": asked, "draws": draws}
STYLE = {"savefig.dpi": 130}
