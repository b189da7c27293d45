"""The particle filter of Table 4.3, over columns.

Why its particles are samples of the belief, *Probabilistic Robotics*, 4.3.3: take each particle as the end of a
whole path x_0..t (eq. 4.30). The belief about paths (4.31) factors by Bayes and Markov into the measurement's
likelihood, the motion, and the belief about paths before (4.32). Line 4 draws from the last two, the proposal (4.29,
4.33); so the weight, target over proposal (4.34), is the likelihood p(z_t | x_t) alone, and particles drawn by their
weights are distributed as the belief (4.35). If they are never resampled, the weights multiply up (4.24).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from math import inf, isfinite
from typing import Any, Generic, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.belief import Evidence
from filters.crew import ALIGNMENT, Crew
from filters.duration import require_duration
from filters.kernels import evidence, random
from filters.kernels.compile import Float32Array
from filters.loosening import loosen
from filters.motion.learned import Learned, SlowState
from filters.motion.model import Drawing, Motion, Reopening
from filters.motion.slow import RandomWalk, diffuse
from filters.motion.walks import Walk, Walks
from filters.particle_belief import EVIDENCE_SAMPLE, TOGETHER
from filters.particle_checks import check_start
from filters.particle_redrawing import NOBODY, RedrawnBelief
from filters.particle_set import ParticleSet
from filters.reopening import CIRCLE, reopen
from filters.sensing.model import Account, Batch, Learner, Sensor

__all__ = ["EVIDENCE_SAMPLE", "NOBODY", "ParticleFilter"]

Control = TypeVar("Control")
M = TypeVar("M", bound=tuple[float | None, ...])

_PACKERS = {number: struct.Struct(f"{8 * number}d") for number in range(2, TOGETHER + 1)}
"""What writes the numbers of several measurements into an array, in half the time that numpy takes for a short list."""

_new = cast(Any, tuple.__new__)  # as the constructors make named tuples, without their calls in Python

_REOPENING_STREAM = 5 << 32
_LOOSENING_STREAM = 7 << 32
_HEADING = 2

_REFUSED = Evidence(math.nan, math.nan, accepted=False)


class ParticleFilter(RedrawnBelief, Generic[Control]):
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
        pairs = (motion.noises + 1) // 2
        super().__init__(names, capacity, seed, block, crew, 2 * pairs)
        self._motion = motion
        self._drawing = motion if pairs == 1 and isinstance(motion, Drawing) else None
        self._reopening = motion if isinstance(motion, Reopening) else None
        self._step = 0
        self._no_noise: Float32Array = np.zeros((max(2 * pairs, 2), 1), np.float32)
        self._learned = [state for state in slow if isinstance(state, Learned)]
        sampled = [state for state in slow if isinstance(state, RandomWalk)]
        self._sampled_states = [state.name for state in sampled]
        self._walks = Walks((*motion.walks, *sampled), self._particles, seed, pairs)
        self._keys = [(random.key(seed, stream), 2 * stream) for stream in range(pairs)]
        self._normal_pairs = random.normal_pairs.direct
        self._numbers = np.zeros((TOGETHER, 8))
        self._numbers_memory = self._numbers.data.cast("B")
        self._said = np.zeros((TOGETHER, 2))
        self._account_for = evidence.account_for.direct

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
        if self._drawing is None:
            self._motion.move(self._centre, 0, 1, self._no_noise, move)
        self._centre_values.clear()
        self._step += 1
        step = self._step & 0xFFFFFFFF
        due = self._walks.due(duration)
        for state in self._learned:
            self._particles.variances[state.name] += state.walk * state.walk * duration
        if self._blocks.shared:
            self._blocks.share_pieces(lambda part: self._move(part, step, move, due))
        else:
            self._move(0, step, move, due)

    def _move(self, part: int, step: int, move: object, due: Sequence[Walk]) -> None:
        noise, particles, pieces = self._noises[part], self._particles, self._blocks.pieces[part]
        if self._drawing is not None:
            self._drawing.move_all(particles, self._centre, pieces, noise, (step, self._keys[0][0]), move)
            if not due:
                return
        for first, last in pieces.tolist():
            if self._drawing is None:
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
        _require_finite(sensor, measurement)
        if sensor.refusal(measurement) is not None:
            return _REFUSED
        innovation = sensor.innovation(self._centre_values or self._centre_state(), measurement)
        particles = self._particles
        if self._blocks.shared:
            constant = self._share_weighing(sensor, measurement)
        else:
            constant = sensor.weigh(particles, 0, particles.count, measurement)
        before = self._log_sum
        after = self._log_sum_of(particles.log_weights, self._sampled, self._stride, self._samples[0])
        self._log_sum = after
        self._weighed = True
        self._top = None
        log_mean = constant + after - before if after > -inf else after
        if self._learned and isinstance(sensor, Learner):
            sensor.learn(particles, measurement, log_mean)
        return _new(Evidence, (log_mean, innovation, True))

    def weigh_all(self, sensor: Sensor[M], measurements: Sequence[M]) -> list[Evidence]:
        """Line 5 for several measurements of one sensor: the same as :meth:`weigh` for one after the other.

        A sensor that can (:class:`filters.sensing.model.Batch`) weighs by all of them in one call, which spares a small
        set half of the time.

        Raises
        ------
        ValueError
            A measurement is not finite; the weights are untouched then.
        """
        batch: Any = sensor
        number = len(measurements)
        numbers = batch.tabulate(measurements) if number in _PACKERS and hasattr(batch, "tabulate") else None
        if numbers is None or not isfinite(sum(numbers)):
            for measurement in measurements:
                _require_finite(sensor, measurement)
            return [self.weigh(sensor, measurement) for measurement in measurements]
        _PACKERS[number].pack_into(self._numbers_memory, 0, *numbers)
        particles, samples, said = self._particles, self._samples, self._said
        account = _new(Account, (number, self._centre.columns, self._stride, samples, said))
        if self._blocks.shared:
            self._top = self._share_weighing_all(batch, account)
        else:
            self._top = batch.weigh_all(particles, 0, particles.count, self._numbers, account)
        self._log_sum = self._account_for(samples, number, self._sampled, self._log_sum, said)
        self._weighed = True
        return [
            _new(Evidence, (log_mean, innovation, True)) for log_mean, innovation in said[:number].tolist()
        ]

    def _share_weighing_all(self, sensor: Batch[Any], account: Account) -> float:
        """Weigh with the crew, and return the largest log weight."""
        particles = self._particles
        tops = [-inf] * self._blocks.threads

        def act(part: int, first: int, last: int) -> None:
            tops[part] = sensor.weigh_all(particles, first, last, self._numbers, account)

        self._blocks.split(self.count, ALIGNMENT, act)
        return max(tops)

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
        _require_finite(sensor, measurement)
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
        self._log_sum = self._log_sum_of(log_weights, self._sampled, self._stride, self._samples[0])
        self._weighed = True
        self._top = None
        return Evidence(constant + math.log(mean), innovation, True)

    def _share_weighing(self, sensor: Sensor[M], measurement: M) -> float:
        constants = [0.0] * self._blocks.threads

        def act(part: int, first: int, last: int) -> None:
            constants[part] = sensor.weigh(self._particles, first, last, measurement)

        self._blocks.split(self.count, ALIGNMENT, act)
        return constants[0]

    def reopen(self, effective_sample_size: float) -> None:
        """Open headings and slow states after a resampling, so that they do not freeze at few ancestors' values.

        Those that the motion marginalises get a wider variance, those that are sampled are drawn apart; those that a
        sensor learns stay. Mean, covariance with the pose and variance of each stay what they were
        (:mod:`filters.reopening`).

        Parameters
        ----------
        effective_sample_size : float
            Before that resampling.
        """
        motion = self._reopening
        if motion is None:
            return
        self._loosen(effective_sample_size)
        names = list(motion.conditional_variances)
        rows = [self._particles.row(name) for name in (*names, *self._sampled_states)]
        columns, count = self._particles.columns, self.count
        opened = reopen(columns[:3, :count], columns[rows, :count], effective_sample_size)
        if opened is None:
            return
        taken, variances = opened
        columns[rows, :count] -= taken
        motion.reopen(dict(zip(names, variances[: len(names)].tolist(), strict=True)))
        step = self._draws & 0xFFFFFFFF
        for axis, (row, variance) in enumerate(zip(rows[len(names) :], variances[len(names) :], strict=True)):
            key = random.key(self._seed, _REOPENING_STREAM + axis)
            for first, last in self._blocks.pairs:
                self._normal_pairs(first, last, step, key, self._noises[0], 0)
                diffuse(columns, row, first, last, self._noises[0], 0, math.sqrt(variance))

    def _loosen(self, effective_sample_size: float) -> None:
        """Draw the headings apart (:mod:`filters.loosening`)."""
        columns, count = self._particles.columns, self.count
        heading = columns[_HEADING, :count]
        others = np.delete(columns[:, :count], _HEADING, axis=0)
        loosened = loosen(heading, others, effective_sample_size)
        if loosened is None:
            return
        heading -= loosened[0]
        key, sigma = random.key(self._seed, _LOOSENING_STREAM), math.sqrt(loosened[1])
        for first, last in self._blocks.pairs:
            self._normal_pairs(first, last, self._draws & 0xFFFFFFFF, key, self._noises[0], 0)
            diffuse(columns, _HEADING, first, last, self._noises[0], 0, sigma)
        heading -= CIRCLE * np.floor((heading + 0.5 * CIRCLE) / CIRCLE)

    def _given_path(self) -> Mapping[str, float]:
        variances = self._motion.conditional_variances
        return {**variances, **self._particles.variances} if self._learned else variances


def _require_finite(sensor: Sensor[M], measurement: M) -> None:
    # their sum tells sooner; it may overflow where they are finite all the same
    if not isfinite(sum(filter(None, measurement))) and not all(map(isfinite, filter(None, measurement))):
        raise ValueError(f"{type(sensor).__name__}: a measurement must be finite, got {measurement}")
