"""Drawing with quotas: unbiased, whatever the allocation, and the labels' shares kept exactly."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from filters.strata import draw

WEIGHTS = np.array([0.1, 0.3, 0.05, 0.2, 0.25, 0.02, 0.08], np.float32)
LABELS = np.array([0, 1, 0, 1, 2, 2, 0], np.int32)


def drawn(uniform: float, quotas: list[int]) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    ancestors = np.empty(sum(quotas), np.int32)
    worth = draw(WEIGHTS, LABELS, np.array(quotas, np.int64), uniform, ancestors)
    return ancestors, worth


@pytest.mark.parametrize("quotas", [[3, 3, 3], [1, 10, 2], [20, 1, 1]])
def test_it_is_unbiased_with_any_allocation(quotas: list[int]) -> None:
    """The expected worth of each particle's copies is its weight.

    Systematic within each label: the number of copies is one of two neighbours, so its variance is 1/4 at most, and the
    bound of five standard deviations is broken once in 10^5 runs of this test. Seeded.
    """
    total, runs = np.zeros(WEIGHTS.size), 4_000
    worths = np.zeros(3)
    for uniform in 1.0 - np.random.default_rng(1).random(runs):
        ancestors, worth = drawn(float(uniform), quotas)
        worths = np.exp(worth.astype(np.float64))
        np.add.at(total, ancestors, worths[LABELS[ancestors]])
    assert np.all(np.abs(total / runs - WEIGHTS) <= 5.0 * 0.5 * worths[LABELS] / np.sqrt(runs))


@pytest.mark.parametrize("uniform", [1e-6, 0.37, 1.0])
def test_quotas_and_shares_are_kept_exactly(uniform: float) -> None:
    quotas = [4, 2, 5]
    ancestors, worth = drawn(uniform, quotas)
    assert np.bincount(LABELS[ancestors], minlength=3).tolist() == quotas
    assert np.all(np.diff(ancestors) >= 0)
    for label in range(3):
        assert quotas[label] * np.exp(worth[label]) == pytest.approx(WEIGHTS[label == LABELS].sum(), rel=1e-6)


def test_a_label_without_quota_gives_nothing() -> None:
    ancestors, _ = drawn(0.5, [6, 0, 2])
    assert 1 not in LABELS[ancestors]


@pytest.mark.parametrize(
    ("quotas", "ancestors", "said"),
    [
        ([1, 1, 1], 4, "sum to"),
        ([0, 0, 0], 0, "at least 1"),
        ([5, -1, 0], 4, "do not fit"),
        ([1, 1, 1, 1], 4, "do not fit"),
    ],
)
def test_refuses_quotas_that_cannot_be_met(quotas: list[int], ancestors: int, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        draw(WEIGHTS, LABELS, np.array(quotas, np.int64), 0.5, np.empty(ancestors, np.int32))


def test_refuses_too_few_labels() -> None:
    with pytest.raises(ValueError, match="a label for each of 7"):
        draw(WEIGHTS, LABELS[:5], np.array([1, 1, 1], np.int64), 0.5, np.empty(3, np.int32))
