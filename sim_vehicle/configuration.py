"""The configuration that goes with a drive: a TOML file with only what an operator could know.

The operator knows the site, the beacons and the sensors' data sheets; the start he knows roughly. What the
seed drew (biases, scales, clocks) is not in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from sim_vehicle.scenario import Scenario, SensorFacts

Value: TypeAlias = str | float | int | tuple[float, ...] | tuple[str, ...] | dict[str, float]


@dataclass(frozen=True, slots=True)
class Listening:
    """How the daemon would listen to this vehicle.

    Attributes
    ----------
    url : str
        MAVLink, as pymavlink writes it.
    can : tuple[str, str] or None
        python-can's interface and channel.
    """

    url: str = "udpin:127.0.0.1:14550"
    can: tuple[str, str] | None = None


def text(scenario: Scenario, listening: Listening) -> str:
    """Return the configuration file of a drive."""
    origin, belief = scenario.origin, scenario.belief
    parts = [
        f"# {scenario.description}",
        _table("[vehicle]", {"name": f"{scenario.name}-rover", "motion": "unicycle"}),
        _table(
            "[origin]",
            {"latitude": origin.latitude, "longitude": origin.longitude, "altitude": origin.altitude},
        ),
        _table(
            "[start]",
            {
                "position": belief.position,
                "heading": belief.heading,
                "sigma": belief.sigma,
                "sigma_heading": belief.sigma_heading,
            },
        ),
        _table("[[link]]", {"name": "autopilot", "kind": "mavlink", "url": listening.url}),
    ]
    if scenario.bus is not None and listening.can is not None:
        parts.append(_can_link(*listening.can))
    if scenario.motion:
        parts.append(_table("[motion]", dict(scenario.motion)))
    parts += [_sensor(facts) for facts in scenario.facts if facts.link == "autopilot" or listening.can]
    if scenario.ranger is not None:
        parts += [
            _table("[[beacon]]", {"id": site.id, "position": (site.north, site.east, site.down)})
            for site in scenario.ranger.beacons
        ]
    return "\n".join(parts)


def _can_link(interface: str, channel: str) -> str:
    values: dict[str, Value] = {"name": "bus", "kind": "can", "interface": interface, "channel": channel}
    if interface == "slcan":
        values |= {"bitrate": 1_000_000, "options": {"sleep_after_open": 0.0}}
    return _table("[[link]]", values)


def _sensor(facts: SensorFacts) -> str:
    values: dict[str, Value] = {"kind": facts.kind, "link": facts.link}
    if facts.source:
        values["source"] = facts.source
    if facts.sigma is not None:
        values["sigma"] = facts.sigma
    values["outliers"] = facts.outliers
    if facts.delay_ms:
        values["delay_ms"] = facts.delay_ms
    if facts.declination_deg:
        values["declination_deg"] = facts.declination_deg
    if facts.estimate:
        values["estimate"] = facts.estimate
    return _table("[[sensor]]", values)


def _table(heading: str, values: dict[str, Value]) -> str:
    lines = [f"{name} = {_written(value)}" for name, value in values.items()]
    return "\n".join([heading, *lines, ""])


def _written(value: Value) -> str:
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, tuple):
        return "[" + ", ".join(_written(item) for item in value) + "]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{name} = {_written(item)}" for name, item in value.items()) + " }"
    if isinstance(value, int):
        return str(value)
    rounded = round(value, 9)
    return repr(rounded + 0.0)
