"""What a replay runs with: the configuration given, or the facts beside the log and what the log itself holds.

A recording often comes with a small file of the same name that knows the place (origin, beacons, start) and nothing
of sensors or links. What it leaves out is filled in from the log: the links it was heard by, and a sensor for every
kind of reading in it, with the accuracy that the readings claim. What was filled in is told, so that it can be written
down and changed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from drivers.sample import GeodeticPosition, Heading, LocalPosition, Range, Velocity
from service.config import CanLink, Configuration, Link, MavlinkLink, Sensor, Site, Vehicle, load, site
from service.replay.sources import kind_of, merged, open_log

SITL_GNSS_DELAY_MS = 90.0
"""ArduPilot's simulator reports a fix this long after it was true."""

_KINDS: tuple[tuple[str, tuple[type, ...]], ...] = (
    ("position", (GeodeticPosition, LocalPosition)),
    ("velocity", (Velocity,)),
    ("range", (Range,)),
    ("heading", (Heading,)),
)


@dataclass(frozen=True)
class Setting:
    """A configuration to replay with, where the truth is (if anywhere), and what was filled in, in the user's words."""

    configuration: Configuration
    truth: Path | None
    notes: list[str] = field(default_factory=list[str])


def beside(log: Path, ending: str) -> Path | None:
    """Return the file of the log's own name with another ending, if there is one."""
    for suffix in (".candump.log.gz", ".candump.gz", ".candump.log", ".log.gz", log.suffix):
        if log.name.endswith(suffix):
            candidate = log.with_name(log.name.removesuffix(suffix) + ending)
            return candidate if candidate.is_file() else None
    return None


def setting_of(logs: tuple[Path, ...], config: Path | None, truth: Path | None) -> Setting:
    """Return what to replay ``logs`` with.

    Parameters
    ----------
    config : Path or None
        A complete configuration, or only the facts of the place; ``None``: the ``.toml`` beside the first log.
    truth : Path or None
        ``None``: the ``_truth.csv`` beside the first log.

    Raises
    ------
    ConfigurationError
        The file is wrong; every error at once.
    LogError
        A log cannot be read.
    """
    notes: list[str] = []
    path = config or beside(logs[0], ".toml")
    if path is None:
        notes.append("no configuration: starting at the first position fix")
        configuration = _filled(Site(), logs, notes)
    else:
        notes.append(f"configuration: {path}")
        configuration = _read(path, logs, notes)
    truth = truth or beside(logs[0], "_truth.csv")
    if truth is not None:
        notes.append(f"truth: {truth}")
    return Setting(configuration, truth, notes)


def _read(path: Path, logs: tuple[Path, ...], notes: list[str]) -> Configuration:
    """Read a complete configuration as such, and anything less as facts of the place to be filled in."""
    partial = site(path)
    if partial.vehicle is not None and partial.link and partial.sensor:
        return load(path)
    return _filled(partial, logs, notes)


def _filled(partial: Site, logs: tuple[Path, ...], notes: list[str]) -> Configuration:
    """Fill in what ``partial`` leaves out, from the logs themselves."""
    vehicle = Vehicle(name="replay")
    links = _links_of(logs)
    bare = partial.configuration(vehicle, links, ())
    if not partial.link:
        notes.extend(f'link filled in: "{link.name}" ({link.kind})' for link in links)
    if partial.sensor:
        return bare
    sensors = _sensors_of(bare, logs)
    for sensor in sensors:
        words = f"sensor filled in from the log: {sensor.kind}"
        if sensor.delay_ms:
            words += f", delay_ms = {sensor.delay_ms:.0f} (SIM_STATE seen: ArduPilot's simulator)"
        notes.append(words + ("".join(f', estimate = ["{state}"]' for state in sensor.estimate)))
    return partial.configuration(vehicle, links, sensors)


def _links_of(logs: tuple[Path, ...]) -> tuple[Link, ...]:
    links: dict[str, Link] = {}
    for log in logs:
        kind = kind_of(log).link
        if kind == "mavlink":
            links.setdefault(kind, MavlinkLink(name="autopilot", kind="mavlink", url=str(log)))
        else:
            links.setdefault(kind, CanLink(name="bus", kind="can", channel=str(log)))
    return tuple(links.values())


def _sensors_of(configuration: Configuration, logs: tuple[Path, ...]) -> tuple[Sensor, ...]:
    readers = [open_log(log, configuration) for log in logs]
    heard = {type(sample.reading) for sample in merged(readers)}
    simulated = any("SIM_STATE" in reader.kinds() for reader in readers)
    sensors: list[Sensor] = []
    for kind, readings in _KINDS:
        if heard.intersection(readings):
            delay = SITL_GNSS_DELAY_MS if simulated and kind in ("position", "velocity") else 0.0
            estimate = ("scale",) if kind == "range" else ()
            sensors.append(Sensor.model_validate({"kind": kind, "delay_ms": delay, "estimate": estimate}))
    return tuple(sensors)
