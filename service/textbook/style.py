"""How the pictures look: colours that the colour-blind tell apart, labelled axes, and the same bytes every time."""

from __future__ import annotations

import re
from collections.abc import Generator
from contextlib import contextmanager
from io import StringIO
from pathlib import Path
from typing import Any, cast

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

BLUE, RED, GREY, GREEN, ORANGE, PALE = "#2166ac", "#b2182b", "#666666", "#1b7837", "#d95f02", "#d9d9d9"
CHI_SQUARE_95 = 5.991
"""Squared radius of the ellipse that holds 95 % of a Gaussian of two dimensions."""

_PLACES = re.compile(r' (?:d|x|y)="[^"]*"|translate\([^)]*\)')
_LONG_NUMBER = re.compile(r"(\d\.\d\d)\d+")

LOOK: dict[str, Any] = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "axes.axisbelow": True,
    "legend.frameon": False,
    "svg.hashsalt": "beliefd",
}
"""What every picture of the project has in common, as matplotlib's settings."""

_STYLE = LOOK | {"axes.titlesize": 9, "legend.fontsize": 8, "savefig.dpi": 100}


@contextmanager
def styled() -> Generator[None]:
    """Draw and save in this style, and leave matplotlib's own settings as they were."""
    with mpl.rc_context(cast(Any, _STYLE)):
        yield


def sheet(width: float, height: float) -> Figure:
    """Make an empty picture, inches."""
    return Figure(figsize=(width, height), layout="constrained")


def panels(figure: Any, rows: int, columns: int, **options: Any) -> list[Axes]:
    """Divide a picture, or a part of one, into panels; row by row."""
    grid: NDArray[np.object_] = figure.subplots(rows, columns, squeeze=False, **options)
    return cast(list[Axes], grid.ravel().tolist())


def label(axis: Axes, title: str, x: str, y: str) -> None:
    """Say what a panel shows, and name its axes with their units."""
    axis.set_title(title)
    axis.set_xlabel(x)
    axis.set_ylabel(y)


def ellipse(
    mean: ArrayLike, covariance: ArrayLike, square: float = CHI_SQUARE_95
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the outline, x and y, where a Gaussian's squared Mahalanobis distance is ``square``."""
    values, vectors = np.linalg.eigh(np.asarray(covariance, np.float64))
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    circle = np.array([np.cos(angle), np.sin(angle)])
    outline = np.asarray(mean, np.float64)[:, None] + np.sqrt(square) * vectors @ (
        np.sqrt(np.maximum(values, 0.0))[:, None] * circle
    )
    return outline[0], outline[1]


def steps(axis: Axes, edges: ArrayLike, heights: ArrayLike, colour: str, name: str) -> None:
    """Draw a density that is constant in cells."""
    axis.stairs(np.asarray(heights), np.asarray(edges), fill=True, color=colour, alpha=0.3, label=name)
    axis.stairs(np.asarray(heights), np.asarray(edges), color=colour, linewidth=1.0)


def cloud(axis: Axes, x: ArrayLike, y: ArrayLike, weights: ArrayLike, colour: str, size: float = 4.0) -> None:
    """Draw particles, each as opaque as its weight, 0 to 1; as pixels, for there are many."""
    points = (np.asarray(x, np.float64), np.asarray(y, np.float64))
    opacity = cast(Any, np.broadcast_to(np.asarray(weights, np.float64), points[0].shape))
    axis.scatter(*points, s=size, color=colour, alpha=opacity, linewidths=0, rasterized=True)


def rug(axis: Axes, values: ArrayLike, ends: tuple[float, float], *, upright: bool = True) -> None:
    """Draw a tick for every particle, between two ends across; as one line, for there are many."""
    along = np.repeat(np.asarray(values, np.float64), 3)
    across = np.tile((*ends, np.nan), along.size // 3)
    axis.plot(*((along, across) if upright else (across, along)), color=BLUE, linewidth=0.5, alpha=0.6)


def compact(picture: str) -> str:
    """Round an SVG's places to hundredths of a point and drop its indentation: smaller, and nothing to see of it."""
    rounded = _PLACES.sub(lambda places: _LONG_NUMBER.sub(r"\1", places[0]), picture)
    return re.sub(r"\n +", "\n", rounded)


def save(figure: Figure, path: Path) -> None:
    """Write an SVG without a date: the same picture has the same bytes."""
    text = StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    path.write_text(compact(text.getvalue()), encoding="utf-8")
