"""Systematic resampling against Table 4.4, written out in plain Python."""

from __future__ import annotations

import math
from fractions import Fraction
from random import Random

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from filters.kernels import resampling as kernels
from filters.resampling import systematic

weight_lists = st.lists(
    st.one_of(st.just(0.0), st.floats(2.0**-100, 1.0, width=32)), min_size=1, max_size=60
).filter(lambda weights: sum(weights) > 0.0)
uniforms = st.floats(1e-9, 1.0)


def table_4_4(weights: list[float], count: int, uniform: float) -> list[int]:
    """Low_variance_sampler line by line, in exact arithmetic, for a target count of its own."""
    exact = [Fraction(weight) for weight in weights]
    total = sum(exact)
    step = total / count
    r = Fraction(uniform) * step
    i = 0
    c = exact[0]
    chosen: list[int] = []
    for m in range(count):
        u = r + m * step
        while u > c:
            i += 1
            c += exact[i]
        chosen.append(i)
    return chosen


def near_a_tie(weights: list[float], count: int, uniform: float) -> bool:
    """Whether rounding may decide: a cumulative weight within 1e-9 of a position."""
    total = sum(map(Fraction, weights))
    cumulative = Fraction(0)
    for weight in weights:
        cumulative += Fraction(weight)
        place = float(cumulative * count / total) - uniform
        if abs(place - round(place)) < 1e-9:
            return True
    return False


@pytest.mark.interpreted
@given(weight_lists, st.integers(1, 100), uniforms)
@settings(max_examples=300, deadline=None)
def test_it_is_table_4_4(weights: list[float], count: int, uniform: float) -> None:
    array = np.array(weights, np.float32)
    ancestors = systematic(array, count, uniform).tolist()
    if not near_a_tie(array.tolist(), count, uniform):
        assert ancestors == table_4_4(array.tolist(), count, uniform)


@given(weight_lists, st.integers(1, 100), uniforms)
@settings(max_examples=300, deadline=None)
def test_copies_are_proportional_and_none_without_weight(
    weights: list[float], count: int, uniform: float
) -> None:
    array = np.array(weights, np.float32)
    ancestors = systematic(array, count, uniform)
    assert (np.diff(ancestors) >= 0).all()
    copies = np.bincount(ancestors, minlength=array.size)
    expected = count * array.astype(np.float64) / array.astype(np.float64).sum()
    assert (np.abs(copies - expected) < 1.0 + 1e-9).all()
    assert (copies[array == 0.0] == 0).all()


def test_it_is_unbiased() -> None:
    """Averaged over an even grid of uniforms, the copies are the expectation: no chance is involved."""
    weights = np.random.default_rng(1).exponential(size=37).astype(np.float32)
    grid = (np.arange(4000) + 0.5) / 4000
    copies = sum(np.bincount(systematic(weights, 50, u), minlength=37) for u in grid) / grid.size
    expected = 50 * weights.astype(float) / weights.astype(float).sum()
    assert np.abs(copies - expected).max() <= 1.0 / grid.size + 1e-9


@pytest.mark.interpreted
@pytest.mark.parametrize("place", [0, 3, 9])
def test_one_hot(place: int) -> None:
    weights = np.zeros(10, np.float32)
    weights[place] = 1e-20
    for uniform in (1e-12, 0.5, 1.0):
        assert (systematic(weights, 25, uniform) == place).all()


@pytest.mark.interpreted
def test_one_particle() -> None:
    assert systematic(np.ones(1, np.float32), 1, 0.3).tolist() == [0]
    assert systematic(np.ones(1, np.float32), 5, 1.0).tolist() == [0] * 5


def test_equal_weights_reproduce_the_set() -> None:
    assert systematic(np.ones(1000, np.float32), 1000, 0.5).tolist() == list(range(1000))


@pytest.mark.parametrize("uniform", [1e-15, 0.25, 1.0 - 1e-16, 1.0])
def test_a_float32_sum_that_ends_below_one(uniform: float) -> None:
    """A million equal float32 weights sum to 1.0000134 or 0.99 in float32, depending on the order."""
    weights = np.full(1_000_000, 1e-6, np.float32)
    weights[-1000:] = 0.0
    ancestors = systematic(weights, 1_000_000, uniform)
    assert ancestors.max() <= 998_999
    assert ancestors.min() >= 0
    assert np.bincount(ancestors).max() <= 2


@pytest.mark.interpreted
def test_what_rounding_leaves_goes_to_the_last_source_with_weight() -> None:
    """A total that the cumulative sum never reaches: the last positions go to no source of weight zero."""
    ancestors = np.zeros(100, np.int32)
    kernels.systematic(np.array([1.0, 1.0, 0.0, 0.0], np.float32), 2.2, 0.5, ancestors)
    assert set(ancestors.tolist()) == {0, 1}


def test_more_and_fewer_than_the_source() -> None:
    weights = np.random.default_rng(3).exponential(size=100).astype(np.float32)
    for count in (1, 7, 99, 101, 5000):
        assert systematic(weights, count, 0.4).tolist() == table_4_4(weights.tolist(), count, 0.4)


@pytest.mark.parametrize(
    ("weights", "count", "uniform", "what"),
    [
        ([1.0], 0, 0.5, "count"),
        ([1.0], 1, 0.0, "uniform"),
        ([1.0], 1, math.nan, "uniform"),
        ([0.0, 0.0], 1, 0.5, "sum"),
        ([math.nan], 1, 0.5, "sum"),
        ([math.inf], 1, 0.5, "sum"),
        ([], 1, 0.5, "sum"),
    ],
)
def test_what_cannot_be_resampled_is_refused(
    weights: list[float], count: int, uniform: float, what: str
) -> None:
    with pytest.raises(ValueError, match=what):
        systematic(np.array(weights, np.float32), count, uniform)


@pytest.mark.interpreted
@given(st.integers(1, 2000), st.integers(1, 700), st.integers(0, 5))
@settings(deadline=None)
def test_copies_are_dealt_to_the_blocks(count: int, largest: int, seed: int) -> None:
    """Run r of 16 copies goes to block r modulo the number of blocks, whoever deals it."""
    sizes = kernels.block_sizes(count, largest)
    assert sum(sizes) == count
    assert min(sizes) >= 0
    assert max(sizes) < largest + kernels.RUN
    rng = np.random.default_rng(seed)
    source = rng.normal(size=(3, 50)).astype(np.float32)
    ancestors = np.sort(rng.integers(0, 50, count)).astype(np.int32)
    bounds = np.cumsum([0, *sizes])
    runs = -(-count // kernels.RUN)
    target = np.zeros((3, count), np.float32)
    middle = int(rng.integers(0, runs + 1))
    kernels.deal(source, target, ancestors, bounds, middle, runs)
    kernels.deal(source, target, ancestors, bounds, 0, middle)
    hands: list[list[int]] = [[] for _ in sizes]
    for run in range(runs):
        hands[run % len(sizes)] += ancestors[run * kernels.RUN : (run + 1) * kernels.RUN].tolist()
    assert np.array_equal(target, source[:, [i for hand in hands for i in hand]])


@pytest.mark.interpreted
@given(
    hnp.arrays(np.float32, st.integers(1, 300), elements=st.sampled_from([0.0, 1e-6, 0.3, 1.0])),
    st.integers(1, 400),
    st.floats(1e-9, 1.0),
    st.lists(st.integers(0, 300), max_size=4),
    st.randoms(use_true_random=False),
)
@settings(deadline=None)
def test_blocks_may_draw_in_any_order(
    weights: NDArray[np.float32], count: int, uniform: float, cuts: list[int], random: Random
) -> None:
    """Every place is filled, ancestors ascend with floor or ceiling of their share, as the whole would draw them."""
    assume(weights.sum() > 0.0)
    bounds = np.array(sorted([0, weights.size, *(min(cut, weights.size) for cut in cuts)]))
    blocks = list(range(bounds.size - 1))
    masses = np.zeros(len(blocks))
    random.shuffle(blocks)
    for block in blocks:
        kernels.totals(weights, bounds, block, block + 1, masses)
    ancestors = np.full(count + 8, -7, np.int32)
    for block in blocks:
        kernels.systematic_blocks(weights, bounds, block, block + 1, masses, uniform, ancestors[:count])
    assert np.all(ancestors[count:] == -7)
    drawn = ancestors[:count]
    assert np.all(np.diff(drawn) >= 0)
    assert np.all(weights[drawn] > 0.0)
    share = weights.astype(np.float64) * count / weights.sum(dtype=np.float64)
    copies = np.bincount(drawn, minlength=weights.size)
    assert np.all(np.abs(copies - share) < 1.0 + 1e-6)
    assert np.count_nonzero(drawn != systematic(weights, count, uniform)) <= len(blocks)
