"""The account of a loop that costs too much: over time it takes what it was granted, and no more."""

from __future__ import annotations

import pytest

from service.debt import GRACE, Debt

BUDGET, PERIOD = 4e-3, 10e-3


def share(cost: float, ticks: int) -> tuple[float, int]:
    """Return the share of the budget that ticks of ``cost`` took, and the longest rest."""
    debt, periods, longest, rest = Debt(BUDGET, PERIOD), 0, 0, 0
    for _ in range(ticks):
        periods += 1 + rest
        rest = debt.charge(cost, 1 + rest)
        longest = max(longest, rest)
    return ticks * cost / (periods * BUDGET), longest


@pytest.mark.parametrize("factor", [1.1, 2.0, 5.0, 40.0])
def test_takes_what_it_was_granted(factor: float) -> None:
    """Within 5 % over a thousand ticks, however dear each of them is."""
    taken, _ = share(factor * BUDGET, 1_000)
    assert 0.9 <= taken <= 1.05


def test_a_rest_has_an_end() -> None:
    """Ticks of one second each: rests of half a second, so that a sign of life comes in time."""
    _, longest = share(1.0, 100)
    assert longest == 50


def test_ticks_within_the_budget_never_rest() -> None:
    assert share(BUDGET, 1_000) == (1.0, 0)


def test_single_dear_ticks_are_forgiven() -> None:
    debt = Debt(BUDGET, PERIOD)
    assert debt.charge(GRACE * BUDGET, 1) == 0
    assert [debt.charge(0.5 * BUDGET, 1) for _ in range(20)] == [0] * 20
    assert debt.charge(GRACE * BUDGET, 1) == 0


def test_missed_ticks_grant_their_budget() -> None:
    assert Debt(BUDGET, PERIOD).charge(20 * BUDGET, 20) == 0
    assert Debt(BUDGET, PERIOD).charge(20 * BUDGET, 1) == 11
