"""Weighted particles in columns, and what they say: moments, evidence, a cloud.

The lowest layer of :class:`filters.particle.ParticleFilter`; nothing here moves, weighs or draws a particle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from filters.belief import STILL, Displacement, Joint, Moments
from filters.crew import ALIGNMENT, Blocks, Crew
from filters.kernels import weights
from filters.kernels.compile import Float32Array
from filters.kernels.covariance import covariance
from filters.kernels.resampling import level
from filters.particle_checks import check_shape
from filters.particle_moments import MomentSums
from filters.particle_set import ParticleSet
from filters.rejuvenation import power

EVIDENCE_SAMPLE = 2048
"""Most particles that the evidence of a measurement is taken over."""

TOGETHER = 16
"""Most measurements that one call weighs by."""


class ParticleBelief:
    """A belief as weighted particles in float32 columns, allocated once.

    Parameters
    ----------
    names : tuple of str
        The dimensions, north, east and heading first.
    capacity : int
        The largest number of particles there can ever be.
    block : int
        Most particles of a block.
    crew : Crew, optional
        Threads that help.

    Raises
    ------
    ValueError
        A capacity or block below 1, a name that occurs twice, or columns that do not start with the pose.
    """

    def __init__(self, names: tuple[str, ...], capacity: int, block: int, crew: Crew | None) -> None:
        check_shape(names, capacity, block)
        self.names = names
        self.capacity = capacity
        self.collapses = 0
        """How often every weight was zero and the set was kept with equal weights."""
        self.tempered = 0
        """How often the weights were raised to a power below one."""
        self._particles = ParticleSet(names, capacity)
        self._weights: Float32Array = np.zeros(capacity, np.float32)
        self._centre = ParticleSet(names, 1)
        self._centre.count = 1
        self._centre_values: dict[str, float] = {}
        self._blocks = Blocks(block, crew)
        most_blocks = self._blocks.most(capacity)
        self._sums = np.zeros((most_blocks, 2))
        self._moment_sums = MomentSums(self._particles, self._weights, self._centre, most_blocks)
        self._samples: Float32Array = np.zeros((TOGETHER, min(EVIDENCE_SAMPLE, capacity)), np.float32)
        self._sampled = 0
        self._stride = 1
        self._log_sum_of = weights.log_sum.direct  # often called, so worth looking up once
        self._normalize = weights.normalize.direct
        self._log_sum = 0.0
        self._total = self._squares = 0.0
        self._top: float | None = None  # the largest log weight, where somebody has just seen it
        self._weighed = False

    @property
    def count(self) -> int:
        """How many particles there are; 0 before :meth:`initialize`."""
        return self._particles.count

    @property
    def effective_sample_size(self) -> float:
        """1 / Σ w², the inverse of the variance that equation 4.36's weights have gathered."""
        if self._weighed:
            self.normalize()
        return self._total * self._total / self._squares

    def column(self, name: str) -> Float32Array:
        """View of one dimension, (count,) float32; valid until the next :meth:`resample`.

        Raises
        ------
        KeyError
            There is no dimension of that name.
        """
        return self._particles.columns[self._particles.row(name), : self.count]

    @property
    def columns(self) -> Float32Array:
        """View of all dimensions, (dimension, capacity) float32; the first ``count`` are particles."""
        return self._particles.columns

    @property
    def particles(self) -> ParticleSet:
        """The set as motion and sensor models see it; for those who time them by themselves."""
        return self._particles

    @property
    def blocks(self) -> list[tuple[int, int]]:
        """First and last of the blocks that the particles are divided into."""
        return self._blocks.pairs

    @property
    def weights(self) -> Float32Array:
        """View of the weights, (count,) float32, relative to the largest."""
        self._settle()
        return self._weights[: self.count]

    def normalize(self) -> None:
        """Line 6: make weights of the log weights.

        If every weight is zero (no particle can explain what was measured), the set is kept with equal
        weights and ``collapses`` counts it; the evidence of the measurement that did it is minus infinity or
        close to it.
        """
        if self._blocks.shared or (self._top is not None and self._blocks.number > 1):
            top, total, squares = self._normalize_by_parts()
        else:
            top, total, squares = self._normalize(
                self._particles.log_weights, self._weights, self._blocks.bounds, self._sums
            )
        self._top = None
        if not total > 0.0:
            self.collapses += 1
            self._level()
            return
        self._total, self._squares = total, squares
        self._log_sum -= top
        self._weighed = False

    def _normalize_by_parts(self) -> tuple[float, float, float]:
        log_weights, bounds, sums = self._particles.log_weights, self._blocks.bounds, self._sums

        def exponentiate(part: int, first: int, last: int) -> None:
            weights.exponentiate.direct(log_weights, self._weights, bounds, first, last, top, sums)

        top = self._share_finding_top() if self._top is None else self._top
        if not weights.NOTHING < top < math.inf:
            return top, 0.0, 0.0
        self._blocks.share(exponentiate)
        return top, *weights.add(sums, self._blocks.number)

    def _share_finding_top(self) -> float:
        tops = [-math.inf] * self._blocks.threads

        def find(part: int, first: int, last: int) -> None:
            tops[part] = weights.peak.direct(self._particles.log_weights, first, last)

        self._blocks.split(self.count, ALIGNMENT, find)
        return max(tops)

    def moments(self, displacement: Displacement | None = None) -> Moments:
        """Weighted mean and covariance, of the particles displaced each along its own heading.

        The heading's mean is circular; the covariance is about that mean, with wrapped differences. The
        variance of a marginalised column is the spread of the particles' means and what their paths leave open.
        The centre that innovations are measured from becomes the mean found here.
        """
        self._settle()
        self._centre_values.clear()
        return self._moment_sums.moments(
            STILL if displacement is None else displacement,
            self._blocks,
            self._given_path(),
            self._total * self._total / self._squares,
        )

    def glance(self) -> Moments:
        """Moments as :meth:`moments` finds them, for whoever only looks on: the centre stays where it was.

        So the belief goes on to the very bytes to which it would have gone on unobserved.
        """
        centre, values = self._centre.columns.copy(), self._centre_values.copy()
        found = self.moments()
        self._centre.columns[:] = centre
        self._centre_values.update(values)
        return found

    def joint(self, names: Sequence[str]) -> Joint:
        """Weighted mean and covariance of some columns together; a heading among them is taken as a mere number.

        The variance of a marginalised column is the spread of the particles' means and what their paths leave open.

        Raises
        ------
        KeyError
            There is no dimension of one of the names.
        """
        self._settle()
        rows = np.array([self._particles.row(name) for name in names], np.int64)
        reference = self._centre.columns[rows, 0].astype(np.float64)
        found = Joint(tuple(names), np.zeros(rows.size), np.zeros((rows.size, rows.size)))
        columns, weights = self._particles.columns, self._weights
        covariance.direct(columns, weights, self.count, rows, reference, found.mean, found.covariance)
        given_path = self._given_path()
        for place, name in enumerate(names):
            found.covariance[place, place] += given_path.get(name, 0.0)
        return found

    def temper(self, share: float) -> float:
        """Raise the weights to the largest power at most 1 that leaves a share of the particles effective.

        What the measurements said is believed less, so that a belief outlives one that is far sharper than it; see
        :mod:`filters.rejuvenation`. Nothing happens where enough are effective. ``tempered`` counts the others.

        Parameters
        ----------
        share : float
            The effective sample size over the count, in (0, 1].

        Returns
        -------
        float
            The power.

        Raises
        ------
        ValueError
            A share outside (0, 1].
        """
        self._settle()
        log_weights = self._particles.log_weights
        exponent = power(log_weights[: self.count], share)
        if exponent < 1.0:
            self.tempered += 1
            log_weights[: self.count] *= np.float32(exponent)
            self._top = None
            self._log_sum = self._log_sum_of(log_weights, self._sampled, self._stride, self._samples[0])
            self.normalize()
        return exponent

    def cloud(
        self, count: int, displacement: Displacement | None = None, out: Float32Array | None = None
    ) -> Float32Array:
        """Particles evenly spaced among all, displaced: a fair sub-sample for those who look.

        Returns
        -------
        (min(count, self.count), 4) float32
            North, east, heading and weight; the weights of all particles would sum to one over the share
            shown. It is a view of ``out``, (>= count, 4), if that was given.

        Raises
        ------
        ValueError
            ``out`` has too few rows.
        """
        self._settle()
        rows = min(count, self.count)
        if out is None:
            out = np.empty((rows, 4), np.float32)
        if len(out) < rows:
            raise ValueError(f"cloud: out has {len(out)} rows, {rows} are needed")
        if rows > 0:
            scale = self.count / (rows * self._total)
            shift = STILL if displacement is None else displacement
            weights.displace(self._particles.columns, self._weights, self.count, scale, *shift, out[:rows])
        return out[:rows]

    def _given_path(self) -> Mapping[str, float]:
        """Variance, given a particle's path, of each marginalised column."""
        return self._particles.variances

    def _settle(self) -> None:
        if self._weighed:
            self.normalize()

    def _level(self) -> None:
        """Make all weights equal."""
        self._blocks.split(self.count, ALIGNMENT, self._level_part)
        self._forget_sums()

    def _level_part(self, _part: int, first: int, last: int) -> None:
        level.direct(self._weights, self._particles.log_weights, first, last)

    def _forget_sums(self) -> None:
        """Set the sums of weights that are all one."""
        self._total = self._squares = float(self.count)
        self._log_sum = math.log(self._sampled)
        self._top = None
        self._weighed = False

    def _recount(self, count: int) -> None:
        """Divide the particles into blocks of equal size, and choose the ones that evidence is taken over."""
        if count == self.count:
            return
        self._particles.count = count
        self._stride = -(-count // EVIDENCE_SAMPLE)
        self._sampled = count // self._stride
        self._blocks.divide(count)

    def _centre_state(self) -> dict[str, float]:
        """Centre of the belief by name."""
        if not self._centre_values:
            self._centre_values = dict(zip(self.names, self._centre.columns[:, 0].tolist(), strict=True))
        return self._centre_values
