"""Samples of log weights, and evidence from them, against numpy and scipy."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from filters.kernels.evidence import account_for, thin


@pytest.mark.interpreted
@pytest.mark.parametrize("stride", [1, 2, 7])
@pytest.mark.parametrize("cuts", [(0, 1000), (0, 256, 1000), (0, 333, 334, 999, 1000)])
def test_every_part_keeps_its_own(stride: int, cuts: tuple[int, ...]) -> None:
    logs = np.random.default_rng(1).normal(size=1000).astype(np.float32)
    sample = np.full(-(-1000 // stride), np.nan, np.float32)
    for first, last in pairwise(cuts):
        thin(logs, first, last, stride, sample)
    assert np.array_equal(sample, logs[::stride])


@pytest.mark.interpreted
def test_evidence_is_a_chain_of_ratios() -> None:
    samples = np.random.default_rng(2).normal(-3.0, 2.0, (4, 60)).astype(np.float32)
    said = np.array([[0.5, 7.0], [-1.0, 8.0], [2.0, 9.0], [0.0, 0.0]])
    after = account_for(samples, 3, 50, 1.25, said)
    sums = np.array([1.25, *np.log(np.exp(samples[:3, :50].astype(np.float64)).sum(axis=1))])
    np.testing.assert_allclose(said[:3, 0], np.array([0.5, -1.0, 2.0]) + np.diff(sums), atol=2e-5)
    assert after == pytest.approx(sums[-1], abs=2e-5)
    assert said[:, 1].tolist() == [7.0, 8.0, 9.0, 0.0]


def test_what_nothing_explains_has_no_evidence() -> None:
    samples = np.full((1, 5), -np.inf, np.float32)
    said = np.zeros((1, 2))
    assert account_for(samples, 1, 5, 0.0, said) == -math.inf
    assert said[0, 0] == -math.inf
