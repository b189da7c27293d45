"""How a particle set is drawn anew: lines 8 to 11 of Table 4.3, and what takes the place of particles beside that.

The middle layer of :class:`filters.particle.ParticleFilter`, over :class:`filters.particle_belief.ParticleBelief`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters import strata
from filters.apart import drawn_apart
from filters.crew import ALIGNMENT, Crew
from filters.kernels import random, resampling
from filters.kernels.compile import Float32Array, Int32Array
from filters.kernels.regularization import shrink
from filters.motion.slow import diffuse
from filters.particle_belief import ParticleBelief
from filters.particle_checks import check_injected, check_slow
from filters.regularization import Rule, root, weighted_covariance
from filters.rejuvenation import spread
from filters.resampling import Resampler, systematic

_RESAMPLING_STREAM = 1 << 32
_INJECTION_STREAM = 2 << 32
_KERNEL_STREAM = 3 << 32
_REJUVENATION_STREAM = 4 << 32
_APART_STREAM = 6 << 32

NOBODY = -1
"""Ancestor of a particle that was injected."""


class RedrawnBelief(ParticleBelief):
    """A belief whose particles can be drawn anew.

    Parameters
    ----------
    names, capacity, block, crew
        As in :class:`filters.particle_belief.ParticleBelief`.
    seed : int
        Of the random numbers.
    noises : int
        How many normals a particle needs at most, two at least.
    """

    def __init__(
        self,
        names: tuple[str, ...],
        capacity: int,
        seed: int,
        block: int,
        crew: Crew | None,
        noises: int,
    ) -> None:
        super().__init__(names, capacity, block, crew)
        self._seed = seed
        self._draws = 0
        self._spare: Float32Array = np.zeros_like(self._particles.columns)
        self._ancestors = np.zeros(capacity, np.int32)
        self._lineage: Int32Array | None = None
        self._noises: list[Float32Array] = [
            np.zeros((max(noises, 2), min(block + resampling.RUN, capacity)), np.float32)
            for _ in range(self._blocks.threads)
        ]
        self._masses = np.zeros(self._blocks.most(capacity))
        self._redraw_all = resampling.redraw.direct

    def follow(self, lineage: Int32Array) -> None:
        """Have ``lineage``, (capacity,) int32, laid out with the copies at every resampling, as a column would be."""
        if lineage.shape != (self.capacity,):
            raise ValueError(f"follow: {self.capacity} numbers are needed, got {lineage.shape}")
        self._lineage = lineage

    def resample(self, count: int | None = None, scheme: Resampler = systematic) -> None:
        """Lines 8 to 11: draw ``count`` particles, equally weighted; as many as now by default.

        The copies are dealt to the blocks in turn, so every block is a fair sample of the whole.

        Parameters
        ----------
        count : int, optional
            How many there will be.
        scheme : Resampler
            How they are drawn: Table 4.4, or another of :mod:`filters.resampling`.

        Raises
        ------
        ValueError
            A count below 1 or above the capacity, or what the scheme refuses; the set is as it was then.
        """
        self._settle()
        target = self.count if count is None else count
        if not 1 <= target <= self.capacity:
            raise ValueError(f"resample: count must lie in 1 to {self.capacity} (the capacity), got {target}")
        uniform = random.uniform(self._seed, _RESAMPLING_STREAM, self._draws + 1)
        sources, ancestors, source_bounds = self.count, self._ancestors[:target], self._blocks.bounds
        if scheme is not systematic:
            scheme(self._weights[:sources], target, uniform, ancestors)
        self._draws += 1
        self._recount(target)
        if scheme is systematic:  # whose checks these weights do not need
            self._redraw(source_bounds, ancestors, uniform)
        else:
            self._lay_out(ancestors)
            self._level()
        self._lay_out_lineage(sources, ancestors)

    def _redraw(self, source_bounds: NDArray[np.int64], ancestors: Int32Array, uniform: float) -> None:
        """Draw by Table 4.4 from the blocks that there were, and lay the copies out, all of one weight."""
        if self._blocks.shared:
            self._share_drawing(source_bounds, ancestors, uniform)
            self._lay_out(ancestors)
            self._level()
            return
        columns, spare, logs = self._particles.columns, self._spare, self._particles.log_weights
        bounds, masses = self._blocks.bounds, self._masses
        self._redraw_all(
            columns, spare, self._weights, logs, source_bounds, masses, ancestors, bounds, uniform
        )
        self._particles.columns, self._spare = spare, columns
        self._forget_sums()

    def _share_drawing(self, source_bounds: NDArray[np.int64], ancestors: Int32Array, uniform: float) -> None:
        given, masses, blocks = self._weights, self._masses, source_bounds.size - 1

        def add(part: int, first: int, last: int) -> None:
            resampling.totals.direct(given, source_bounds, first, last, masses)

        def draw(part: int, first: int, last: int) -> None:
            resampling.systematic_blocks.direct(given, source_bounds, first, last, masses, uniform, ancestors)

        self._blocks.split(blocks, 1, add)
        self._blocks.split(blocks, 1, draw)

    def resample_by_label(self, labels: Int32Array, quotas: NDArray[np.int64]) -> None:
        """Draw a given number of particles from those of each label, and lay the labels out with them.

        Stratified sampling with any allocation (section 4.3.4): within a label Table 4.4, and a particle then has its
        label's weight over its quota. So however few or many a label is given, its share of the belief stays exactly
        what it was; one with a quota of zero is gone.

        Parameters
        ----------
        labels : (capacity,) int32
            Of each particle, below the number of quotas; changed in place.
        quotas : (number of labels,) int64
            How many there will be of each.

        Raises
        ------
        ValueError
            Labels that are too few; quotas that are negative, sum to less than 1 or more than the capacity, or are not
            zero where a label has no weight. The set is as it was then.
        """
        self._settle()
        target = int(quotas.sum())
        if labels.shape != (self.capacity,) or not 1 <= target <= self.capacity:
            raise ValueError(
                f"resample: {self.capacity} labels and quotas that sum to 1 to {self.capacity} are needed, got "
                f"{labels.shape} and a sum of {target}"
            )
        uniform = random.uniform(self._seed, _RESAMPLING_STREAM, self._draws + 1)
        ancestors = self._ancestors[:target]
        before = labels[: self.count].copy()
        worth = strata.draw(self._weights[: self.count], before, quotas, uniform, ancestors)
        self._draws += 1
        self._lay_out(ancestors)
        self._lay_out_labels(before, labels, ancestors)
        self._lay_out_lineage(before.size, ancestors)
        self._level()
        log_weights = self._particles.log_weights
        log_weights[:target] = worth[labels[:target]]
        self._top = None
        self._log_sum = self._log_sum_of(log_weights, self._sampled, self._stride, self._samples[0])
        self.normalize()

    def draw_apart(self, labels: Int32Array, worths: Mapping[int, float], widest: float) -> None:
        """Draw the copies of every label apart, whose mean and covariance stay (:func:`~filters.apart.drawn_apart`).

        Every call uses new random numbers only after another resampling. Weights and lineages stay.

        Parameters
        ----------
        labels : (capacity,) int32
            Of each particle.
        worths : mapping of int to float
            Whose copies, and how many particles were effective among the label's before they were resampled.
        widest : float
            Metres; the standard deviation north or east up to which a label's are one place. Others stay.
        """
        columns, count = self._particles.columns, self.count
        rows = len(self.names)
        normals = np.empty((rows + rows % 2, count), np.float32)
        for row in range(0, rows, 2):
            key = random.key(self._seed, _APART_STREAM + row)
            random.normal_pairs.direct(0, count, self._draws & 0xFFFFFFFF, key, normals, row)
        for label, worth in worths.items():
            places = np.flatnonzero(labels[:count] == label)
            drawn = drawn_apart(columns[:rows, places], normals[:rows, places], max(1.0, worth), widest)
            if drawn is not None:
                columns[:rows, places] = drawn

    def _lay_out(self, ancestors: Int32Array) -> None:
        """Put the copies in the place of the particles."""
        self._recount(ancestors.size)
        columns, spare, blocks = self._particles.columns, self._spare, self._blocks

        def act(part: int, first: int, last: int) -> None:
            resampling.deal.direct(columns, spare, ancestors, blocks.bounds, first, last)

        blocks.split(-(-ancestors.size // resampling.RUN), ALIGNMENT, act)
        self._particles.columns, self._spare = spare, columns

    def _lay_out_lineage(self, sources: int, ancestors: Int32Array) -> None:
        if self._lineage is not None:
            self._lay_out_labels(self._lineage[:sources].copy(), self._lineage, ancestors)

    def _lay_out_labels(self, before: Int32Array, labels: Int32Array, ancestors: Int32Array) -> None:
        """Do the same with a whole number for each; copying looks at no bit, so they may pass for float32."""
        source, target = before.view(np.float32)[None], labels.view(np.float32)[None]
        runs = -(-ancestors.size // resampling.RUN)
        resampling.deal(source, target, ancestors, self._blocks.bounds, 0, runs)

    def inject(
        self, columns: Mapping[str, ArrayLike], count: int | None = None, scheme: Resampler = systematic
    ) -> None:
        """Resample, and put given particles in the place of some: the belief becomes a mixture of the two.

        Of ``count`` particles as many as were given are new, and the others a fair sample of the belief, all with the
        same weight: with k of n new ones, (1 - k / n) bel + (k / n) p, where p is what they were drawn from. Every
        place is as likely to be taken as any other.

        Parameters
        ----------
        columns : mapping of str to (k,) array
            Some dimensions by name. A dimension that is not given keeps the value of the particle in that place, so
            slow states outlive a jump of the pose.
        count : int, optional
            How many there will be, the given ones among them; as many as now by default.
        scheme : Resampler
            As in :meth:`resample`.

        Raises
        ------
        ValueError
            A dimension that is unknown, lengths that differ, a length of 0 or above ``count``, a value that is not
            finite, or a count that :meth:`resample` refuses; the set is as it was then.
        """
        given = {name: np.asarray(column, np.float64) for name, column in columns.items()}
        target = self.count if count is None else count
        injected = check_injected(given, self.names, target)
        if "heading" in given:
            given["heading"] = np.remainder(given["heading"] + math.pi, 2.0 * math.pi) - math.pi
        self.resample(target, scheme)
        offset = random.uniform(self._seed, _INJECTION_STREAM, self._draws)
        places = ((np.arange(injected) + offset) * (target / injected)).astype(np.int64)
        for name, column in given.items():
            self._particles.columns[self._particles.rows[name], places] = column
        if self._lineage is not None:
            self._lineage[places] = NOBODY

    def resample_regularized(
        self, names: Sequence[str], rule: Rule, count: int | None = None, scheme: Resampler = systematic
    ) -> None:
        """Resample, and draw some slow states anew from a kernel about each copy (:mod:`filters.regularization`).

        Parameters
        ----------
        names : sequence of str
            The slow states, spread together by their covariance before resampling.
        rule : Rule
            Which kernel: ``Preserving()`` keeps mean and covariance, ``Spreading()`` adds to the covariance.
        count, scheme
            As in :meth:`resample`.

        Raises
        ------
        ValueError
            No names or one twice, one of the pose, or one that the motion model marginalises (what is open of it is
            not in the column); or what :meth:`resample` refuses. The set is as it was then.
        KeyError
            There is no dimension of that name.
        """
        check_slow(names, self._given_path())
        rows = [self._particles.row(name) for name in names]
        mean, covariance = weighted_covariance(self._particles.columns[rows, : self.count], self.weights)
        factor, bandwidth = rule.kernel(self.effective_sample_size, len(rows))
        self.resample(count, scheme)
        spread = bandwidth * root(covariance)
        step = self._draws & 0xFFFFFFFF
        for first, last in self._blocks.pairs:
            for row, centre in zip(rows, mean, strict=True):
                shrink(self._particles.columns, row, first, last, centre, factor)
            for axis in range(len(rows)):
                if axis % 2 == 0:
                    key = random.key(self._seed, _KERNEL_STREAM + axis)
                    random.normal_pairs(first, last, step, key, self._noises[0], 0)
                for row, sigma in zip(rows, spread[:, axis], strict=True):
                    diffuse(self._particles.columns, row, first, last, self._noises[0], axis % 2, sigma)

    def rejuvenate(self, radians: float = 1.0) -> None:
        """Draw every pose anew from a kernel about itself, of the covariance of its neighbours.

        Copies come apart, and no further than their like: a ring stays a ring, and two places two
        (:func:`~filters.rejuvenation.spread`). Every call uses new random numbers only after another
        resampling. Weights, slow states and lineages stay.

        Parameters
        ----------
        radians : float
            How far a heading is off that counts like a metre, in who is whose neighbour.
        """
        columns, count = self._particles.columns, self.count
        normals = np.empty((4, count), np.float32)
        step = self._draws & 0xFFFFFFFF
        for pair in (0, 2):
            key = random.key(self._seed, _REJUVENATION_STREAM + pair)
            for first, last in self._blocks.pairs:
                random.normal_pairs.direct(first, last, step, key, self._noises[0], 0)
                normals[pair : pair + 2, first:last] = self._noises[0][:2, : last - first]
        columns[:3, :count] = spread(columns[:3, :count], normals[:3], radians)
