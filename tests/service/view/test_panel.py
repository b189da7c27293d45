"""The live view: everything is on one screen, at 80 by 24 as well, and what is not known is not invented."""

from __future__ import annotations

import io
import math

import msgspec
import pytest
from rich.cells import cell_len
from rich.console import Console

from service.estimate import HealthState
from service.view.known import Known
from service.view.panel import Screen
from tests.service.publish.spoken import budget, estimate, sensors


def printed(known: Known, columns: int = 80, rows: int = 24, note: str = "") -> list[str]:
    """Return the lines as a terminal of that size would show them."""
    out = io.StringIO()
    Console(file=out, width=columns, height=rows, force_terminal=True, color_system=None).print(
        Screen(known, note)
    )
    return out.getvalue().rstrip("\n").split("\n")


@pytest.fixture
def known() -> Known:
    """Return a vehicle that went in a circle and has told everything."""
    known = Known("mower")
    for step in range(200):
        turn = 2 * math.pi * step / 200
        place = (10 * math.cos(turn), 10 * math.sin(turn), None)
        known.take("estimate", msgspec.json.encode(estimate(step, position=place)))
    known.take("budget", msgspec.json.encode(budget()))
    told = sensors()
    known.take("sensors", msgspec.json.encode(told))
    later = [msgspec.structs.replace(link, messages=link.messages + 240) for link in told.links]
    known.take("sensors", msgspec.json.encode(msgspec.structs.replace(told, time=told.time + 2, links=later)))
    known.beacons = {1: (-15.0, -15.0), 2: (15.0, 15.0)}
    return known


@pytest.mark.parametrize(("columns", "rows"), [(80, 24), (100, 30), (200, 60)])
def test_it_fills_the_screen_and_no_more(known: Known, columns: int, rows: int) -> None:
    lines = printed(known, columns, rows)
    assert len(lines) == rows
    assert max(cell_len(line) for line in lines) <= columns


def test_everything_is_on_the_smallest_screen(known: Known) -> None:
    screen = "\n".join(printed(known, note="50 Hz"))
    for fact in (
        "mower",
        "tracking",
        "ranges and odometry agree",
        "50 Hz",
        "10.00 m",  # north: 10 cos(2 pi 199/200) = 9.9951
        "-0.31 m",  # east: 10 sin(...) = -0.314
        "0.49 m",  # radius95
        "14.3°",  # heading 0.25 rad
        "± 5.7°",  # its variance 0.01
        "1,500 particles of 1,500 demanded",
        "20,000 afforded",
        "42% of 4 ms",
        "level 0: full",
        "autopilot",
        "120",  # messages per second: 240 in 2 s
        "retrying",
        "range/autopilot/5",
        "-0.12",
        "gyro bias",
    ):
        assert fact in screen, fact
    assert screen.count("◆") == 3  # the legend and two beacons
    assert "⠀" in screen


def test_what_is_empty_or_lost_is_not_bad(known: Known) -> None:
    """Fixes without a fix are an outage's normal traffic: beside what is bad, where there is room for it."""
    lines = printed(known, 100, 30)
    heading = next(line for line in lines if "empty" in line)
    row = next(line for line in lines if "autopilot" in line and " up " in line)
    cells = [
        row[heading.index(name) + len(name) - 4 : heading.index(name) + len(name)].strip()
        for name in ("bad", "empty", "lost")
    ]
    assert cells == ["1", "77", "3"]
    (narrow,) = (line for line in printed(known) if "autopilot" in line and " up " in line)
    assert narrow.split()[-2] == "1"


def test_what_is_unknown_is_a_dash_and_nothing_more() -> None:
    known = Known("mower")
    unknown = estimate(
        1,
        health=HealthState.WAITING,
        reason="no data from autopilot",
        position=(None, None, None),
        velocity=(None, None, None),
        heading=None,
        heading_variance=None,
        radius95=None,
        latitude=None,
        biases={},
    )
    known.take("estimate", msgspec.json.encode(unknown))
    screen = "\n".join(printed(known))
    assert "waiting" in screen
    assert "no data from autopilot" in screen
    assert "no position yet" in screen
    assert screen.count("– m") == 7
    assert "0.00" not in screen
    assert "nan" not in screen.lower()
    assert "None" not in screen


def test_before_anything_arrives_it_says_so() -> None:
    screen = "\n".join(printed(Known("mower")))
    assert "nothing yet" in screen
    assert "no estimate has arrived" in screen
    assert "no budget has arrived" in screen


def test_markup_in_what_others_wrote_is_text(known: Known) -> None:
    known.take("estimate", msgspec.json.encode(estimate(1, reason="[bold]odd[/] [link")))
    assert "[bold]odd[/] [link" in "\n".join(printed(known, 120))


def test_silence_is_said(known: Known, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(known, "silence", lambda: 12.0)
    assert "silent for 12 s" in "\n".join(printed(known))


def test_the_rate_is_that_of_the_estimates(known: Known) -> None:
    """The fixture's estimates are 20 ms apart."""
    assert known.rate() == pytest.approx(50.0)


def test_what_is_not_understood_is_counted(known: Known) -> None:
    known.take("estimate", b"{")
    known.take("budget", b'{"time": "now"}')
    assert known.malformed == 2
    assert known.estimate is not None
    assert known.estimate.sequence == 199


def test_beacons_come_from_the_configuration() -> None:
    known = Known("mower")
    known.configured(b'{"beacon": [{"id": 5, "position": [1.0, 2.0, 0.0]}, {"id": 6, "position": null}]}')
    assert known.beacons == {5: (1.0, 2.0)}
