"""What a replay runs with: the configuration given, or the facts beside the log and what the log itself holds.

A recording often comes with a small file of the same name that knows the place (origin, beacons, start) and nothing
of sensors or links. What it leaves out is filled in from the log: the links it was heard by, and a sensor for every
kind of reading in it, with the accuracy that the readings claim. What was filled in is told, so that it can be written
down and changed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from drivers.sample import (
    BeaconPlace,
    Bearing,
    GeodeticPosition,
    Heading,
    LocalPosition,
    MotionCommand,
    Odometer,
    Presence,
    Range,
    RangeBearing,
    Speed,
    Velocity,
)
from service.config import (
    CanLink,
    Configuration,
    Link,
    MavlinkLink,
    Sensor,
    Site,
    Start,
    Vehicle,
    ZenohLink,
    load,
    site,
)
from service.replay.recorded import RecordedRun
from service.replay.scatter import RangeScatter
from service.replay.sources import kind_of, merged, open_log, recorded_run
from service.replay.surroundings import area_about, beacons_of

SITL_GNSS_DELAY_MS = 90.0
"""ArduPilot's simulator reports a fix this long after it was true."""

ROVER_GYRO_DELAY_MS = 56.0
"""What a second-order Butterworth low pass delays: sqrt(2) / (2 pi f), at INS_GYRO_FILTER's 4 Hz for rovers."""

_ROVERS = (10, 11)
"""MAV_TYPE of ground rovers and surface boats."""

_KINDS: tuple[tuple[str, tuple[type, ...]], ...] = (
    ("position", (GeodeticPosition, LocalPosition)),
    ("velocity", (Velocity,)),
    ("range", (Range,)),
    ("heading", (Heading,)),
)
_SIGHTS: tuple[tuple[str, tuple[type, ...]], ...] = (
    ("range_bearing", (RangeBearing,)),
    ("bearing", (Bearing,)),
)
"""Of use only where there is a map of landmarks."""
_MEASURED = frozenset(reading for _, readings in (*_KINDS, *_SIGHTS) for reading in readings)

_ODOMETRY = frozenset({Odometer, Speed, MotionCommand})
"""What tells how far the vehicle went; without any of it a motion model with a heading has nothing to go by, and a
receiver's delay does not show."""

_POINTING = frozenset({"heading", "bearing", "range_bearing"})
"""Kinds that speak of a heading, which a tag has not."""

SHORTEST_HORIZON_MS = 50.0
"""For a tag: no odometry bridges the way from the horizon to now, so waiting for nothing would cost accuracy."""

RADIO_BIAS = 0.03
"""Metres; what the antenna delay of a calibrated ultra-wideband radio leaves in its ranges."""

PROMPT = 0.97
"""Share of the measurements that a filled-in horizon waits for."""

LONGEST_HORIZON_MS = 3000.0


@dataclass(frozen=True)
class Setting:
    """A configuration to replay with, where the truth is (if anywhere), and what was filled in, in the user's words."""

    configuration: Configuration
    truth: Path | None
    notes: list[str] = field(default_factory=list[str])
    recorded: RecordedRun | None = None
    """The run that the log holds, of whose configuration this is."""


def beside(log: Path, ending: str) -> Path | None:
    """Return the file of the log's own name with another ending, if there is one."""
    for suffix in (
        ".candump.log.gz",
        ".candump.gz",
        ".candump.log",
        ".log.gz",
        ".asc.gz",
        ".trc.gz",
        log.suffix,
    ):
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
    RecordedRunError
        A recorded run holds a configuration that this version does not understand.
    """
    notes: list[str] = []
    recorded = recorded_run(logs[0]) if config is None else None
    path = config or beside(logs[0], ".toml")
    if recorded is not None:
        notes.append(f"configuration: of the run that was recorded in {logs[0]}")
        configuration = recorded.configuration()
    elif path is None:
        notes.append("no configuration: taken from the log alone")
        configuration = _filled(Site(), logs, notes)
    else:
        notes.append(f"configuration: {path}")
        configuration = _read(path, logs, notes)
    truth = truth or beside(logs[0], "_truth.csv")
    if truth is not None:
        notes.append(f"truth: {truth}")
    return Setting(configuration, truth, notes, recorded)


def _read(path: Path, logs: tuple[Path, ...], notes: list[str]) -> Configuration:
    """Read a complete configuration as such, and anything less as facts of the place to be filled in."""
    partial = site(path)
    if partial.vehicle is not None and partial.link and partial.sensor:
        return load(path)
    return _filled(partial, logs, notes)


def _filled(partial: Site, logs: tuple[Path, ...], notes: list[str]) -> Configuration:
    """Fill in what ``partial`` leaves out, from the logs themselves."""
    vehicle, links = Vehicle(name="replay"), _links_of(logs)
    bare = partial.configuration(vehicle, links, ())
    if not partial.link:
        notes.extend(f'link filled in: "{link.name}" ({link.kind})' for link in links)
    if partial.sensor:
        return bare
    contents = _contents_of(bare, logs)
    if partial.vehicle is None and not contents.heard & _ODOMETRY:
        vehicle = Vehicle(name="replay", motion="constant_velocity")
        notes.append('motion = "constant_velocity" filled in: no odometry in the log')
    free = (partial.vehicle or vehicle).motion == "constant_velocity"
    sensors = _sensors_of(contents, _KINDS + _SIGHTS if partial.map.landmarks else _KINDS, free)
    for sensor in sensors:
        words = f"sensor filled in from the log: {sensor.kind}"
        if sensor.delay_ms:
            words += f", delay_ms = {sensor.delay_ms:.0f}"
            words += ", correlation_s = 0" if sensor.correlation_s == 0.0 else ""
            words += " (SIM_STATE seen: ArduPilot's simulator)"
        if not sensor.claims:
            words += f", sigma = {sensor.sigma:g} and claims = false (they scatter less than they claim)"
        notes.append(words + ("".join(f', estimate = ["{state}"]' for state in sensor.estimate)))
    filled = _placed(partial, partial.configuration(vehicle, links, sensors), contents, notes)
    if contents.simulated and contents.rover and "motion" not in partial.model_fields_set:
        notes.append(
            f"yaw_rate_delay_ms = {ROVER_GYRO_DELAY_MS:.0f}: ArduPilot filters a rover's gyro at 4 Hz"
        )
        motion = filled.motion.model_copy(update={"yaw_rate_delay_ms": ROVER_GYRO_DELAY_MS})
        filled = filled.model_copy(update={"motion": motion})
    horizon_ms = max(contents.horizon_ms, SHORTEST_HORIZON_MS if free else filled.loop.horizon_ms)
    if "loop" in partial.model_fields_set or horizon_ms == filled.loop.horizon_ms:
        return filled
    notes.append(f"horizon_ms = {horizon_ms:.0f} filled in from the log: its measurements arrive that late")
    loop = filled.loop.model_copy(update={"horizon_ms": horizon_ms})
    return filled.model_copy(update={"loop": loop})


def _placed(
    partial: Site, configuration: Configuration, contents: Contents, notes: list[str]
) -> Configuration:
    """Fill in the beacons that the log knows, and where to begin when there are only ranges to begin from."""
    if not configuration.beacon and contents.places:
        configuration = configuration.model_copy(update={"beacon": beacons_of(contents.places)})
        notes.append(f"{len(configuration.beacon)} beacons filled in from the log, heights from their mean")
    given = {"start", "area"} & partial.model_fields_set
    fixed = contents.heard & {GeodeticPosition, LocalPosition}
    area = None if given or fixed else area_about(configuration.beacon, contents.ranges)
    if area is None:
        return configuration
    (south, north), (west, east) = area.north, area.east
    notes.append(
        f"no start, no position fix: starting anywhere about the beacons, {north - south:.0f} by {east - west:.0f} m"
    )
    return configuration.model_copy(update={"area": area, "start": Start(mode="global")})


class Contents(NamedTuple):
    """What a pass over the logs tells: the kinds of reading, whether a simulator wrote them, how late they come.

    Attributes
    ----------
    rover : bool
        Whether an autopilot said that it drives on the ground or on water.
    places : list[BeaconPlace]
        What was said of the beacons' places.
    ranges : list[float]
        Every distance to a beacon that was heard, metres.
    range_sigma : float or None
        What a range is worth, metres, if that is less than it claims.
    """

    heard: set[type]
    simulated: bool
    rover: bool
    horizon_ms: float
    places: list[BeaconPlace]
    ranges: list[float]
    range_sigma: float | None


def _contents_of(configuration: Configuration, logs: tuple[Path, ...]) -> Contents:
    readers = [open_log(log, configuration) for log in logs]
    heard: set[type] = set()
    latencies: list[int] = []
    places: dict[int, BeaconPlace] = {}
    ranges: list[float] = []
    scatter = RangeScatter()
    rover = False
    for sample in merged(readers):
        reading = sample.reading
        kind = type(reading)
        heard.add(kind)
        if isinstance(reading, Presence):
            rover |= reading.type in _ROVERS
        elif isinstance(reading, BeaconPlace):
            places.setdefault(reading.beacon, reading)
        elif isinstance(reading, Range):
            ranges.append(reading.distance)
            scatter.add(sample.time, reading)
        if kind in _MEASURED:
            latencies.append(sample.received - sample.time)
    simulated = any("SIM_STATE" in reader.kinds() for reader in readers)
    horizon_ms = _horizon_for(latencies, SITL_GNSS_DELAY_MS if simulated else 0.0)
    return Contents(heard, simulated, rover, horizon_ms, list(places.values()), ranges, scatter.sigma())


def _horizon_for(latencies: list[int], delay_ms: float) -> float:
    """Return the horizon, ms, that ``PROMPT`` of the measurements keep, in steps of 50 and within bounds."""
    if not latencies:
        return 0.0
    ranked = sorted(latencies)
    latest = ranked[min(len(ranked) - 1, int(PROMPT * len(ranked)))] / 1e6 + delay_ms
    return min(LONGEST_HORIZON_MS, 50.0 * math.ceil(latest / 50.0))


def _links_of(logs: tuple[Path, ...]) -> tuple[Link, ...]:
    links: dict[str, Link] = {}
    for log in logs:
        kind = kind_of(log).link
        if kind == "mavlink":
            links.setdefault(kind, MavlinkLink(name="autopilot", kind="mavlink", url=str(log)))
        elif kind == "zenoh":
            links.setdefault(kind, ZenohLink(name="samples", kind="zenoh"))
        else:
            links.setdefault(kind, CanLink(name="bus", kind="can", channel=str(log)))
    return tuple(links.values())


def _sensors_of(
    contents: Contents, kinds: tuple[tuple[str, tuple[type, ...]], ...], free: bool
) -> tuple[Sensor, ...]:
    sensors: list[Sensor] = []
    for kind, readings in kinds:
        if contents.heard.intersection(readings) and not (free and kind in _POINTING):
            sensors.append(Sensor.model_validate({"kind": kind} | _facts_of(kind, contents, free)))
    return tuple(sensors)


def _facts_of(kind: str, contents: Contents, free: bool) -> dict[str, Any]:
    """Return what is filled in for a sensor beside its kind."""
    if kind == "range" and free:
        worth = {} if contents.range_sigma is None else {"sigma": contents.range_sigma, "claims": False}
        return {"estimate": ("bias",), "bias_sigma": RADIO_BIAS} | worth
    if kind == "range":
        return {"estimate": ("scale",)}
    if kind in ("position", "velocity"):
        if contents.simulated:
            facts: dict[str, Any] = {"delay_ms": SITL_GNSS_DELAY_MS}
            return facts | ({"correlation_s": 0.0} if kind == "position" else {})
        if contents.heard & _ODOMETRY and not free:
            return {"estimate": ("delay",)}
    return {}
