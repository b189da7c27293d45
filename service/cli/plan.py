"""What a configuration would run, as tables for the terminal, and what is worth knowing beforehand."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from rich.table import Table

from service.config import CanLink, Configuration, Link, MavlinkLink
from service.config.signals import notes_on_signals
from service.publish.topics import LIVE, QUERIES, REQUESTS, TOPICS

KEYS = (*(topic.key for topic in TOPICS), *QUERIES, *REQUESTS, LIVE)


def _table(title: str, *columns: str) -> Table:
    table = Table(title=title, title_justify="left", title_style="bold")
    for column in columns:
        table.add_column(column, overflow="fold")
    return table


def _place(configuration: Configuration) -> str:
    start = configuration.start
    if start.mode == "global":
        return f"anywhere in area north {configuration.area and configuration.area.north}, " + (
            f"east {configuration.area and configuration.area.east} m"
        )
    if start.mode == "first_fix":
        return "where the first position fix says"
    heading = "any" if start.heading is None else f"{start.heading:g} ± {start.sigma_heading:g} rad"
    return f"north, east, down {start.position} ± {start.sigma} m, heading {heading}"


def _origin(configuration: Configuration) -> str:
    origin = configuration.origin
    if origin is None:
        return "learned from the first fix or GPS_GLOBAL_ORIGIN"
    return f"{origin.latitude:.7f}°, {origin.longitude:.7f}°, {origin.altitude:g} m"


def _vehicle(configuration: Configuration) -> Table:
    motion, vehicle = configuration.motion, configuration.vehicle
    table = _table("vehicle", "what", "is")
    table.add_row("name", vehicle.name)
    table.add_row(
        "motion", f"{vehicle.motion}, speed from {motion.speed_from}, yaw rate from {motion.yaw_rate_from}"
    )
    table.add_row("start", _place(configuration))
    table.add_row("origin", _origin(configuration))
    return table


def _link_row(link: Link) -> tuple[str, str, str, str]:
    if isinstance(link, MavlinkLink):
        signing = "signed only" if link.signing_key_file else "unsigned too"
        return link.name, link.kind, link.url, f"system {link.system or 'first heard'}, {signing}"
    if isinstance(link, CanLink):
        told = (
            f"{link.protocol}, {Path(link.dbc).name}, {len(link.signal)} signals"
            if link.dbc
            else link.protocol
        )
        return link.name, link.kind, f"{link.interface}:{link.channel}", told
    return link.name, link.kind, "sample/<sensor>", "samples that others publish"


def _links(configuration: Configuration) -> Table:
    table = _table("links, a process each", "name", "kind", "address", "takes")
    for link in configuration.link:
        table.add_row(*_link_row(link))
    return table


def _sensors(configuration: Configuration) -> Table:
    table = _table("sensors", "kind", "link", "source", "sigma", "outliers", "estimated", "delay")
    for sensor in configuration.sensor:
        table.add_row(
            sensor.kind,
            sensor.link or "any",
            sensor.source or "any",
            "its own" if sensor.sigma is None else f"{sensor.sigma:g}",
            f"{sensor.outliers:.0%}",
            ", ".join(sensor.estimate) or "–",
            f"{sensor.delay_ms:g} ms",
        )
    return table


def _resources(configuration: Configuration) -> Table:
    loop, budget, publish = configuration.loop, configuration.budget, configuration.publish
    share = budget.cpu_ms * loop.rate / 10
    table = _table("loop", "what", "is")
    table.add_row("rate", f"{loop.rate:g} ticks/s, {loop.horizon_ms:g} ms behind, predicted to now")
    table.add_row(
        "budget", f"{budget.cpu_ms:g} ms per tick ({share:g} % of a processor), {budget.threads} thread(s)"
    )
    table.add_row("particles", f"{budget.particles_min:,} to {budget.particles_max:,}")
    table.add_row("scheduling", f"SCHED_FIFO {loop.priority}" if loop.priority else "ordinary")
    table.add_row("processors", ", ".join(map(str, loop.cpus)) or "all")
    table.add_row("keys", f"{publish.prefix}/{configuration.vehicle.name}/: {', '.join(KEYS)}")
    table.add_row("zenoh", publish.zenoh or "peer on tcp/127.0.0.1:7447, no multicast")
    table.add_row("state", configuration.state.directory)
    return table


def tables(configuration: Configuration) -> list[Table]:
    """Return the tables of what would run: vehicle, links, sensors, loop."""
    return [
        _vehicle(configuration),
        _links(configuration),
        _sensors(configuration),
        _resources(configuration),
    ]


def _link_notes(link: Link) -> Iterator[str]:
    if isinstance(link, CanLink):
        if link.interface == "socketcan" and not Path("/sys/class/net", link.channel).exists():
            yield f'link "{link.name}": there is no interface {link.channel} here now; it will be retried'
        if link.signal and link.protocol != "dbc":
            yield f'link "{link.name}": its signals are not used, for the protocol is {link.protocol}'
        if link.protocol == "dbc":
            yield from notes_on_signals(link)
    if isinstance(link, MavlinkLink):
        device = link.url.split(",")[0]
        if device.startswith("/dev/") and not Path(device).exists():
            yield f'link "{link.name}": there is no {device} here now; it will be retried'


def _processor_notes(configuration: Configuration) -> Iterator[str]:
    present = os.cpu_count() or 1
    absent = [cpu for cpu in configuration.loop.cpus if cpu >= present]
    if absent:
        yield f"loop, cpus: this machine has processors 0 to {present - 1}, not {', '.join(map(str, absent))}"


def notes(configuration: Configuration) -> list[str]:
    """Return what is not wrong but worth knowing before a start."""
    found = [note for link in configuration.link for note in _link_notes(link)]
    kinds = {sensor.kind for sensor in configuration.sensor}
    if not kinds:
        found.append("no [[sensor]]: the belief is dead reckoning only")
    if configuration.start.mode == "first_fix" and "position" not in kinds:
        found.append("start: first_fix waits for a [[sensor]] of kind position, and there is none")
    if "range" in kinds and not configuration.beacon:
        found.append(
            "sensor range: no [[beacon]], so only ranges that say where their beacon stands are used"
        )
    return [*found, *_processor_notes(configuration)]
