"""Mixing against a mixture written out, and what it must leave alone."""

from __future__ import annotations

import numpy as np
import pytest

from filters.linearised.bank import GaussianBank
from filters.linearised.interacting import mix
from filters.motion.unicycle import Unicycle

TRANSITION = np.array([[0.9, 0.1], [0.3, 0.7]])
BELIEF = np.array([0.6, 0.4])


def _bank(headings: tuple[float, float] = (0.2, 0.5)) -> GaussianBank:
    chance = np.random.default_rng(3)
    bank = GaussianBank(Unicycle(0.1, 0.02, 1e-3, 1e-3), members=2)
    for member, heading in enumerate(headings):
        root = chance.normal(size=(5, 5))
        mean = chance.normal(size=5)
        mean[2] = heading
        bank.set(member, mean, root @ root.T)
    return bank


def test_each_member_becomes_the_moments_of_its_mixture() -> None:
    bank = _bank()
    means, covariances = bank.mean.copy(), bank.covariance.copy()
    mix(bank, TRANSITION, BELIEF)
    for j in range(2):
        shares = TRANSITION[:, j] * BELIEF / (TRANSITION[:, j] @ BELIEF)
        mean = shares @ means
        second = sum(w * (c + np.outer(m, m)) for w, c, m in zip(shares, covariances, means, strict=True))
        np.testing.assert_allclose(bank.mean[j], mean, atol=1e-12)
        np.testing.assert_allclose(bank.covariance[j], second - np.outer(mean, mean), atol=1e-12)


def test_headings_mix_across_the_cut() -> None:
    bank = _bank((3.1, -3.1))
    mix(bank, np.full((2, 2), 0.5), np.array([0.5, 0.5]))
    assert abs(bank.mean[0, 2]) == pytest.approx(np.pi)
    assert bank.mean[0, 2] == bank.mean[1, 2]


def test_nothing_mixes_where_no_model_turns_into_another() -> None:
    bank = _bank()
    means, covariances = bank.mean.copy(), bank.covariance.copy()
    mix(bank, np.eye(2), np.array([1.0, 0.0]))
    np.testing.assert_allclose(bank.mean, means, atol=1e-15)
    np.testing.assert_allclose(bank.covariance, covariances, atol=1e-15)


def test_refuses_shapes_and_beliefs_that_do_not_fit() -> None:
    with pytest.raises(ValueError, match="a transition of 2 models"):
        mix(_bank(), np.eye(3), BELIEF)
    with pytest.raises(ValueError, match="a transition of 2 models"):
        mix(_bank(), np.eye(2), np.zeros(2))
