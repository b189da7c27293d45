"""Every kind of error, in the words that a user reads. The expected texts are the specification."""

from __future__ import annotations

import math
import tomllib
from typing import Any

import pytest

from service.config import Configuration, ConfigurationError, Site, validated

WHOLE = """
[vehicle]
name = "mower"
[[link]]
name = "autopilot"
kind = "mavlink"
url = "udpin:127.0.0.1:14550"
[[link]]
name = "bus"
kind = "can"
channel = "vcan0"
[[link.signal]]
signal = "SPEED.ENCODER"
measures = "speed"
[start]
position = [1.0, 2.0, 3.0]
[area]
north = [-50.0, 120.0]
east = [-120.0, 50.0]
[loop]
rate = 50.0
[budget]
cpu_ms = 4.0
[[sensor]]
kind = "range"
link = "autopilot"
[[beacon]]
id = 7
position = [1.0, 2.0, 3.0]
"""


def whole() -> dict[str, Any]:
    return tomllib.loads(WHOLE)


def complaints(raw: dict[str, Any]) -> list[str]:
    with pytest.raises(ConfigurationError) as raised:
        validated(raw, Configuration, "robot.toml")
    return raised.value.errors


def placed(raw: dict[str, Any], place: str, value: object) -> dict[str, Any]:
    """Set a value at a place such as ``beacon.0.position``; DELETE removes it."""
    *way, last = place.split(".")
    table: Any = raw
    for step in way:
        table = table[int(step)] if isinstance(table, list) else table.setdefault(step, {})
    if value is DELETE:
        del table[last]
    else:
        table[int(last) if isinstance(table, list) else last] = value
    return raw


DELETE = object()
SINGLE: list[tuple[str, object, str]] = [
    ("beacon.0.position", [1.0, 2.0], "beacon 7, position: needs 3 numbers (north, east, down), got 2"),
    ("beacon.0.position", "here", 'beacon 7, position: needs 3 numbers (north, east, down), got "here"'),
    ("beacon.0.position", [1, "a", 2], 'beacon 7, position, number 2: needs a number, got "a"'),
    ("beacon.0.position", [1, math.nan, 2], "beacon 7, position, number 2: needs a finite number, got nan"),
    (
        "beacon.0.position",
        DELETE,
        "beacon 7: needs either position (north, east, down), or latitude, longitude and altitude",
    ),
    (
        "beacon.0.latitude",
        3.0,
        "beacon 7: needs either position (north, east, down), or latitude, longitude and altitude",
    ),
    ("beacon.0.id", DELETE, "beacon 1, id: is missing: Its number on the wire."),
    ("beacon.0.id", 70000, "beacon 70000, id: needs at most 65535, got 70000"),
    ("link.1.channel", 3, 'link "bus" (link 2), channel: needs text in quotes, got 3'),
    ("link.1.channel", "", 'link "bus" (link 2), channel: needs a text that is not empty'),
    ("link.1.chanel", "vcan0", 'link "bus" (link 2), chanel: unknown key; did you mean "channel"?'),
    ("link.1.kind", "canbus", 'link "bus" (link 2), kind: needs one of mavlink, can, zenoh, got "canbus"'),
    ("link.1.kind", DELETE, 'link "bus" (link 2), kind: is missing'),
    ("link.1.name", DELETE, "link 2, name: is missing: What sensors, logs and status call this link."),
    ("link.1.name", "autopilot", 'link "autopilot" (link 2), name: "autopilot" is taken by link 1'),
    ("link.1.bitrate", 3, 'link "bus" (link 2), bitrate: needs at least 10000, got 3'),
    (
        "link.1.options",
        {"fd": []},
        'link "bus" (link 2), options, fd: needs text, a number, true or false, got []',
    ),
    ("link.1.options", 5, 'link "bus" (link 2), options: needs a table, got 5'),
    ("link.1.protocol", "cyphal", 'protocol: needs one of dronecan, dbc, got "cyphal"'),
    ("link.1.signal.0.scale", True, 'link "bus" (link 2), signal 1, scale: needs a number, got true'),
    ("link.1.signal.0.measures", "sped", 'pressure, got "sped"; did you mean "speed"?'),
    ("link.1.signal.0.signal", "SPEED", 'link "bus" (link 2), signal 1, signal: needs text of the form'),
    ("link.0.rates", {"RAW_IMU": -1}, 'link "autopilot" (link 1), rates, RAW_IMU: needs at least 0, got -1'),
    (
        "link.0.servo",
        [{"channel": 1, "low": 1600}],
        "servo 1: needs low <= trim <= high, got 1600, 1500, 1900",
    ),
    (
        "link.0.hud",
        ["airspeed"],
        'hud, number 1: needs one of groundspeed, altitude, heading, got "airspeed"',
    ),
    ("link.0.geoid_height", 300, 'link "autopilot" (link 1), geoid_height: needs at most 120, got 300'),
    ("link.1.range_orientation", 200, 'link "bus" (link 2), range_orientation: needs at most 101, got 200'),
    ("link.0.system", 256, 'link "autopilot" (link 1), system: needs at most 255, got 256'),
    ("link.0.signing_key_file", "/no/key", "signing_key_file: needs a file that exists, there is no /no/key"),
    (
        "link.0.send",
        "odometry",
        'link "autopilot" (link 1), send: "odometry" is not in this version, which has: none',
    ),
    ("link", [], "link: needs at least one, got none"),
    ("link", DELETE, "link: is missing: [[link]], at least one"),
    ("link.0", 3, "link 1: needs a table, got 3"),
    ("vehicle", DELETE, "vehicle: is missing: [vehicle]"),
    ("vehicle.name", "a/b", "vehicle, name: needs text of the form"),
    (
        "vehicle.motion",
        "unicycl",
        "vehicle, motion: needs one of constant_velocity, unicycle, drift, inertial, got",
    ),
    (
        "vehicle.motion",
        "drift",
        'vehicle, motion: "drift" is not in this version, which has: constant_velocity, unicycle',
    ),
    (
        "start.mode",
        "given!",
        'start, mode: needs one of given, global, first_fix, got "given!"; did you mean "given"?',
    ),
    ("start.mode", "global", 'start: position belongs to mode = "given", and the mode is "global"'),
    ("start", {"mode": "given"}, 'start: mode = "given" needs a position (north, east, down)'),
    ("start.sigma_heading", 0.3, "start: sigma_heading needs a heading beside it"),
    ("start.sigma", [1.0, -1.0, 1.0], "start, sigma, number 2: needs at least 0, got -1"),
    ("start", 7, "start: needs a table, got 7"),
    ("area.north", [5.0, 5.0], "area, north: needs the smaller number first, got [5.0, 5.0]"),
    ("area.east", DELETE, "area, east: is missing: Lowest and highest east, metres."),
    ("loop.rate", "50", 'loop, rate: needs a number, got "50"'),
    ("loop.rate", 0, "loop, rate: needs at least 1, got 0"),
    ("loop.rate", math.inf, "loop, rate: needs a finite number, got inf"),
    ("loop.rate", 500.0, "budget, cpu_ms: needs at most one tick (2 ms at loop, rate = 500), got 4"),
    ("loop.cpus", [0, 0.5], "loop, cpus, number 2: needs a whole number, got 0.5"),
    ("loop.cpus", 1, "loop, cpus: needs an array, got 1"),
    ("budget.particles_max", 100, "budget: needs particles_min <= particles_max, got 200 and 100"),
    ("budget.particles_max", 10**9, "budget, particles_max: needs at most 1e+07, got 1000000000"),
    ("budget.cpu_ms", 0, "budget, cpu_ms: needs more than 0, got 0"),
    (
        "sensor.0.link",
        "autopilott",
        'no link "autopilott", there is autopilot, bus; did you mean "autopilot"?',
    ),
    ("sensor.0.outliers", 1.0, "sensor 1 (range), outliers: needs less than 1, got 1.0"),
    ("sensor.0.kind", "scan", 'sensor 1 (scan), kind: "scan" is not in this version, which has: position'),
    ("sensor.0.estimate", ["drift"], "sensor 1 (range), estimate, number 1: needs one of scale, bias, delay"),
    ("sensor.0.beacons", [7, 8], "sensor 1 (range), beacons: no [[beacon]] with id 8"),
    ("publish.prefix", "a//b", "publish, prefix: needs text of the form"),
    ("publish.particles", 10**6, "publish, particles: needs at most 3000, got 1000000"),
    ("map.terrain", "tile.hgt", "map, terrain: is not in this version; leave it out"),
    ("publish.ros2_domain", 0, "publish, ros2_domain: is not in this version; leave it out"),
    ("publish.zenoh", "/no/z.json5", "publish, zenoh: needs a file that exists, there is no /no/z.json5"),
    (
        "sensor.0.estimate",
        ["delay"],
        'sensor 1 (range), estimate: delay is estimated for positions and velocities only, and this is "range"',
    ),
    (
        "sensor",
        [{"kind": "position", "estimate": ["bias"]}],
        "sensor 1 (position), estimate: bias is estimated for ranges, speeds and altitudes only, and this",
    ),
    (
        "sensor",
        [{"kind": "range", "estimate": ["scale"]}, {"kind": "range", "estimate": ["bias", "scale"]}],
        'sensor 2 (range), estimate: "scale" is estimated with sensor 1; there is one of all ranges',
    ),
    (
        "sensor",
        [{"kind": "heading", "lever": [0.0, 0.5]}],
        'sensor 1 (heading), lever: belongs to kind = "speed", and this is "heading"',
    ),
    ("sensor", [{"kind": "speed", "lever": [0.5]}], "lever: needs 2 numbers (forward, right), got 1"),
    (
        "motion",
        {"speed_from": "sensors"},
        'motion, speed_from: "sensors" needs at least one [[sensor]] of kind = "speed"',
    ),
    ("moton", {}, 'moton: unknown key; did you mean "motion"?'),
    ("xyzzy", 1, "xyzzy: unknown key"),
]


@pytest.mark.parametrize(("place", "value", "expected"), SINGLE)
def test_each_error_says_where_what_and_what_would_be_right(place: str, value: object, expected: str) -> None:
    found = complaints(placed(whole(), place, value))
    assert len(found) == 1, found
    assert found[0].startswith("robot.toml: ")
    assert expected in found[0]


def test_a_tag_has_no_heading_to_measure() -> None:
    """What it has is a velocity, in north and east."""
    tag = placed(whole(), "vehicle.motion", "constant_velocity")
    heard = [{"kind": "position"}, {"kind": "range"}, {"kind": "velocity"}]
    validated(placed(tag, "sensor", heard), Configuration, "robot.toml")
    found = complaints(placed(tag, "sensor", [{"kind": "range"}, {"kind": "heading"}]))
    assert len(found) == 1
    assert 'sensor 2 (heading), kind: "heading" needs a heading' in found[0]


def test_the_whole_file_has_no_error() -> None:
    assert validated(whole(), Configuration, "robot.toml").beacon[0].id == 7


def test_all_errors_come_at_once_in_the_order_of_the_file() -> None:
    raw = whole()
    raw["beacon"] += [{"id": 7, "position": [0, 0]}, 5]
    raw["link"][1]["chanel"] = raw["link"][1].pop("channel")
    raw["loop"]["rate"] = "fast"
    raw["sensor"][0]["link"] = "bus2"
    raw["start"] = {"mode": "global"}
    del raw["area"]
    assert complaints(raw) == [
        'robot.toml: loop, rate: needs a number, got "fast"',
        'robot.toml: link "bus" (link 2), channel: is missing: Channel of that interface: can0, vcan0, '
        "/dev/ttyACM0, 239.74.163.2.",
        'robot.toml: link "bus" (link 2), chanel: unknown key; did you mean "channel"?',
        "robot.toml: beacon 7, position: needs 3 numbers (north, east, down), got 2",
        "robot.toml: beacon 3: needs a table, got 5",
        "robot.toml: beacon 7, id: 7 is taken by beacon 1; each beacon needs its own id",
        'robot.toml: sensor 1 (range), link: no link "bus2", there is autopilot, bus; did you mean "bus"?',
        'robot.toml: area: is missing; start, mode = "global" needs [area] with north and east',
    ]


def test_a_site_may_name_links_that_only_its_recording_has() -> None:
    read = validated({"sensor": [{"kind": "range", "link": "anything"}]}, Site, "site.toml")
    assert read.sensor[0].link == "anything"


def test_long_values_are_cut_to_one_line() -> None:
    (line,) = complaints(placed(whole(), "loop.rate", "x\n" * 400))
    assert len(line) < 120
    assert "\n" not in line


def test_dbc_needs_its_file() -> None:
    assert complaints(placed(whole(), "link.1.protocol", "dbc")) == [
        'robot.toml: link "bus" (link 2): protocol = "dbc" needs dbc (the file) and at least one '
        "[[link.signal]]",
    ]
