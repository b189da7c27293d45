"""Resampling schemes, with one signature for the family: ``(weights, count, uniform) -> ancestors``.

A scheme says which particle each new one is a copy of. All are unbiased: source i has ``count * weights[i] / sum``
copies on average. They differ in how far a draw strays from that (Douc, Cappé and Moulines, "Comparison of resampling
schemes for particle filtering", ISPA 2005): stratified, residual and systematic resampling stay nearer than
independent draws do. Each takes time proportional to sources and draws together; the target count may differ from
the source's. The ancestors ascend; who lays the copies out decides their order.

``uniform`` is one number in (0, 1], and all the chance there is. Table 4.4 uses it as it is. A scheme that needs a
number per draw hashes it to the key of a counter-based stream (:func:`numbers` shows them), so the same number gives
the same ancestors, and no scheme needs an array of them.

=====================  =======================================================================================
:func:`multinomial`    independent draws: Table 4.3, lines 8 to 11
:func:`stratified`     one draw from each of N equal stretches of the cumulative weight
:func:`systematic`     the same place in each stretch: Table 4.4, Low_variance_sampler
:func:`residual`       floor(N w) copies without chance, the rest independently
:class:`ByHypothesis`  two stages: how many for each label, then within each (stratified sampling of section 4.3.4)
=====================  =======================================================================================
"""

from __future__ import annotations

import math
import struct
from types import MappingProxyType
from typing import Final, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from filters.kernels import resampling as kernels
from filters.kernels import schemes
from filters.kernels.compile import Float32Array, Int32Array
from filters.kernels.random import mix


class Resampler(Protocol):
    """The named requirement of a scheme.

    Parameters
    ----------
    weights : (n,) float32
        Not negative, not necessarily normalised, with a positive finite sum.
    count : int
        How many to draw, at least 1.
    uniform : float
        The random number, in (0, 1].
    ancestors : (count,) int32, optional
        Where to write them; allocated if not given.

    Returns
    -------
    (count,) int32
        Indices into ``weights``, ascending; none of a source without weight.

    Raises
    ------
    ValueError
        A count below 1, a uniform outside (0, 1], a weight that is negative, or weights whose sum is not positive and
        finite.
    """

    def __call__(
        self, weights: ArrayLike, count: int, uniform: float, ancestors: Int32Array | None = None
    ) -> Int32Array:
        """Draw ``count`` ancestors."""
        ...


def systematic(
    weights: ArrayLike, count: int, uniform: float, ancestors: Int32Array | None = None
) -> Int32Array:
    """Draw with one random number: Table 4.4, Low_variance_sampler, with equation 4.37.

    ``uniform`` is the table's r times M; zero would choose a first particle of weight zero. Source i has floor or
    ceiling of ``count * weights[i] / sum`` copies. See :class:`Resampler`.
    """
    source, total, drawn = _prepared("systematic", weights, count, uniform, ancestors)
    kernels.systematic(source, total, uniform, drawn)
    return drawn


def multinomial(
    weights: ArrayLike, count: int, uniform: float, ancestors: Int32Array | None = None
) -> Int32Array:
    """Draw independently, as lines 8 to 11 of Table 4.3 say; sorted by exponential spacings. See :class:`Resampler`.

    The copies have the multinomial distribution, with variance N w (1 - w): the most of the family.
    """
    source, total, drawn = _prepared("multinomial", weights, count, uniform, ancestors)
    schemes.multinomial(source, total, *_keys(uniform), drawn)
    return drawn


def stratified(
    weights: ArrayLike, count: int, uniform: float, ancestors: Int32Array | None = None
) -> Int32Array:
    """Draw once from each of ``count`` equal stretches of the cumulative weight. See :class:`Resampler`."""
    source, total, drawn = _prepared("stratified", weights, count, uniform, ancestors)
    schemes.stratified(source, total, *_keys(uniform), drawn)
    return drawn


def residual(
    weights: ArrayLike, count: int, uniform: float, ancestors: Int32Array | None = None
) -> Int32Array:
    """Copy floor(N w) times, and draw the rest from what that leaves of N w. See :class:`Resampler`.

    What is subtracted is subtracted from N w, not from w: the remainders N w - floor(N w) are the chances of the rest
    (Liu and Chen, "Sequential Monte Carlo methods for dynamic systems", JASA 93(443), 1998).
    """
    source, total, drawn = _prepared("residual", weights, count, uniform, ancestors)
    schemes.residual(source, total, *_keys(uniform), drawn)
    return drawn


SCHEMES: Final = MappingProxyType[str, Resampler](
    {
        "multinomial": multinomial,
        "stratified": stratified,
        "systematic": systematic,
        "residual": residual,
    }
)
"""The schemes by name."""


class ByHypothesis:
    """Stratified sampling by hypothesis: each label's share first, then draws within it (section 4.3.4).

    The labels' counts are drawn by Table 4.4 from their sums of weight, so each has floor or ceiling of its share, and
    a hypothesis that is worth a particle does not die by chance. Within each, Table 4.4 again, with a random number of
    its own. It is a :class:`Resampler` for the one set that the labels belong to.

    Parameters
    ----------
    labels : (n,) int
        Which hypothesis each particle belongs to, from 0.

    Raises
    ------
    ValueError
        Labels that are not one-dimensional, not whole numbers or negative.
    """

    def __init__(self, labels: ArrayLike) -> None:
        given = np.asarray(labels)
        if given.ndim != 1 or not np.issubdtype(given.dtype, np.integer):
            raise ValueError(
                f"by hypothesis: labels must be (n,) whole numbers, got {given.dtype} of shape {given.shape}"
            )
        if given.size > 0 and given.min() < 0:
            raise ValueError(f"by hypothesis: labels count from 0, got {given.min()}")
        self._labels = np.ascontiguousarray(given, np.int32)

    def __call__(
        self, weights: ArrayLike, count: int, uniform: float, ancestors: Int32Array | None = None
    ) -> Int32Array:
        """Draw; see :class:`Resampler`. Also raises ``ValueError`` if there are not as many labels as weights."""
        source, _, drawn = _prepared("by hypothesis", weights, count, uniform, ancestors)
        if source.size != self._labels.size:
            raise ValueError(
                f"by hypothesis: as many labels as weights, got {self._labels.size} and {source.size}"
            )
        masses = np.bincount(self._labels, weights=source).astype(np.float64)
        own = numbers(uniform, masses.size + 1)
        quotas = _quotas(masses, count, own[-1])
        schemes.within(source, self._labels, quotas, masses, own[:-1], drawn)
        return drawn


def numbers(uniform: float, count: int) -> NDArray[np.float64]:
    """Return the first ``count`` numbers in (0, 1) of the stream that ``uniform`` stands for.

    Stratified resampling puts number m into stretch m. Multinomial resampling takes -log of ``count + 1`` of them as
    the gaps between its draws, and residual resampling the same for the draws it has left.
    """
    out = np.empty(count)
    schemes.numbers(*_keys(uniform), out)
    return out


def _quotas(masses: NDArray[np.float64], count: int, uniform: float) -> NDArray[np.int64]:
    """Table 4.4 over the labels' masses: how many draws each label gets."""
    ends = np.floor(np.cumsum(masses) * (count / masses.sum()) + 1.0 - uniform).astype(np.int64)
    ends[np.flatnonzero(masses)[-1] :] = count
    return np.diff(np.minimum(ends, count), prepend=0)


def _keys(uniform: float) -> tuple[int, int]:
    """Two words of key from the bits of a number."""
    key = mix(struct.unpack("<Q", struct.pack("<d", uniform))[0])
    return key >> 32, key & 0xFFFFFFFF


def _prepared(
    scheme: str, weights: ArrayLike, count: int, uniform: float, ancestors: Int32Array | None
) -> tuple[Float32Array, float, Int32Array]:
    """Check what every scheme is given; return the weights, their sum and where to write."""
    source: Float32Array = np.ascontiguousarray(weights, np.float32)
    if count < 1:
        raise ValueError(f"{scheme} resampling: count must be at least 1, got {count}")
    if not 0.0 < uniform <= 1.0:
        raise ValueError(f"{scheme} resampling: uniform must lie in (0, 1], got {uniform}")
    if source.ndim != 1:
        raise ValueError(f"{scheme} resampling: weights must be (n,), got shape {source.shape}")
    total = kernels.total(source)
    if not 0.0 < total < math.inf:
        raise ValueError(
            f"{scheme} resampling: the weights must have a positive finite sum, got {total} from {source.size}"
        )
    if source.min() < 0.0:
        raise ValueError(f"{scheme} resampling: no weight may be negative, got {source.min()}")
    if ancestors is None:
        ancestors = np.empty(count, np.int32)
    elif ancestors.shape != (count,):
        raise ValueError(f"{scheme} resampling: ancestors must be ({count},), got {ancestors.shape}")
    return source, total, ancestors
