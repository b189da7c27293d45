"""The configuration that goes with a drive: complete for the daemon, and no wiser than an operator."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from service import config
from sim_vehicle import scenarios
from sim_vehicle.configuration import Listening, text


@pytest.mark.parametrize("name", scenarios.names())
@pytest.mark.parametrize("can", [None, ("socketcan", "vcan0"), ("slcan", "/tmp/x/can0")])
def test_the_daemon_accepts_it(name: str, can: tuple[str, str] | None, tmp_path: Path) -> None:
    path = tmp_path / "vehicle.toml"
    drawn = scenarios.draw(name, 1)
    path.write_text(text(drawn, Listening("udpin:127.0.0.1:14550", can)))
    configuration = config.load(path)
    assert configuration.vehicle.motion == "unicycle"
    assert len(configuration.beacon) == (0 if drawn.ranger is None else len(drawn.ranger.beacons))


def test_a_sensor_without_a_sigma_goes_by_what_its_readings_claim() -> None:
    told = tomllib.loads(text(scenarios.draw("jam", 1), Listening()))
    assert [sensor["kind"] for sensor in told["sensor"]] == ["position", "velocity"]
    assert all("sigma" not in sensor for sensor in told["sensor"])


def test_it_names_the_links_that_are_there() -> None:
    drawn = scenarios.draw("demo", 1)
    both = tomllib.loads(text(drawn, Listening("tcp:127.0.0.1:5760", ("slcan", "/tmp/can0"))))
    assert [link["kind"] for link in both["link"]] == ["mavlink", "can"]
    assert both["link"][0]["url"] == "tcp:127.0.0.1:5760"
    assert both["link"][1] == {
        "name": "bus",
        "kind": "can",
        "interface": "slcan",
        "channel": "/tmp/can0",
        "bitrate": 1_000_000,
        "options": {"sleep_after_open": 0.0},
    }
    alone = tomllib.loads(text(drawn, Listening()))
    assert {sensor["link"] for sensor in alone["sensor"]} == {"autopilot"}


def test_it_tells_the_belief_and_not_the_truth() -> None:
    drawn = scenarios.draw("beacons", 1)
    told = tomllib.loads(text(drawn, Listening()))
    assert told["start"]["position"] == pytest.approx(drawn.belief.position, abs=1e-8)
    assert told["start"]["position"][0] != pytest.approx(drawn.start.north, abs=1e-3)
    assert told["start"]["sigma_heading"] == drawn.belief.sigma_heading


def test_text_is_quoted() -> None:
    told = tomllib.loads(text(scenarios.draw("demo", 1), Listening('a"b\\c')))
    assert told["link"][0]["url"] == 'a"b\\c'
