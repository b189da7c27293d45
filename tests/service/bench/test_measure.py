"""What fits into a budget, on a machine whose cost is a line."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from service.bench.command import figures
from service.bench.measure import Point, affordable, shapes
from service.cli.application import application

OVERHEAD, SLOPE = 500e-6, 20e-9


def line(counts: tuple[int, ...] = (200, 1_000, 10_000, 100_000)) -> list[Point]:
    return [
        Point(count, {"motion": OVERHEAD + SLOPE * count}, OVERHEAD + SLOPE * count, 0.0, 1.0)
        for count in counts
    ]


@pytest.mark.parametrize("budget", [0.6e-3, 1e-3, 2.4e-3, 4e-3, 20e-3])
def test_what_is_afforded_costs_the_budget(budget: float) -> None:
    """Closed form: (budget - overhead) / slope, between the points, and beyond the last."""
    assert affordable(line(), budget) == pytest.approx((budget - OVERHEAD) / SLOPE, abs=1)


def test_less_than_the_least_affords_nothing() -> None:
    assert affordable(line(), 0.5e-3) == 0


def test_a_stage_is_a_line() -> None:
    shape = shapes(line())["motion"]
    assert (shape.constant, shape.slope) == pytest.approx((OVERHEAD, SLOPE))


def test_the_figures_are_one_json_object_in_their_units() -> None:
    found = json.loads(json.dumps(figures(line(), [100.0], 0.4)))
    assert found["affords"] == [{"rate": 100.0, "budget_ms": 4.0, "particles": 175_000}]
    assert found["stages"]["motion"] == {"overhead_us": 500.0, "ns_per_particle": 20.0}
    assert [row["particles"] for row in found["counts"]] == [200, 1_000, 10_000, 100_000]


@pytest.mark.parametrize("rates", ["fast", "0", "50,2000"])
def test_wrong_rates_are_wrong_use(rates: str) -> None:
    assert CliRunner().invoke(application, ["bench", "--rates", rates]).exit_code == 2
