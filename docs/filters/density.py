"""The figures of density.md, drawn from the project's own code: python docs/figures.py density."""

from __future__ import annotations

import math

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse
from numpy.typing import NDArray

from filters.density.binned import BinnedKernels
from filters.density.k_means import KMeans
from filters.density.kernel import Kernels
from filters.density.normal import gaussian
from service.textbook.style import BLUE, GREEN, GREY, ORANGE, RED


def two_places() -> NDArray[np.float64]:
    """Draw north, east, heading of a vehicle that has heard two beacons: a place and its mirror image."""
    rng = np.random.default_rng(11)
    true = rng.multivariate_normal([8.0, 14.0, 0.7], np.diag([1.0, 6.0, 0.02]), 2600)
    mirrored = rng.multivariate_normal([-8.0, 14.0, -0.7], np.diag([1.0, 6.0, 0.02]), 1400)
    return np.concatenate([true, mirrored])


def ellipse(axis: Axes, mean: NDArray[np.float64], covariance: NDArray[np.float64], colour: str) -> None:
    """Draw the ellipse that holds 95 % of a Gaussian of north and east, and where the heading points."""
    values, vectors = np.linalg.eigh(covariance[:2, :2])
    reach = 2.0 * np.sqrt(-2.0 * math.log(0.05) * values)
    angle = math.degrees(math.atan2(vectors[0, 1], vectors[1, 1]))
    axis.add_patch(
        Ellipse((mean[1], mean[0]), reach[1], reach[0], angle=angle, fill=False, color=colour, linewidth=1.6)
    )
    axis.plot(mean[1], mean[0], "+", color=colour, markersize=9, markeredgewidth=1.6)
    axis.arrow(
        mean[1],
        mean[0],
        4.0 * math.sin(mean[2]),
        4.0 * math.cos(mean[2]),
        color=colour,
        head_width=0.7,
        width=0.06,
    )


def hypotheses() -> Figure:
    """A mirrored belief as one Gaussian and as a mixture."""
    points, circular = two_places(), [False, False, True]
    figure, axes = plt.subplots(1, 2, figsize=(8.0, 4.3), sharex=True, sharey=True, layout="constrained")
    for axis in axes:
        axis.scatter(
            points[::2, 1], points[::2, 0], s=3, color=BLUE, alpha=0.25, linewidths=0, rasterized=True
        )
        axis.plot([-4.0, 30.0], [0.0, 0.0], "^", color="black", markersize=7)
        axis.set_xlabel("east, m")
        axis.set_aspect("equal")
        axis.set_xlim(-8.0, 34.0)
        axis.set_ylim(-22.0, 22.0)
    one = gaussian(points, None, circular)
    ellipse(axes[0], one.mean, one.covariance, RED)
    axes[0].set_title("one Gaussian", fontsize=9)
    mixture = KMeans()(points, None, circular)
    for weight, mean, covariance in zip(mixture.weights, mixture.means, mixture.covariances, strict=True):
        ellipse(axes[1], mean, covariance, ORANGE)
        axes[1].text(mean[1] + 6.0, mean[0] + 1.5, f"{weight:.2f}", color=ORANGE)
    axes[1].set_title("k-means mixture, k by evidence", fontsize=9)
    axes[0].set_ylabel("north, m")
    return figure


def fast() -> Figure:
    """Binned against exact kernel density."""
    rng = np.random.default_rng(12)
    points = np.concatenate([rng.normal(0.0, 1.0, 3000), rng.normal(4.0, 0.5, 2000)])[:, None]
    width = [0.15]
    exact, binned = Kernels(width)(points), BinnedKernels(width)(points)
    x = np.linspace(-4.0, 6.5, 1401)
    truth = exact.evaluate(x[:, None])
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(6.8, 4.2), sharex=True, layout="constrained", height_ratios=(3, 2)
    )
    above.plot(x, truth, color=GREY, linewidth=3.0, alpha=0.5, label="sum over 5,000 particles")
    above.plot(
        x, binned.evaluate(x[:, None]), color=BLUE, linewidth=1.1, label=f"{binned.shape[0]} nodes and FFT"
    )
    above.set_ylabel("density, 1/m")
    above.legend(loc="upper left")
    for fineness, colour in ((2.0, ORANGE), (4.0, BLUE), (8.0, GREEN)):
        density = BinnedKernels(width, fineness=fineness)(points)
        error = np.abs(density.evaluate(x[:, None]) - truth) / truth.max()
        below.semilogy(x, np.maximum(error, 1e-9), color=colour, linewidth=0.8, label=f"{fineness:g} nodes")
    below.set_ylim(1e-7, 1e-1)
    below.set_ylabel("error / highest density")
    below.set_xlabel("state, m (bandwidth 0.15 m)")
    below.legend(loc="upper right", ncols=3, title="a bandwidth", title_fontsize=8, fontsize=8)
    return figure


FIGURES = {"hypotheses": hypotheses, "fast": fast}
