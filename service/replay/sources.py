"""Log files as links: which reader a file needs, and all of them merged in the order of arrival."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from drivers.logs import LogReader, candump
from drivers.logs.canlog import CanLogReader
from drivers.logs.tlog import TlogReader
from drivers.sample import Sample
from service.config import CanLink, Configuration, MavlinkLink
from service.links import can_settings, mavlink_settings


class LogError(Exception):
    """The log cannot be replayed; the text says which and why."""


class LogKind(NamedTuple):
    """What a file's ending says of it: the kind of link that would have heard it, and what it is called."""

    link: str
    meaning: str


KINDS: dict[str, LogKind] = {
    ".tlog": LogKind("mavlink", "MAVLink telemetry log"),
    ".log": LogKind("can", "candump log"),
    ".log.gz": LogKind("can", "candump log, compressed"),
    ".candump": LogKind("can", "candump log"),
    ".candump.gz": LogKind("can", "candump log, compressed"),
}


def kind_of(path: Path) -> LogKind:
    """Return what ``path`` is, by its ending.

    Raises
    ------
    LogError
        The ending is not one of those that can be replayed, or there is no such file.
    """
    if not path.is_file():
        raise LogError(f"{path}: no such file")
    for ending in sorted(KINDS, key=len, reverse=True):
        if path.name.lower().endswith(ending):
            return KINDS[ending]
    raise LogError(f"{path}: cannot tell what log this is; known endings: {', '.join(KINDS)}")


def open_log(path: Path, configuration: Configuration) -> LogReader:
    """Return the reader for ``path``, set up as the first link of its kind in ``configuration`` is."""
    kind = kind_of(path)
    for link in configuration.link:
        if link.kind == kind.link and isinstance(link, MavlinkLink):
            return TlogReader(path, link.name, mavlink_settings(link))
        if link.kind == kind.link and isinstance(link, CanLink):
            return CanLogReader(path, link.name, can_settings(link), candump.frames)
    raise LogError(f"{path} is a {kind.meaning}, and the configuration has no link of kind {kind.link}")


def merged(readers: list[LogReader]) -> Iterator[Sample]:
    """Yield the samples of all logs in the order of their arrival."""
    if len(readers) == 1:
        return iter(readers[0])
    return heapq.merge(*readers, key=lambda sample: sample.received)
