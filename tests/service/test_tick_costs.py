"""The governor's memory against the quantile of the same ticks worked out one by one."""

from __future__ import annotations

from math import ceil

import numpy as np
import pytest

from service.tick_costs import EXPECTED, PROBABILITY, WINDOW, Line, TickCosts

NOTHING = Line(0.0, 0.0)


def filled(seed: int) -> tuple[TickCosts, list[tuple[Line, Line, int]]]:
    """Return costs that have seen more ticks than they remember, and what they remember."""
    random = np.random.default_rng(seed)
    ticks: list[tuple[Line, Line, int]] = []
    costs = TickCosts(Line(1.0, 1.0), Line(1.0, 1.0), 3)
    for _ in range(WINDOW + 37):
        values = random.lognormal(0.0, 0.7, 4)
        tick = (
            Line(1e-4 * values[0], 1e-8 * values[1]),
            Line(1e-4 * values[2], 1e-8 * values[3]),
            int(random.integers(1, 6)),
        )
        costs.add(*tick)
        ticks.append(tick)
    return costs, ticks[-WINDOW:]


def rank(values: list[float], probability: float) -> float:
    """Return the smallest value that at least a share ``probability`` does not exceed."""
    return sorted(values)[ceil(probability * len(values)) - 1]


@pytest.mark.parametrize("seed", range(5))
def test_the_three_questions_are_quantiles_over_the_ticks(seed: int) -> None:
    costs, ticks = filled(seed)
    count, room = 3_000, 2e-3
    totals = [rest.at(count) + n * each.at(count) for rest, each, n in ticks]
    assert costs.at(count) == pytest.approx(rank(totals, PROBABILITY), rel=1e-12)
    fitting = [
        (room - rest.constant - n * each.constant) / (rest.slope + n * each.slope) for rest, each, n in ticks
    ]
    assert costs.particles(room) == pytest.approx(
        max(0.0, -rank([-f for f in fitting], PROBABILITY)), rel=1e-9
    )
    weighed = [(room - rest.at(count)) / each.at(count) for rest, each, _ in ticks]
    assert costs.measurements(room, count) == pytest.approx(
        max(0.0, -rank([-w for w in weighed], PROBABILITY)), rel=1e-9
    )


@pytest.mark.parametrize("seed", range(5))
def test_what_is_afforded_costs_the_room(seed: int) -> None:
    """With the count that fits, the high quantile of the cost is the room: the two questions are inverse."""
    costs, _ = filled(seed)
    for room in (2e-3, 5e-3, 50e-3):
        count = costs.particles(room)
        assert costs.at(int(count)) <= room * (1.0 + 1e-9)
        assert costs.at(int(1.01 * count) + 2) >= room


def test_before_the_first_tick_it_is_what_was_expected() -> None:
    costs = TickCosts(Line(1e-3, 1e-7), Line(2e-3, 2e-7), 2)
    assert costs.at(1_000) == pytest.approx(1e-3 + 1e-4 + 2 * (2e-3 + 2e-4))
    assert costs.particles(10e-3) == pytest.approx((10e-3 - 5e-3) / 5e-7)
    assert costs.measurements(10e-3, 1_000) == pytest.approx((10e-3 - 1.1e-3) / 2.2e-3)


def test_what_was_expected_is_replaced_first() -> None:
    """Expected dear, found cheap: after as many ticks as were expected only what was found counts."""
    costs = TickCosts(Line(1.0, 0.0), NOTHING, 1)
    for _ in range(EXPECTED - 1):
        costs.add(Line(1e-3, 0.0), NOTHING, 1)
    assert costs.at(1) == 1e-3, "one exception does not rule"
    costs.add(Line(1e-3, 0.0), NOTHING, 1)
    for _ in range(WINDOW):
        costs.add(Line(5e-3, 0.0), NOTHING, 1)
    assert costs.at(1) == 5e-3


def test_fading_is_the_same_ticks_cheaper() -> None:
    costs, ticks = filled(1)
    before = costs.at(500)
    costs.fade(0.5)
    assert costs.at(500) == pytest.approx(0.5 * before)
    assert costs.particles(1.0) == pytest.approx(filled(1)[0].particles(2.0))
    assert len(ticks) == WINDOW


def test_no_room_is_no_particles() -> None:
    costs = TickCosts(Line(1e-3, 1e-9), NOTHING, 0)
    assert costs.particles(0.5e-3) == 0.0
    assert costs.measurements(0.5e-3, 10) == 0.0
