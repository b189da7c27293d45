"""The particle filter of Table 4.3, over columns."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, Final, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.belief import STILL, Displacement, Evidence, Moments
from filters.kernels import random, resampling, weights
from filters.kernels.compile import Float32Array
from filters.motion.model import Motion
from filters.motion.slow import PERIOD, RandomWalk, diffuse
from filters.particle_set import ParticleSet
from filters.sensing.model import Sensor

Control = TypeVar("Control")
M = TypeVar("M", bound=tuple[float | None, ...])

POSE = ("north", "east", "heading")
EVIDENCE_SAMPLE = 2048
FAR = 1e4
"""Square of the mean's distance from the reference over the variance; four digits of seven are lost."""
_RESAMPLING_STREAM = 1 << 32


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
    slow : sequence of RandomWalk
        Slow states beside those of the motion model, such as a sensor's bias.
    block : int
        Most particles that are moved at once; noise for a block should fit the second-level cache.

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
        slow: Sequence[RandomWalk] = (),
        block: int = 32768,
    ) -> None:
        names = tuple(motion.names) + tuple(walk.name for walk in slow)
        _check_shape(names, capacity, block)
        self.names: Final = names
        self.capacity: Final = capacity
        self.collapses = 0
        """How often every weight was zero and the set was kept with equal weights."""
        self._motion = motion
        self._seed = seed
        self._block = block
        self._step = 0
        self._draws = 0
        self._particles = ParticleSet(names, capacity)
        self._spare: Float32Array = np.zeros_like(self._particles.columns)
        self._weights: Float32Array = np.zeros(capacity, np.float32)
        self._ancestors = np.zeros(capacity, np.int32)
        self._centre = ParticleSet(names, 1)
        self._centre.count = 1
        self._pairs = (motion.noises + 1) // 2
        rows = max(2 * self._pairs, 2)
        self._noise: Float32Array = np.zeros((rows, min(block, capacity)), np.float32)
        self._no_noise: Float32Array = np.zeros((rows, 1), np.float32)
        self._walks = _Walks((*motion.walks, *slow), self._particles, seed, self._pairs)
        self._keys = [random.key(seed, stream) for stream in range(self._pairs)]
        self._places = np.zeros(capacity, np.int32)
        self._sample: Float32Array = np.zeros(0, np.float32)
        self._bounds: list[tuple[int, int]] = []
        self._sums = np.zeros(2)
        self._moment_sums = np.zeros(weights.SUMS + 2 * (len(names) - len(POSE)))
        self._reference = np.zeros(len(POSE), np.float32)
        self._log_sum = 0.0
        self._stride = 1
        self._centre_values: dict[str, float] = {}
        self._weighed = False

    @property
    def count(self) -> int:
        """How many particles there are; 0 before :meth:`initialize`."""
        return self._particles.count

    @property
    def effective_sample_size(self) -> float:
        """1 / Σ w², the inverse of the variance that equation 4.36's weights have gathered."""
        self._settle()
        return float(self._sums[0] ** 2 / self._sums[1])

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
        count = _check_columns(given, self.names, self.capacity)
        for name, row in self._particles.rows.items():
            self._particles.columns[row, :count] = given[name]
            self._centre.columns[row, 0] = given[name].mean()
        heading = given["heading"]
        self._particles.columns[2, :count] = np.remainder(heading + math.pi, 2.0 * math.pi) - math.pi
        self._centre.columns[2, 0] = math.atan2(np.sin(heading).mean(), np.cos(heading).mean())
        self._motion.start()
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
        if not 0.0 <= duration < math.inf:
            raise ValueError(f"predict: duration must be finite and not negative, got {duration} s")
        move = self._motion.begin(control, duration)
        self._motion.move(self._centre, 0, 1, self._no_noise, move)
        self._centre_values.clear()
        self._step += 1
        step = self._step & 0xFFFFFFFF
        noise = self._noise
        due = self._walks.due(duration)
        for first, last in self._bounds:
            for pair, key in enumerate(self._keys):
                random.normal_pairs(first, last, step, key, noise, 2 * pair)
            self._motion.move(self._particles, first, last, noise, move)
            for walk in due:
                walk.apply(self._particles, first, last, noise, step)

    def weigh(self, sensor: Sensor[M], measurement: M) -> Evidence:
        """Line 5: multiply every weight by the measurement's likelihood.

        The evidence is taken over at most 2,048 particles evenly spaced among all; up to that count it is
        exact.

        Raises
        ------
        ValueError
            The measurement is not finite; the weights are untouched then.
        """
        for value in measurement:
            if value is not None and not math.isfinite(value):
                raise ValueError(f"{type(sensor).__name__}: a measurement must be finite, got {measurement}")
        if sensor.refusal(measurement) is not None:
            return Evidence(math.nan, math.nan, accepted=False)
        innovation = sensor.innovation(self._centre_state(), measurement)
        constant = sensor.weigh(self._particles, 0, self.count, measurement)
        before = self._log_sum
        after = weights.log_sum(self._particles.log_weights, self._stride, self._sample)
        self._log_sum = after
        self._weighed = True
        log_mean = constant + after - before if after > -math.inf else -math.inf
        return Evidence(log_mean, innovation, accepted=True)

    def normalize(self) -> None:
        """Line 6: make weights of the log weights.

        If every weight is zero (no particle can explain what was measured), the set is kept with equal
        weights and ``collapses`` counts it; the evidence of the measurement that did it is minus infinity or
        close to it.
        """
        count = self.count
        top = float(weights.peak(self._particles.log_weights, 0, count))
        if not weights.NOTHING < top < math.inf:
            self.collapses += 1
            self._level()
            return
        self._sums.fill(0.0)
        for first, last in self._bounds:
            weights.exponentiate(self._particles.log_weights, self._weights, first, last, top, self._sums)
        self._log_sum -= top
        self._weighed = False

    def moments(self, displacement: Displacement | None = None) -> Moments:
        """Weighted mean and covariance, of the particles displaced each along its own heading.

        The heading's mean is circular; the covariance is about that mean, with wrapped differences. The
        variance of a marginalised column is the spread of the particles' means and what their paths leave open.
        The centre that innovations are measured from becomes the mean found here.
        """
        self._settle()
        shift = STILL if displacement is None else displacement
        centre: list[float] = self._centre.columns[:, 0].tolist()
        north, east, heading = self._displaced(centre, shift)
        sums, offset = self._sums_about(shift, north, east, heading)
        if abs(offset) > 1e-6 and sums[12] + abs(offset) >= 3.14:
            # some particle's difference wraps elsewhere about the mean than about the reference
            heading += offset
            sums, offset = self._sums_about(shift, north, east, heading)
        total = sums[0]
        n, e, h = sums[1] / total, sums[2] / total, sums[3] / total
        if n * n + e * e > FAR * (sums[6] / total - n * n + sums[8] / total - e * e):
            # the belief has jumped: single precision has no digits left for its spread about the old centre
            centre[0] += n
            centre[1] += e
            north, east, _ = self._displaced(centre, shift)
            sums, offset = self._sums_about(shift, north, east, heading)
            total = sums[0]
            n, e, h = sums[1] / total, sums[2] / total, sums[3] / total
        ne, nh, eh = sums[7] / total - n * e, sums[9] / total - n * h, sums[10] / total - e * h
        nn = max(sums[6] / total - n * n, 0.0)
        ee = max(sums[8] / total - e * e, 0.0)
        hh = max(sums[11] / total - 2.0 * offset * h + offset * offset, 0.0)
        ne = math.copysign(min(abs(ne), math.sqrt(nn * ee)), ne)  # rounding: few particles lie on a line
        slow: list[float] = []
        variance = [nn, ee, hh]
        for row, place in enumerate(range(weights.SUMS, len(sums), 2), len(POSE)):
            away = sums[place] / total
            slow.append(centre[row] + away)
            variance.append(max(sums[place + 1] / total - away * away, 0.0))
        for name, given_path in self._motion.conditional_variances.items():
            variance[self._particles.rows[name]] += given_path
        mean_heading = heading + offset
        self._centre.columns[:, 0] = (centre[0] + n, centre[1] + e, _wrap(mean_heading - shift.turn), *slow)
        self._centre_values.clear()
        return Moments(
            self.names,
            np.array((north + n, east + e, _wrap(mean_heading), *slow)),
            np.array((nn, ne, nh, ne, ee, eh, nh, eh, hh)).reshape(3, 3),
            np.array(variance),
            self.effective_sample_size,
        )

    def resample(self, count: int | None = None) -> None:
        """Lines 8 to 11 by Table 4.4: draw ``count`` particles, equally weighted; as many as now by default.

        The copies are dealt to the blocks in turn, so every block is a fair sample of the whole.

        Raises
        ------
        ValueError
            A count below 1 or above the capacity.
        """
        self._settle()
        target = self.count if count is None else count
        if not 1 <= target <= self.capacity:
            raise ValueError(f"resample: count must lie in 1 to {self.capacity} (the capacity), got {target}")
        self._draws += 1
        uniform = random.uniform(self._seed, _RESAMPLING_STREAM, self._draws)
        source = self._weights[: self.count]
        ancestors = self._ancestors[:target]
        resampling.systematic(source, resampling.total(source), uniform, ancestors)
        self._recount(target)
        columns = self._particles.columns
        resampling.deal(columns, self._spare, ancestors, self._places[:target])
        self._particles.columns, self._spare = self._spare, columns
        self._level()

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
            scale = self.count / (rows * self._sums[0])
            shift = STILL if displacement is None else displacement
            weights.displace(self._particles.columns, self._weights, self.count, scale, *shift, out[:rows])
        return out[:rows]

    def _settle(self) -> None:
        if self._weighed:
            self.normalize()

    def _level(self) -> None:
        """Make all weights equal."""
        count = self.count
        self._particles.log_weights[:count] = 0.0
        self._weights[:count] = 1.0
        self._sums[:] = count
        self._log_sum = math.log(self._sample.size)
        self._weighed = False

    def _recount(self, count: int) -> None:
        """Divide the particles into blocks of equal size, and choose the ones that evidence is taken over."""
        if count == self.count:
            return
        self._particles.count = count
        self._stride = -(-count // EVIDENCE_SAMPLE)
        self._sample = np.empty(count // self._stride, np.float32)
        blocks = -(-count // self._block)
        size, rest = divmod(count, blocks)
        starts = [block * size + min(block, rest) for block in range(blocks)] + [count]
        self._bounds = list(pairwise(starts))
        resampling.places(np.array(starts[:-1], np.int64), self._places[:count])

    def _centre_state(self) -> dict[str, float]:
        """Centre of the belief by name."""
        if not self._centre_values:
            self._centre_values.update(zip(self.names, self._centre.columns[:, 0].tolist(), strict=True))
        return self._centre_values

    def _displaced(self, centre: list[float], shift: Displacement) -> list[float]:
        """Pose of the displaced centre, rounded to float32 as the kernel will see it."""
        north, east, heading, *_ = centre
        sine, cosine = math.sin(heading), math.cos(heading)
        self._reference[:] = (
            north + shift.forward * cosine - shift.right * sine,
            east + shift.forward * sine + shift.right * cosine,
            heading + shift.turn,
        )
        return self._reference.tolist()

    def _sums_about(
        self, shift: Displacement, north: float, east: float, heading: float
    ) -> tuple[list[float], float]:
        """Sums about a reference pose, and how far the circular mean lies from the reference heading."""
        sums = self._moment_sums
        sums.fill(0.0)
        forward, right, turn = shift
        columns, weight, references = self._particles.columns, self._weights, self._centre.columns
        for first, last in self._bounds:
            weights.moments(columns, weight, first, last, forward, right, turn, north, east, heading, sums)
            weights.spread(columns, weight, first, last, references, sums)
        values: list[float] = sums.tolist()
        return values, math.atan2(values[4], values[5])


class _Walk:
    """One or two slow states that share a pair of normals, and the motion gathered since they last walked."""

    def __init__(
        self, walks: Sequence[RandomWalk], particles: ParticleSet, key: int, head_start: float
    ) -> None:
        self._rows = [(particles.row(walk.name), walk.walk) for walk in walks]
        self._key = key
        self._gathered = 0.0
        self._threshold = head_start
        self._sigma = 0.0

    def due(self, duration: float) -> bool:
        self._gathered += duration
        if self._gathered < self._threshold:
            return False
        self._sigma = math.sqrt(self._gathered)
        self._gathered = 0.0
        self._threshold = PERIOD
        return self._sigma > 0.0

    def apply(self, particles: ParticleSet, first: int, last: int, noise: Float32Array, step: int) -> None:
        random.normal_pairs(first, last, step, self._key, noise, 0)
        for noise_row, (row, walk) in enumerate(self._rows):
            diffuse(particles.columns, row, first, last, noise, noise_row, walk * self._sigma)


class _Walks:
    """All slow states in pairs, which walk in different ticks so that no tick pays for all of them."""

    def __init__(self, walks: Sequence[RandomWalk], particles: ParticleSet, seed: int, stream: int) -> None:
        moving = [walk for walk in walks if walk.walk > 0.0]
        pairs = [moving[i : i + 2] for i in range(0, len(moving), 2)]
        self._pairs = [
            _Walk(pair, particles, random.key(seed, stream + i), PERIOD * (i + 1) / len(pairs))
            for i, pair in enumerate(pairs)
        ]

    def due(self, duration: float) -> list[_Walk]:
        return [pair for pair in self._pairs if pair.due(duration)]


def _wrap(angle: float) -> float:
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def _check_shape(names: tuple[str, ...], capacity: int, block: int) -> None:
    if capacity < 1 or block < 1:
        raise ValueError(
            f"particle filter: capacity and block must be at least 1, got {capacity} and {block}"
        )
    if names[:3] != POSE:
        raise ValueError(
            f"particle filter: the first columns must be {', '.join(POSE)}, got {', '.join(names)}"
        )
    if len(set(names)) < len(names):
        raise ValueError(f"particle filter: a name occurs twice among {', '.join(names)}")


def _check_columns(columns: Mapping[str, NDArray[Any]], names: tuple[str, ...], capacity: int) -> int:
    if set(columns) != set(names):
        raise ValueError(
            f"initialize: columns must be {', '.join(names)}; missing {sorted(set(names) - set(columns))}, "
            f"unknown {sorted(set(columns) - set(names))}"
        )
    shapes = {name: column.shape for name, column in columns.items()}
    count = shapes[names[0]][0] if len(shapes[names[0]]) == 1 else 0
    if set(shapes.values()) != {(count,)}:
        raise ValueError(f"initialize: columns must be one-dimensional and of one length, got {shapes}")
    if not 1 <= count <= capacity:
        raise ValueError(f"initialize: 1 to {capacity} particles (the capacity) are possible, got {count}")
    for name, column in columns.items():
        if not np.isfinite(column).all():
            raise ValueError(
                f"initialize: column {name} has {np.sum(~np.isfinite(column))} values that are not finite"
            )
    return count
