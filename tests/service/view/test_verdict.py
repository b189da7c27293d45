"""The verdict at the end of the demonstration: figures with a closed form, and every way to fail."""

from __future__ import annotations

import io
import math
from pathlib import Path

import msgspec
import pytest
from rich.console import Console

from service.config import Configuration
from service.estimate import Estimate, HealthState, LinkStatus, Sensors, SensorStatus
from service.view.verdict import Record, judge
from tests.service.publish.spoken import budget, estimate

RADIUS = 0.3


def configuration() -> Configuration:
    return Configuration.model_validate(
        {
            "vehicle": {"name": "rover"},
            "link": [
                {"name": "autopilot", "kind": "mavlink", "url": "udpin:127.0.0.1:14550"},
                {"name": "bus", "kind": "can", "channel": "vcan0"},
            ],
        }
    )


def told(samples: dict[str, int]) -> Sensors:
    links = [
        LinkStatus(name, "up", "", count, count, {}, {}, 0, 0, 0, "", None, None, None)
        for name, count in samples.items()
    ]
    used = [
        SensorStatus("range/autopilot/1", 5.0, None, 40, {}, 0.0, 0.1),
        SensorStatus("range/autopilot/2", 5.0, None, 2, {}, 0.0, 0.1),
        SensorStatus("position/bus", 5.0, None, 7, {}, 0.0, 0.1),
    ]
    return Sensors(time=0.0, sensors=used, links=links)


def drive(offset: float, count: int = 100) -> tuple[list[Estimate], str]:
    """Return estimates that are ``offset`` metres east of a vehicle going north at 1 m/s, and the truth file.

    The truth is written every 0.5 s, so that most estimates fall between its rows.
    """
    start = 1_700_000_000.0
    estimates = [
        estimate(10 + step, time=start + 0.02 * step, position=(0.02 * step, offset, None), radius95=RADIUS)
        for step in range(count)
    ]
    rows = [f"{start - 1 + 0.5 * row},{-1 + 0.5 * row},0.0,0.0,0.0" for row in range(20)]
    return estimates, "\n".join(["time_s,north_m,east_m,down_m,heading_rad", *rows]) + "\n"


@pytest.fixture
def record() -> Record:
    record = Record()
    record.take("budget", msgspec.json.encode(budget()))
    record.take("budget", msgspec.json.encode(msgspec.structs.replace(budget(), use=0.44)))
    record.take("sensors", msgspec.json.encode(told({"autopilot": 500, "bus": 70})))
    return record


def test_a_good_run_has_its_figures(record: Record, tmp_path: Path) -> None:
    """A constant offset of 0.2 m: that is the RMSE, and it is inside a radius of 0.3 m."""
    estimates, truth = drive(0.2)
    for value in estimates:
        record.take("estimate", msgspec.json.encode(value))
    path = tmp_path / "truth.csv"
    path.write_text(truth)
    verdict = judge(record, configuration(), path)
    assert verdict.failures == ()
    assert (verdict.estimates, verdict.lost) == (100, 0)
    assert verdict.score.rmse_m == pytest.approx(0.2)
    assert verdict.score.max_m == pytest.approx(0.2)
    assert verdict.within_radius == 1.0
    assert verdict.use == pytest.approx(0.43)
    assert verdict.health == {"tracking": 1.0}
    assert verdict.samples == {"autopilot": 500, "bus": 70}
    assert verdict.used == {"autopilot": 42, "bus": 7}
    out = io.StringIO()
    Console(file=out, width=80).print(verdict.table())
    for fact in (
        "0.20 m RMSE",
        "100% inside radius95",
        "500 at 50 Hz, 0 missed, 1 over",
        "43% of 4 ms",
        "7 readings",
    ):
        assert fact in out.getvalue(), out.getvalue()


def test_the_radius_is_a_radius(record: Record, tmp_path: Path) -> None:
    """Half of the estimates are just inside of it, half just outside."""
    inside, truth = drive(RADIUS - 0.001, 50)
    outside, _ = drive(RADIUS + 0.001, 50)
    record.estimates = inside + outside
    path = tmp_path / "truth.csv"
    path.write_text(truth)
    assert judge(record, configuration(), path).within_radius == pytest.approx(0.5)


def test_gaps_and_unknown_positions_are_told(record: Record, tmp_path: Path) -> None:
    estimates, truth = drive(0.0)
    blind = msgspec.structs.replace(
        estimates[0], position=(None, None, None), radius95=None, health=HealthState.WAITING
    )
    record.estimates = [blind, *estimates[1:40], *estimates[60:]]
    path = tmp_path / "truth.csv"
    path.write_text(truth)
    verdict = judge(record, configuration(), path)
    assert verdict.lost == 20
    assert verdict.health["waiting"] == pytest.approx(1 / 80)
    assert verdict.score.rmse_m is not None
    assert math.isclose(verdict.score.rmse_m, 0.0, abs_tol=1e-6)


@pytest.mark.parametrize(
    ("offset", "samples", "said"),
    [
        (1.5, {"autopilot": 1, "bus": 1}, "the error of 1.50 m RMSE is more than 1 m"),
        (0.1, {"autopilot": 9, "bus": 0}, "link bus brought no samples"),
        (0.1, {"bus": 9}, "link autopilot brought no samples"),
    ],
)
def test_what_is_not_as_it_should_be_fails(
    offset: float, samples: dict[str, int], said: str, tmp_path: Path
) -> None:
    record = Record()
    record.estimates, truth = drive(offset)
    record.sensors = told(samples)
    path = tmp_path / "truth.csv"
    path.write_text(truth)
    assert judge(record, configuration(), path).failures == (said,)


def test_nothing_at_all_fails_in_every_respect(tmp_path: Path) -> None:
    verdict = judge(Record(), configuration(), tmp_path / "none.csv")
    assert verdict.failures == (
        "no estimate arrived",
        "link autopilot brought no samples",
        "link bus brought no samples",
        "no estimate had a position while the truth was known",
    )
    Console(file=io.StringIO()).print(verdict.table())
