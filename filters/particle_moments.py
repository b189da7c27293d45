"""Weighted mean and covariance of a particle set, displaced, from sums about a reference.

Sums of squares run in single precision, so they are taken about a reference near the mean: the centre of the belief
as the last call found it, moved by the motion model since. Where that was not near enough (the belief has jumped, or
a heading wraps elsewhere about the mean than about the reference), the sums are taken once more.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from filters.belief import Displacement, Moments
from filters.crew import Blocks
from filters.kernels import moments as kernels
from filters.kernels.compile import Float32Array
from filters.particle_set import ParticleSet

_POSE = kernels.POSE


class MomentSums:
    """The sums, in memory allocated once.

    Parameters
    ----------
    particles : ParticleSet
        The set.
    particle_weights : (capacity,) float32
        Its weights.
    centre : ParticleSet
        One particle: the reference, and where the mean is left for the next call.
    most_blocks : int
        How many blocks there can be.
    """

    def __init__(
        self, particles: ParticleSet, particle_weights: Float32Array, centre: ParticleSet, most_blocks: int
    ) -> None:
        self._particles = particles
        self._weights = particle_weights
        self._centre = centre.columns
        size = len(particles.names)
        self._sums = np.zeros((most_blocks, kernels.SUMS + 2 * (size - _POSE)))
        self._reference = np.zeros(kernels.REFERENCE)
        self._displace = kernels.displace_reference.direct
        self._sum_blocks = kernels.sum_blocks.direct
        self._finish = kernels.finish.direct

    def moments(
        self,
        shift: Displacement,
        blocks: Blocks,
        given_path: Mapping[str, float],
        effective_sample_size: float,
    ) -> Moments:
        """Return the moments of the particles, displaced each along its own heading, and move the centre to the mean.

        The blocks are summed over in float32; ``given_path`` is what each marginalised column's variance is beyond
        the spread of its means.
        """
        size = len(self._particles.names)
        out = np.empty(2 * size + _POSE * _POSE)
        self._sum(shift, blocks, out)
        variance = out[size : 2 * size]
        for name, extra in given_path.items():
            if extra > 0.0:
                variance[self._particles.rows[name]] += extra
        covariance = out[2 * size :].reshape(_POSE, _POSE)
        # as the constructor makes it, without its call in Python
        return tuple.__new__(
            Moments, (self._particles.names, out[:size], covariance, variance, effective_sample_size)
        )

    def _sum(self, shift: Displacement, blocks: Blocks, out: kernels.Float64Array) -> None:
        """Write the moments to ``out``.

        One thread calls the same kernel as several: within another kernel a compiler may sum in another order.
        """
        forward, right, turn = shift
        centre, reference, sums = self._centre, self._reference, self._sums
        columns, weights, bounds = self._particles.columns, self._weights, blocks.bounds

        def add(part: int, first: int, last: int) -> None:
            sum_blocks(columns, weights, bounds, first, last, forward, right, centre, reference, sums)

        sum_blocks, number = self._sum_blocks, blocks.number
        self._displace(centre, forward, right, turn, reference)
        done = False
        while not done:
            if blocks.shared:
                blocks.share(add)
            else:
                sum_blocks(columns, weights, bounds, 0, number, forward, right, centre, reference, sums)
            done = self._finish(number, forward, right, centre, reference, sums, out)
