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
        self._summarize = kernels.summarize.direct

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
        names = self._particles.names
        mean, variance, covariance = np.empty(len(names)), np.empty(len(names)), np.empty((_POSE, _POSE))
        if blocks.shared:
            self._share(shift, blocks, mean, variance, covariance)
        else:
            self._summarize(
                self._particles.columns,
                self._weights,
                blocks.bounds,
                *shift,
                self._centre,
                self._reference,
                self._sums,
                mean,
                variance,
                covariance,
            )
        for name, extra in given_path.items():
            if extra > 0.0:
                variance[self._particles.rows[name]] += extra
        # as the constructor makes it, without its call in Python
        return tuple.__new__(Moments, (names, mean, covariance, variance, effective_sample_size))

    def _share(self, shift: Displacement, blocks: Blocks, *out: kernels.Float64Array) -> None:
        """Write the moments with the crew: what ``summarize`` does alone."""
        forward, right, turn = shift
        centre, reference, sums = self._centre, self._reference, self._sums
        columns, weights, bounds = self._particles.columns, self._weights, blocks.bounds

        def add(part: int, first: int, last: int) -> None:
            kernels.sum_blocks.direct(
                columns, weights, bounds, first, last, forward, right, centre, reference, sums
            )

        kernels.displace_reference.direct(centre, forward, right, turn, reference)
        done = False
        while not done:
            blocks.share(add)
            done = kernels.finish.direct(blocks.number, forward, right, centre, reference, sums, *out)
