"""Every resampling scheme: expectation, variance, references in numpy, and what breaks resamplers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

from filters.resampling import (
    SCHEMES,
    ByHypothesis,
    Resampler,
    multinomial,
    numbers,
    residual,
    stratified,
    systematic,
)

Array = NDArray[Any]


class InThree:
    """Stratified by hypothesis, with label i mod 3."""

    def __call__(self, weights: Any, count: int, uniform: float, ancestors: Any = None) -> Array:
        return ByHypothesis(np.arange(len(weights)) % 3)(weights, count, uniform, ancestors)


FAMILY: dict[str, Resampler] = {**SCHEMES, "by hypothesis": InThree()}
everyone = pytest.mark.parametrize("scheme", FAMILY.values(), ids=FAMILY.keys())
weight_lists = st.lists(
    st.one_of(st.just(0.0), st.floats(2.0**-60, 1.0, width=32)), min_size=1, max_size=60
).filter(lambda weights: sum(weights) > 0.0)
uniforms = st.floats(1e-9, 1.0)


def some_weights(size: int) -> Array:
    """Uneven weights, one of them zero where there are enough."""
    weights = np.random.default_rng(size).exponential(size=size).astype(np.float32)
    if size > 3:
        weights[2] = 0.0
    return weights


def batches(scheme: Resampler, weights: Array, count: int, runs: int, seed: int = 1) -> Array:
    """Copies of each source in each run, (runs, n)."""
    draws = 1.0 - np.random.default_rng(seed).random(runs)
    return np.array([np.bincount(scheme(weights, count, u), minlength=weights.size) for u in draws])


# ---- expectation


@everyone
@pytest.mark.parametrize(("size", "count"), [(2, 1), (5, 5), (8, 3), (8, 40), (30, 31)])
def test_it_is_unbiased(scheme: Resampler, size: int, count: int) -> None:
    """Chi-square over 1,500 batches (Hotelling, with the copies' own covariance): 25 tests of 1e-7.

    Where the copies do not vary (weights without copies, sums), the mean must be exact.
    """
    runs, weights = 1500, some_weights(size)
    copies = batches(scheme, weights, count, runs)
    expected = count * weights.astype(float) / weights.astype(float).sum()
    away = copies.mean(axis=0) - expected
    values, vectors = np.linalg.eigh(np.cov(copies.T))
    varies = values > 1e-3
    statistic = float(runs * ((vectors.T @ away)[varies] ** 2 / values[varies]).sum())
    assert statistic < stats.chi2.ppf(1.0 - 1e-7, varies.sum())
    assert np.abs((vectors.T @ away)[~varies]).max(initial=0.0) < 0.02


# ---- variance


def linear_variance(name: str, w: Array, count: int, value: Array) -> float:
    """Variance of Σ copies · value in closed form (Douc, Cappé and Moulines 2005), w normalised."""
    if name == "multinomial":
        return count * (w @ value**2 - (w @ value) ** 2)
    if name == "residual":
        rest = count * w - np.floor(count * w)
        r = rest / rest.sum()
        return rest.sum() * (r @ value**2 - (r @ value) ** 2)
    edges = np.concatenate([[0.0], np.cumsum(w)]) * count
    total = 0.0
    for m in range(count):  # stratified: the share of each source in each stretch
        share = np.maximum(0.0, np.minimum(edges[1:], m + 1) - np.maximum(edges[:-1], m))
        total += share @ value**2 - (share @ value) ** 2
    return total


@pytest.mark.parametrize("name", ["multinomial", "stratified", "residual"])
@pytest.mark.parametrize(("size", "count"), [(6, 6), (12, 30)])
def test_its_variance_is_the_closed_form(name: str, size: int, count: int) -> None:
    """Of a linear statistic over 3,000 runs, within 5 standard deviations of the sample variance: 6 tests, 4e-6."""
    weights, value = some_weights(size), np.random.default_rng(9).normal(size=size)
    sums = batches(SCHEMES[name], weights, count, 3000, seed=2) @ value
    exact = linear_variance(name, weights.astype(float) / weights.astype(float).sum(), count, value)
    fourth = float(np.mean((sums - sums.mean()) ** 4))
    assert abs(sums.var() - exact) < 5.0 * math.sqrt((fourth - sums.var() ** 2) / 3000)


@given(weight_lists, st.integers(1, 60), st.integers(0, 1000))
@settings(max_examples=60, deadline=None)
def test_variances_are_ordered_as_theory_says(weights: list[float], count: int, seed: int) -> None:
    """Stratified and residual are never above multinomial, whatever is summed: the formulas that the test above ties
    to the code."""
    w = np.array(weights) / sum(weights)
    value = np.random.default_rng(seed).normal(size=w.size)
    most = linear_variance("multinomial", w, count, value)
    assert linear_variance("stratified", w, count, value) <= most + 1e-9 * (1 + most)
    rest = count * w - np.floor(count * w)
    if rest.sum() > 1e-9:
        assert linear_variance("residual", w, count, value) <= most + 1e-9 * (1 + most)


def test_systematic_copies_vary_least_of_all() -> None:
    """Each source's copies have variance f (1 - f), f the fraction of N w: no whole number of that mean has less."""
    weights, count, grid = some_weights(9), 14, (np.arange(3000) + 0.5) / 3000
    copies = np.array([np.bincount(systematic(weights, count, u), minlength=9) for u in grid])
    fraction = count * weights.astype(float) / weights.astype(float).sum() % 1.0
    np.testing.assert_allclose(copies.var(axis=0), fraction * (1 - fraction), atol=2e-3)
    for other in (multinomial, stratified, residual):
        assert (copies.var(axis=0) <= batches(other, weights, count, 3000).var(axis=0) + 0.05).all()


# ---- references in numpy, with the same numbers


def sorted_uniforms(uniform: float, count: int) -> Array:
    gaps = np.cumsum(-np.log(numbers(uniform, count + 1)))
    return gaps[:-1] / gaps[-1]


def inverse(weights: Array, places: Array) -> Array:
    cumulative = np.cumsum(weights.astype(np.float64))
    return np.searchsorted(cumulative, places * cumulative[-1], side="left")


@given(weight_lists, st.integers(1, 100), uniforms)
@settings(max_examples=150, deadline=None)
def test_it_is_the_plain_numpy_resampler(weights: list[float], count: int, uniform: float) -> None:
    array = np.array(weights, np.float32)
    assert np.array_equal(multinomial(array, count, uniform), inverse(array, sorted_uniforms(uniform, count)))
    places = (np.arange(count) + numbers(uniform, count)) / count
    assert np.array_equal(stratified(array, count, uniform), inverse(array, places))


def test_residual_is_the_plain_one() -> None:
    """floor(N w) of each, then independent draws from N w - floor(N w): not from w - floor(N w)."""
    for size, count, uniform in ((5, 7, 0.3), (40, 40, 0.7), (40, 1000, 0.01), (200, 11, 1.0)):
        weights = some_weights(size)
        expected = count * weights.astype(float) / weights.astype(float).sum()
        copies = np.floor(expected).astype(int)
        rest = count - copies.sum()
        drawn = inverse(expected - copies, sorted_uniforms(uniform, rest))
        reference = np.sort(np.concatenate([np.repeat(np.arange(size), copies), drawn]))
        assert np.array_equal(residual(weights, count, uniform), reference)


def test_sorted_uniforms_are_uniform() -> None:
    """The numbers behind the schemes, by Kolmogorov and Smirnov: false alarm 1e-6 each."""
    many = numbers(0.123, 100_000)
    assert many.min() > 0.0
    assert many.max() < 1.0
    assert stats.kstest(many, "uniform").pvalue > 1e-6
    assert stats.kstest(sorted_uniforms(0.321, 100_000), "uniform").pvalue > 1e-6
    assert np.abs(np.corrcoef(many[:-1], many[1:])[0, 1]) < 5.0 / math.sqrt(many.size)
    assert not np.array_equal(numbers(0.5, 10), numbers(math.nextafter(0.5, 1.0), 10))


# ---- properties


@pytest.mark.interpreted
@everyone
@given(weights=weight_lists, count=st.integers(1, 100), uniform=uniforms)
@settings(max_examples=60, deadline=None)
def test_ancestors_ascend_and_have_weight(
    scheme: Resampler, weights: list[float], count: int, uniform: float
) -> None:
    array = np.array(weights, np.float32)
    ancestors = scheme(array, count, uniform)
    assert ancestors.dtype == np.int32
    assert ancestors.shape == (count,)
    assert (np.diff(ancestors) >= 0).all()
    assert (array[ancestors] > 0.0).all()
    assert np.array_equal(ancestors, scheme(array.astype(np.float64), count, uniform))


@pytest.mark.interpreted
@given(weight_lists, st.integers(1, 200), uniforms)
@settings(max_examples=100, deadline=None)
def test_copies_keep_to_their_bounds(weights: list[float], count: int, uniform: float) -> None:
    array = np.array(weights, np.float32)
    expected = count * array.astype(float) / array.astype(float).sum()
    strata = np.bincount(stratified(array, count, uniform), minlength=array.size)
    assert (np.abs(strata - expected) < 2.0 + 1e-9).all()
    certain = np.bincount(residual(array, count, uniform), minlength=array.size)
    assert (certain >= np.floor(expected - 1e-9)).all()


@pytest.mark.interpreted
@given(weight_lists, st.integers(1, 200), uniforms, st.integers(1, 5), st.integers(0, 99))
@settings(max_examples=150, deadline=None)
def test_every_hypothesis_gets_its_share(
    weights: list[float], count: int, uniform: float, hypotheses: int, seed: int
) -> None:
    array = np.array(weights, np.float32)
    labels = np.random.default_rng(seed).integers(0, hypotheses, array.size)
    copies = np.bincount(ByHypothesis(labels)(array, count, uniform), minlength=array.size)
    masses = np.bincount(labels, weights=array, minlength=hypotheses)
    of_labels = np.bincount(labels, weights=copies, minlength=hypotheses)
    assert (np.abs(of_labels - count * masses / masses.sum()) < 1.0 + 1e-9).all()
    for label in np.flatnonzero(
        of_labels
    ):  # Table 4.4 within: floor or ceiling of the share of the label's draws
        own = labels == label
        share = of_labels[label] * array[own].astype(float) / masses[label]
        assert (np.abs(copies[own] - share) < 1.0 + 1e-9).all()


@given(st.integers(1, 3000), st.floats(1e-6, 1.0 - 1e-6), st.floats(2.0**-60, 2.0**60, width=32))
@settings(max_examples=100, deadline=None)
def test_equal_weights_are_reproduced(size: int, uniform: float, weight: float) -> None:
    """Table 4.4 and residual resampling lose nothing where nothing was learned; so each hypothesis, if all are."""
    weights = np.full(size, weight, np.float32)
    assert np.array_equal(systematic(weights, size, uniform), np.arange(size))
    if size < 100:
        assert np.array_equal(stratified(weights, size, uniform), np.arange(size))


def test_equal_weights_lose_a_third_by_independent_draws() -> None:
    """1 / e of the sources: 4,000 of 10,000 would be 7 standard deviations off."""
    lost = 1.0 - np.unique(multinomial(np.ones(10_000), 10_000, 0.4)).size / 10_000
    assert 0.35 < lost < 0.39


# ---- what breaks resamplers


@pytest.mark.interpreted
@everyone
@pytest.mark.parametrize("place", [0, 3, 9])
def test_one_hot(scheme: Resampler, place: int) -> None:
    weights = np.zeros(10, np.float32)
    weights[place] = 1e-20
    for uniform in (1e-12, 0.5, 1.0):
        assert (scheme(weights, 25, uniform) == place).all()


@everyone
def test_a_float32_sum_that_ends_below_one(scheme: Resampler) -> None:
    weights = np.full(100_000, 1e-5, np.float32)
    weights[-1000:] = 0.0
    assert np.cumsum(weights, dtype=np.float32)[-1] != 1.0
    for uniform in (1e-15, 0.25, 1.0):
        ancestors = scheme(weights, 100_000, uniform)
        assert ancestors.max() <= 98_999
        assert ancestors.min() >= 0


@everyone
def test_ten_million_float32_weights(scheme: Resampler) -> None:
    """Draws per hundredth of the sources: within 6 standard deviations of independent draws, the widest of all."""
    size, count = 10_000_000, 1_000_000
    weights = np.random.default_rng(1).random(size, np.float32)
    weights[::3] *= np.float32(1e-6)
    ancestors = scheme(weights, count, 0.37)
    assert (np.diff(ancestors) >= 0).all()
    shares = weights.reshape(100, -1).sum(axis=1, dtype=np.float64)
    expected = count * shares / shares.sum()
    drawn = np.bincount(ancestors // (size // 100), minlength=100)
    assert (np.abs(drawn - expected) < 6.0 * np.sqrt(expected)).all()


@everyone
@pytest.mark.parametrize(
    ("weights", "count", "uniform", "what"),
    [
        ([1.0], 0, 0.5, "count"),
        ([1.0], 1, 0.0, "uniform"),
        ([1.0], 1, 1.5, "uniform"),
        ([0.0, 0.0], 1, 0.5, "positive finite sum, got 0.0 from 2"),
        ([math.nan], 1, 0.5, "sum"),
        ([math.inf], 1, 0.5, "sum"),
        ([], 1, 0.5, "sum"),
        ([2.0, -1.0], 1, 0.5, "negative"),
    ],
)
def test_what_cannot_be_resampled_is_refused(
    scheme: Resampler, weights: list[float], count: int, uniform: float, what: str
) -> None:
    with pytest.raises(ValueError, match=what):
        scheme(np.array(weights, np.float32), count, uniform)


def test_arrays_of_another_shape_are_refused() -> None:
    with pytest.raises(ValueError, match="shape"):
        systematic(np.ones((2, 2)), 1, 0.5)
    with pytest.raises(ValueError, match="ancestors"):
        systematic(np.ones(2), 3, 0.5, np.zeros(2, np.int32))
    with pytest.raises(ValueError, match="as many labels"):
        ByHypothesis([0, 1])(np.ones(3), 3, 0.5)


@pytest.mark.parametrize("labels", [[0.5, 1.0], [[0, 1]], [-1, 0]])
def test_labels_are_whole_numbers(labels: Any) -> None:
    with pytest.raises(ValueError, match="by hypothesis"):
        ByHypothesis(labels)


def test_a_label_without_weight_is_left_out() -> None:
    ancestors = ByHypothesis([0, 1, 2, 3, 3])([0.0, 1.0, 0.0, 1.0, 0.0], 10, 0.5)
    assert np.bincount(ancestors, minlength=5).tolist() == [0, 5, 0, 5, 0]


def test_ancestors_are_written_where_told() -> None:
    place = np.zeros(6, np.int32)
    for scheme in FAMILY.values():
        assert scheme(np.ones(3), 6, 0.5, place) is place
