"""Kernel density of many particles, fast: linear binning on a fine grid, then one convolution by FFT.

Silverman, "Kernel density estimation using the fast Fourier transform", Applied Statistics 31(1), 1982; linear
binning: Wand, "Fast computation of multivariate kernel estimators", JCGS 3(4), 1994. Dealing a particle's weight
to the grid's nodes blurs it by a triangle of variance step²/6, and interpolating between nodes blurs it once
more; the kernel is narrowed by both, so what remains of the error is of fourth order in step / bandwidth. A
dimension that wraps is a circle to the Fourier transform anyway; the others are padded.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.density import circular as angles
from filters.density.kernel import Rule, chosen_bandwidth, silverman
from filters.density.protocol import Array, DensityMoments
from filters.density.weighted import Weighted, asked, weighted
from filters.grid import box_moments

Places = NDArray[np.int64]

PAD = 7.0
"""Bandwidths of empty grid beyond the outermost particles; farther out the density counts as zero."""
MOST_NODES = 1 << 25


class BinnedKernelDensity:
    """The kernel density at the nodes of a grid, linear between them; a density in its own right.

    Parameters
    ----------
    particles : Weighted
    bandwidth : (d,) array
        Standard deviation of the kernel in each dimension, positive.
    fineness : float
        Nodes per bandwidth, at least 2. Four err by a few 1e-4 of the highest density.

    Raises
    ------
    ValueError
        A fineness below 2, or more nodes than fit.
    """

    def __init__(self, particles: Weighted, bandwidth: Array, fineness: float = 4.0) -> None:
        if not 2.0 <= fineness < math.inf:
            raise ValueError(f"binned kernel density: fineness must be at least 2 nodes, got {fineness}")
        self.bandwidth = bandwidth
        self.circular = particles.circular
        low = particles.points.min(axis=0) - PAD * bandwidth
        high = particles.points.max(axis=0) + PAD * bandwidth
        low, high = np.where(self.circular, -math.pi, low), np.where(self.circular, math.pi, high)
        cells = np.ceil((high - low) / bandwidth * fineness)
        if not float(cells.prod()) <= MOST_NODES:
            raise ValueError(
                f"binned kernel density: {cells.prod():.3g} nodes are more than {MOST_NODES}; sum exactly, or give "
                "a larger bandwidth"
            )
        self.shape = tuple(_smooth(max(int(count), 4)) for count in cells)
        self._low: Array = low
        self._step: Array = (high - low) / self.shape
        self._strides: Places = np.array(
            [math.prod(self.shape[j + 1 :]) for j in range(len(self.shape))], np.int64
        )
        size = math.prod(self.shape)
        masses = np.zeros(size)
        for nodes, share in self._corners(particles.points):
            masses += np.bincount(nodes, particles.weights * share, size)
        masses = np.maximum(self._convolved(masses.reshape(self.shape)), 0.0).reshape(-1)
        self.masses: Array = masses / masses.sum()
        """Probability that each node stands for, flat."""

    def evaluate(self, points: ArrayLike) -> Array:
        """Return the density at points; see :class:`filters.density.protocol.Density`."""
        given = angles.wrap_columns(asked("binned kernel density", points, self._low.size), self.circular)
        last = self._low + self._step * (np.array(self.shape) - 1)
        within = np.asarray((given >= self._low) & (given <= last), np.bool_)
        inside = np.asarray(np.logical_or(within, self.circular), np.bool_).all(axis=1)
        inside = np.asarray(inside, np.bool_)
        given = np.where(inside[:, None], given, self._low)
        total = np.zeros(len(given))
        for nodes, share in self._corners(given):
            total += share * self.masses[nodes]
        return np.where(inside, total / float(self._step.prod()), 0.0)

    def draw(self, count: int, generator: np.random.Generator) -> Array:
        """Draw points: a node by its probability, then from the triangle about it."""
        cumulative: Array = self.masses.cumsum()
        chosen = np.searchsorted(cumulative, generator.random(count) * float(cumulative[-1]), side="right")
        places = np.column_stack(np.unravel_index(chosen, self.shape))
        within = generator.random((count, 2, self._low.size)).sum(axis=1) - 1.0
        return angles.wrap_columns(self._low + (places + within) * self._step, self.circular)

    def moments(self) -> DensityMoments:
        """Return mean and covariance, exact but for the nodes next to the far side of a circle."""
        places = np.unravel_index(np.arange(self.masses.size), self.shape)
        centres = [low + step * place for low, step, place in zip(self._low, self._step, places, strict=True)]
        # a triangle two steps wide has the variance of a box √2 steps wide
        widths = [np.broadcast_to(math.sqrt(2.0) * step, self.masses.shape) for step in self._step]
        mean, covariance = box_moments(
            centres, widths, self.masses, np.where(self.circular, angles.TURN, math.inf)
        )
        return DensityMoments(angles.wrap_columns(mean, self.circular), covariance)

    def _corners(self, points: Array) -> Iterator[tuple[Places, Array]]:
        """Yield the flat index of each node about the points, and its share of them."""
        place = (points - self._low) / self._step
        below = np.floor(place)
        part = place - below
        lower = below.astype(np.int64)
        for corner in itertools.product((0, 1), repeat=self._low.size):
            upper = np.array(corner)
            nodes = ((lower + upper) % np.array(self.shape)) @ self._strides
            yield nodes, np.where(upper == 1, part, 1.0 - part).prod(axis=1)

    def _convolved(self, masses: Array) -> Array:
        spectrum = np.fft.rfftn(masses)
        for j, (count, step, width) in enumerate(zip(self.shape, self._step, self.bandwidth, strict=True)):
            last = j == len(self.shape) - 1
            length = float(step)
            turns = np.asarray(
                np.fft.rfftfreq(count, length) if last else np.fft.fftfreq(count, length), np.float64
            )
            response = np.exp(-0.5 * np.square(angles.TURN * turns) * (width * width - step * step / 3.0))
            spectrum *= response.reshape([-1 if k == j else 1 for k in range(len(self.shape))])
        return np.fft.irfftn(spectrum, self.shape, axes=range(len(self.shape)))


class BinnedKernels:
    """The :class:`~filters.density.protocol.Extractor` of a binned kernel density.

    Parameters
    ----------
    bandwidth : (d,) array, optional
        By the rule if not given.
    rule : callable
        :func:`~filters.density.kernel.silverman` or :func:`~filters.density.kernel.scott`.
    fineness : float
        As of :class:`BinnedKernelDensity`.
    """

    def __init__(
        self, bandwidth: ArrayLike | None = None, rule: Rule = silverman, fineness: float = 4.0
    ) -> None:
        self._bandwidth = bandwidth
        self._rule = rule
        self._fineness = fineness

    def __call__(
        self, points: ArrayLike, weights: ArrayLike | None = None, circular: Sequence[bool] | None = None
    ) -> BinnedKernelDensity:
        """Extract a binned kernel density.

        Raises
        ------
        ValueError
            As the protocol says; bandwidths that are none, a dimension without spread for the rule, or a grid
            that is too large.
        """
        particles = weighted("kernel density extraction", points, weights, circular)
        width = chosen_bandwidth(particles, self._bandwidth, self._rule)
        return BinnedKernelDensity(particles, width, self._fineness)


def _smooth(count: int) -> int:
    """Return the next number without prime factors above 5: fast to transform."""
    while True:
        rest = count
        for prime in (2, 3, 5):
            while rest % prime == 0:
                rest //= prime
        if rest == 1:
            return count
        count += 1
