"""The answer to ``@rpc/density``: a density of the last particle cloud, made in one of five ways (section 4.3.4).

Whoever asks chooses the extractor: ``gaussian`` and ``kmeans`` are densities of north, east and heading; ``histogram``,
``tree`` and ``kernel`` of north and east, as one would draw them. It is made in a process of its own
(:mod:`service.publish.extraction`), because it may take a second, with everything that must be loaded for it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import msgspec
import numpy as np
from numpy.typing import NDArray

from filters.density.histogram import Histograms
from filters.density.k_means import KMeans
from filters.density.kernel import Kernels
from filters.density.normal import gaussian
from filters.density.protocol import DensityMoments
from filters.density.tree import Trees
from service.estimate import Cell, Component, Density

Rows = NDArray[np.float64]

POSE = ("north", "east", "heading")
PLANE = ("north", "east")
SIDE = 64
"""Cells along each side of the grid that a kernel density is told on."""
REACH = 3.0
"""Bandwidths that this grid goes beyond the outermost particles."""
LEAST = 1e-9
"""Mass of a cell that is not worth telling."""


def extract(extractor: str, rows: Rows, time: float) -> Density:
    """Make a density of a cloud.

    Parameters
    ----------
    extractor : str
        One of :data:`EXTRACTORS`.
    rows : (count, 4) float64
        North, east, heading, weight.
    time : float
        Of the cloud, Unix seconds.

    Raises
    ------
    KeyError
        There is no such extractor.
    ValueError
        A cloud from which it cannot make a density.
    """
    return EXTRACTORS[extractor](rows, time)


def _gaussian(rows: Rows, time: float) -> Density:
    moments = gaussian(rows[:, :3], rows[:, 3], (False, False, True)).moments()
    return _density("gaussian", rows, time, POSE, moments)


def _k_means(rows: Rows, time: float) -> Density:
    mixture = KMeans()(rows[:, :3], rows[:, 3], (False, False, True))
    components = [
        Component(weight, each.mean.tolist(), each.covariance.tolist())
        for weight, each in zip(mixture.weights.tolist(), mixture.components, strict=True)
    ]
    found = _density("kmeans", rows, time, POSE, mixture.moments())
    return msgspec.structs.replace(found, components=components)


def _histogram(rows: Rows, time: float) -> Density:
    histogram = Histograms()(rows[:, :2], rows[:, 3])
    masses = histogram.belief
    there = np.argwhere(masses > 0.0)
    low = np.array([axis.low for axis in histogram.grid.axes]) + there * histogram.grid.widths
    cells = _cells(low, low + histogram.grid.widths, masses[there[:, 0], there[:, 1]])
    found = _density("histogram", rows, time, PLANE, histogram.moments())
    return msgspec.structs.replace(found, cells=cells)


def _tree(rows: Rows, time: float) -> Density:
    tree = Trees()(rows[:, :2], rows[:, 3])
    found = _density("tree", rows, time, PLANE, tree.moments())
    return msgspec.structs.replace(found, cells=_cells(*tree.leaf_boxes))


def _kernel(rows: Rows, time: float) -> Density:
    density = Kernels()(rows[:, :2], rows[:, 3])
    reach = REACH * density.bandwidth
    low = rows[:, :2].min(axis=0) - reach
    width = (rows[:, :2].max(axis=0) + reach - low) / SIDE
    corners = low + np.argwhere(np.ones((SIDE, SIDE), np.bool_)) * width
    masses = density.evaluate(corners + 0.5 * width) * float(width.prod())
    found = _density("kernel", rows, time, PLANE, density.moments())
    cells = _cells(corners, corners + width, masses)
    return msgspec.structs.replace(found, cells=cells, bandwidth=density.bandwidth.tolist())


def _density(
    extractor: str, rows: Rows, time: float, columns: tuple[str, ...], moments: DensityMoments
) -> Density:
    return Density(
        extractor=extractor,
        time=time,
        particles=len(rows),
        columns=list(columns),
        mean=moments.mean.tolist(),
        covariance=moments.covariance.tolist(),
    )


def _cells(low: Rows, high: Rows, masses: Rows) -> list[Cell]:
    """Return the boxes that hold anything worth telling."""
    told = masses > LEAST
    table = np.column_stack([low[told], high[told], masses[told]]).tolist()
    return [Cell((low_n, high_n), (low_e, high_e), mass) for low_n, low_e, high_n, high_e, mass in table]


EXTRACTORS: Mapping[str, Callable[[Rows, float], Density]] = MappingProxyType(
    {
        "gaussian": _gaussian,
        "kmeans": _k_means,
        "histogram": _histogram,
        "tree": _tree,
        "kernel": _kernel,
    }
)
"""What makes a density, by the name that is asked for."""
