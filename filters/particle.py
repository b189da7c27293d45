"""The particle filter of Table 4.3, over columns.

Why its particles are samples of the belief, *Probabilistic Robotics*, 4.3.3: take each particle as the end of a
whole path x_0..t (eq. 4.30). The belief about paths (4.31) factors by Bayes and Markov into the measurement's
likelihood, the motion, and the belief about paths before (4.32). Line 4 draws from the last two, the proposal (4.29,
4.33); so the weight, target over proposal (4.34), is the likelihood p(z_t | x_t) alone, and particles drawn by their
weights are distributed as the belief (4.35). If they are never resampled, the weights multiply up (4.24).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from math import inf, isfinite
from typing import Any, Final, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters import strata
from filters.belief import STILL, Displacement, Evidence, Joint, Moments
from filters.crew import ALIGNMENT, Blocks, Crew
from filters.duration import require_duration
from filters.kernels import random, resampling, weights
from filters.kernels.compile import Float32Array, Int32Array
from filters.kernels.covariance import covariance
from filters.kernels.regularization import shrink
from filters.motion.learned import Learned, SlowState
from filters.motion.model import Motion, Reopening
from filters.motion.slow import RandomWalk, diffuse
from filters.motion.walks import Walk, Walks
from filters.particle_checks import check_injected, check_shape, check_slow, check_start
from filters.particle_moments import MomentSums
from filters.particle_set import ParticleSet
from filters.regularization import Rule, root, weighted_covariance
from filters.rejuvenation import power, spread
from filters.reopening import reopen
from filters.resampling import Resampler, systematic
from filters.sensing.model import Learner, Sensor

Control = TypeVar("Control")
M = TypeVar("M", bound=tuple[float | None, ...])

EVIDENCE_SAMPLE = 2048
"""Most particles that the evidence of a measurement is taken over."""

_RESAMPLING_STREAM = 1 << 32
_INJECTION_STREAM = 2 << 32
_KERNEL_STREAM = 3 << 32
_REJUVENATION_STREAM = 4 << 32

NOBODY = -1
"""Ancestor of a particle that was injected."""

_REFUSED = Evidence(math.nan, math.nan, accepted=False)


class ParticleFilter(Generic[Control]):
    """A belief as weighted particles in float32 columns, allocated once.

    The lines of Table 4.3 are methods, so that the caller decides which of them happen in a tick::

        3-4  for every particle, sample x_t from p(x_t | u_t, x_{t-1})    predict
        5    w_t = p(z_t | x_t), times the weight it had (eq. 4.36)       weigh, once per measurement
        6    add <x_t, w_t> to the set                                    normalize
        8-11 draw with probability proportional to the weights            resample (Table 4.4)

    The same calls with the same seed give the same bytes: the random numbers are a function of the seed, the
    number of predictions so far, the particle and the dimension.

    Parameters
    ----------
    motion : Motion
        Names the pose and moves it.
    capacity : int
        The largest number of particles there can ever be.
    seed : int
        Of the random numbers.
    slow : sequence of RandomWalk or Learned
        Slow states beside those of the motion model, such as a sensor's bias: sampled, or marginalised by the sensor.
    block : int
        Most particles that are moved at once; noise for a block should fit the second-level cache.
    crew : Crew, optional
        Threads that help; the result is the same, bit for bit.

    Raises
    ------
    ValueError
        A capacity or block below 1, a name that occurs twice, or a motion whose columns do not start with
        north, east, heading.
    """

    def __init__(
        self,
        motion: Motion[Control, Any],
        *,
        capacity: int,
        seed: int,
        slow: Sequence[SlowState] = (),
        block: int = 16384,
        crew: Crew | None = None,
    ) -> None:
        names = tuple(motion.names) + tuple(walk.name for walk in slow)
        check_shape(names, capacity, block)
        self.names: Final = names
        self.capacity: Final = capacity
        self.collapses = 0
        """How often every weight was zero and the set was kept with equal weights."""
        self.tempered = 0
        """How often the weights were raised to a power below one."""
        self._motion = motion
        self._reopening = motion if isinstance(motion, Reopening) else None
        self._seed = seed
        self._step = 0
        self._draws = 0
        self._particles = ParticleSet(names, capacity)
        self._spare: Float32Array = np.zeros_like(self._particles.columns)
        self._weights: Float32Array = np.zeros(capacity, np.float32)
        self._ancestors = np.zeros(capacity, np.int32)
        self._centre = ParticleSet(names, 1)
        self._centre.count = 1
        self._blocks = Blocks(block, crew)
        most_blocks = -(-capacity // block)
        pairs = (motion.noises + 1) // 2
        rows = max(2 * pairs, 2)
        self._noises: list[Float32Array] = [
            np.zeros((rows, min(block + resampling.RUN, capacity)), np.float32)
            for _ in range(self._blocks.threads)
        ]
        self._no_noise: Float32Array = np.zeros((rows, 1), np.float32)
        self._learned = [state for state in slow if isinstance(state, Learned)]
        sampled = [state for state in slow if isinstance(state, RandomWalk)]
        self._walks = Walks((*motion.walks, *sampled), self._particles, seed, pairs)
        self._keys = [(random.key(seed, stream), 2 * stream) for stream in range(pairs)]
        self._sample: Float32Array = np.zeros(min(EVIDENCE_SAMPLE, capacity), np.float32)
        self._sampled = 0
        self._stride = 1
        self._sums = np.zeros((most_blocks, 2))
        self._moment_sums = MomentSums(self._particles, self._weights, self._centre, most_blocks)
        self._normal_pairs = random.normal_pairs.direct  # four times a step: worth looking up once
        self._log_sum_of = weights.log_sum.direct
        self._normalize = weights.normalize
        self._redraw = resampling.redraw.direct
        self._total_of = resampling.total.direct
        self._log_sum = 0.0
        self._total = self._squares = 0.0
        self._lineage: Int32Array | None = None
        self._centre_values: dict[str, float] = {}
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

    def initialize(self, columns: Mapping[str, ArrayLike]) -> None:
        """Start from given particles, equally weighted; their number is the count.

        Parameters
        ----------
        columns : mapping of str to (count,) array
            Every dimension by name. Their order should be random: a block of them stands for the whole.

        Raises
        ------
        ValueError
            A dimension missing or unknown, lengths that differ, a length of 0 or above the capacity, or a
            value that is not finite.
        """
        given = {name: np.asarray(column, np.float64) for name, column in columns.items()}
        count = check_start(given, self.names, self.capacity)
        for name, row in self._particles.rows.items():
            self._particles.columns[row, :count] = given[name]
            self._centre.columns[row, 0] = given[name].mean()
        heading = given["heading"]
        self._particles.columns[2, :count] = np.remainder(heading + math.pi, 2.0 * math.pi) - math.pi
        self._centre.columns[2, 0] = math.atan2(np.sin(heading).mean(), np.cos(heading).mean())
        self._motion.start()
        self._particles.variances.update({state.name: state.sigma**2 for state in self._learned})
        self._recount(count)
        self._level()

    def predict(self, control: Control, duration: float) -> None:
        """Line 4: move every particle, each with its own noise. Every call uses new random numbers.

        Parameters
        ----------
        control : Control
            As the motion model wants it.
        duration : float
            Seconds, not negative.

        Raises
        ------
        ValueError
            A duration or control that is negative or not finite; nothing has moved then.
        """
        require_duration("predict", duration)
        move = self._motion.begin(control, duration)
        self._motion.move(self._centre, 0, 1, self._no_noise, move)
        self._centre_values.clear()
        self._step += 1
        step = self._step & 0xFFFFFFFF
        due = self._walks.due(duration)
        for state in self._learned:
            self._particles.variances[state.name] += state.walk * state.walk * duration
        pairs = self._blocks.pairs
        if self._blocks.shared:
            self._blocks.share(lambda part, first, last: self._move(part, pairs[first:last], step, move, due))
        else:
            self._move(0, pairs, step, move, due)

    def _move(
        self, part: int, pairs: Sequence[tuple[int, int]], step: int, move: object, due: Sequence[Walk]
    ) -> None:
        noise, particles = self._noises[part], self._particles
        for first, last in pairs:
            for key, row in self._keys:
                self._normal_pairs(first, last, step, key, noise, row)
            self._motion.move(particles, first, last, noise, move)
            for walk in due:
                walk.apply(particles, first, last, noise, step)

    def weigh(self, sensor: Sensor[M], measurement: M) -> Evidence:
        """Line 5: multiply every weight by the measurement's likelihood.

        The evidence is taken over at most 2,048 particles evenly spaced among all; up to that count it is
        exact.

        Raises
        ------
        ValueError
            The measurement is not finite; the weights are untouched then.
        """
        # their sum tells sooner; it may overflow where they are finite all the same
        if not isfinite(sum(filter(None, measurement))) and not all(map(isfinite, filter(None, measurement))):
            raise ValueError(f"{type(sensor).__name__}: a measurement must be finite, got {measurement}")
        if sensor.refusal(measurement) is not None:
            return _REFUSED
        innovation = sensor.innovation(self._centre_values or self._centre_state(), measurement)
        particles = self._particles
        if self._blocks.shared:
            constant = self._share_weighing(sensor, measurement)
        else:
            constant = sensor.weigh(particles, 0, particles.count, measurement)
        before = self._log_sum
        after = self._log_sum_of(particles.log_weights, self._sampled, self._stride, self._sample)
        self._log_sum = after
        self._weighed = True
        log_mean = constant + after - before if after > -inf else after
        if self._learned and isinstance(sensor, Learner):
            sensor.learn(particles, measurement, log_mean)
        # as the constructor makes it, without its call in Python
        return tuple.__new__(Evidence, (log_mean, innovation, True))

    def weigh_past(
        self, sensor: Sensor[M], measurement: M, past: ParticleSet, known: NDArray[np.bool_]
    ) -> Evidence:
        """Line 5 for a measurement of an earlier time: a particle is the end of a path (eq. 4.30).

        Parameters
        ----------
        past : ParticleSet
            Every particle as it was then, in the order of now; its ``log_weights`` are written.
        known : (count,) bool
            Whose path reaches back so far. The others keep their share of the belief.

        Raises
        ------
        ValueError
            The measurement is not finite; the weights are untouched then.
        """
        if not all(map(isfinite, filter(None, measurement))):
            raise ValueError(f"{type(sensor).__name__}: a measurement must be finite, got {measurement}")
        if sensor.refusal(measurement) is not None or not known.any():
            return _REFUSED
        innovation = sensor.innovation(self._centre_values or self._centre_state(), measurement)
        gain = past.log_weights[: self.count]
        gain[:] = 0.0
        constant = sensor.weigh(past, 0, self.count, measurement)
        held = self.weights[known].astype(np.float64)
        mean = float(np.exp(gain[known], dtype=np.float64) @ held / held.sum())
        if mean <= 0.0:
            return _REFUSED
        gain[~known] = math.log(mean)
        log_weights = self._particles.log_weights
        log_weights[: self.count] += gain
        self._log_sum = self._log_sum_of(log_weights, self._sampled, self._stride, self._sample)
        self._weighed = True
        return Evidence(constant + math.log(mean), innovation, True)

    def follow(self, lineage: Int32Array) -> None:
        """Have ``lineage``, (capacity,) int32, laid out with the copies at every resampling, as a column would be."""
        if lineage.shape != (self.capacity,):
            raise ValueError(f"follow: {self.capacity} numbers are needed, got {lineage.shape}")
        self._lineage = lineage

    def _share_weighing(self, sensor: Sensor[M], measurement: M) -> float:
        constants = [0.0] * self._blocks.threads

        def act(part: int, first: int, last: int) -> None:
            constants[part] = sensor.weigh(self._particles, first, last, measurement)

        self._blocks.split(self.count, ALIGNMENT, act)
        return constants[0]

    def normalize(self) -> None:
        """Line 6: make weights of the log weights.

        If every weight is zero (no particle can explain what was measured), the set is kept with equal
        weights and ``collapses`` counts it; the evidence of the measurement that did it is minus infinity or
        close to it.
        """
        log_weights, bounds = self._particles.log_weights, self._blocks.bounds
        if self._blocks.shared:
            top, total, squares = self._share_normalizing()
        else:
            top, total, squares = self._normalize(log_weights, self._weights, bounds, self._sums)
        if not total > 0.0:
            self.collapses += 1
            self._level()
            return
        self._total, self._squares = total, squares
        self._log_sum -= top
        self._weighed = False

    def _share_normalizing(self) -> tuple[float, float, float]:
        log_weights, bounds, sums = self._particles.log_weights, self._blocks.bounds, self._sums
        tops = [-math.inf] * self._blocks.threads

        def find(part: int, first: int, last: int) -> None:
            tops[part] = weights.peak(log_weights, first, last)

        def exponentiate(part: int, first: int, last: int) -> None:
            weights.exponentiate(log_weights, self._weights, bounds, first, last, top, sums)

        self._blocks.split(self.count, ALIGNMENT, find)
        top = max(tops)
        if not weights.NOTHING < top < math.inf:
            return top, 0.0, 0.0
        self._blocks.share(exponentiate)
        return top, *weights.add(sums, self._blocks.number)

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
        sources, ancestors = self.count, self._ancestors[:target]
        if scheme is not systematic:
            scheme(self._weights[:sources], target, uniform, ancestors)
        self._draws += 1
        self._recount(target)
        if scheme is systematic and not self._blocks.shared:
            particles, columns, spare = self._particles, self._particles.columns, self._spare
            logs, bounds = particles.log_weights, self._blocks.bounds
            whole = self._total_of(self._weights[:sources])
            self._redraw(columns, spare, self._weights, logs, sources, whole, ancestors, bounds, uniform)
            particles.columns, self._spare = spare, columns
            self._forget_sums()
            self._lay_out_lineage(sources, ancestors)
            return
        if scheme is systematic:  # whose checks these weights do not need
            given = self._weights[:sources]
            resampling.systematic(given, resampling.total(given), uniform, ancestors)
        self._lay_out(ancestors)
        self._lay_out_lineage(sources, ancestors)
        self._level()

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
        self._log_sum = weights.log_sum.direct(log_weights, self._sampled, self._stride, self._sample)
        self.normalize()

    def _lay_out(self, ancestors: Int32Array) -> None:
        """Put the copies in the place of the particles."""
        self._recount(ancestors.size)
        columns, spare, blocks = self._particles.columns, self._spare, self._blocks

        def act(part: int, first: int, last: int) -> None:
            resampling.deal(columns, spare, ancestors, blocks.bounds, first, last)

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

    def reopen(self, effective_sample_size: float) -> None:
        """Open the motion's slow states again after a resampling, so that few ancestors' means do not freeze them.

        Mean, covariance with the pose and variance of each stay what they were; see :mod:`filters.reopening`.

        Parameters
        ----------
        effective_sample_size : float
            Before that resampling.
        """
        motion = self._reopening
        if motion is None:
            return
        names = list(motion.conditional_variances)
        rows = [self._particles.row(name) for name in names]
        columns, count = self._particles.columns, self.count
        opened = reopen(columns[:3, :count], columns[rows, :count], effective_sample_size)
        if opened is not None:
            taken, variances = opened
            columns[rows, :count] -= taken
            motion.reopen(dict(zip(names, variances.tolist(), strict=True)))

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
            self._log_sum = self._log_sum_of(log_weights, self._sampled, self._stride, self._sample)
            self.normalize()
        return exponent

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
                self._normal_pairs(first, last, step, key, self._noises[0], 0)
                normals[pair : pair + 2, first:last] = self._noises[0][:2, : last - first]
        columns[:3, :count] = spread(columns[:3, :count], normals[:3], radians)

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
        variances = self._motion.conditional_variances
        return {**variances, **self._particles.variances} if self._learned else variances

    def _settle(self) -> None:
        if self._weighed:
            self.normalize()

    def _level(self) -> None:
        """Make all weights equal."""
        count = self.count
        self._particles.log_weights[:count] = 0.0
        self._weights[:count] = 1.0
        self._forget_sums()

    def _forget_sums(self) -> None:
        """Set the sums of weights that are all one."""
        self._total = self._squares = float(self.count)
        self._log_sum = math.log(self._sampled)
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
            self._centre_values.update(zip(self.names, self._centre.columns[:, 0].tolist(), strict=True))
        return self._centre_values
