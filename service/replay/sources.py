"""Log files as links: which reader a file needs, and all of them merged in the order of arrival."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from drivers.logs import LogReader, asc, blf, candump, trc
from drivers.logs.canlog import CanLogReader, FrameSource
from drivers.logs.dataflash import DataflashReader
from drivers.logs.recognise import ENDINGS, Format, recognise
from drivers.logs.tlog import TlogReader
from drivers.logs.ulog import UlogReader
from drivers.sample import Sample
from service.config import CanLink, Configuration, MavlinkLink
from service.links import can_settings, mavlink_settings
from service.replay.recorded import RecordedRun, run_in


class LogError(Exception):
    """The log cannot be replayed; the text says which and why."""


class LogKind(NamedTuple):
    """What a log is: the kind of link that would have heard it, and what it is called."""

    link: str
    meaning: str


_LINKS: dict[Format, str] = {
    Format.TLOG: "mavlink",
    Format.DATAFLASH: "mavlink",
    Format.ULOG: "mavlink",
    Format.CANDUMP: "can",
    Format.ASC: "can",
    Format.BLF: "can",
    Format.TRC: "can",
    Format.RECORDING: "zenoh",
}
"""What an autopilot logs by itself stands for the link to it; samples come from whoever publishes samples."""

_CAN_SOURCES: dict[Format, FrameSource] = {
    Format.CANDUMP: candump.frames,
    Format.ASC: asc.frames,
    Format.BLF: blf.frames,
    Format.TRC: trc.frames,
}


def _format_of(path: Path) -> Format:
    if not path.is_file():
        raise LogError(f"{path}: no such file")
    try:
        form = recognise(path)
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {error.strerror or error}") from error
    if form is None:
        known = ", ".join(f"{ending} ({meaning.value})" for ending, meaning in ENDINGS.items())
        raise LogError(f"{path}: cannot tell what log this is, by its content or its name; known are {known}")
    if form is Format.DATAFLASH_TEXT:
        raise LogError(f"{path}: a DataFlash log as text; replay the .bin that it was made from")
    return form


def kind_of(path: Path) -> LogKind:
    """Return what ``path`` is, by its content, and by its name where that says nothing.

    Raises
    ------
    LogError
        It is not one of those that can be replayed, or there is no such file.
    """
    form = _format_of(path)
    return LogKind(_LINKS[form], form.value)


def open_log(path: Path, configuration: Configuration) -> LogReader:
    """Return the reader for ``path``, set up as the first link of its kind in ``configuration`` is.

    Raises
    ------
    LogError
        No link would have heard it, or the link's DBC file cannot be used.
    """
    form = _format_of(path)
    if form is Format.RECORDING:
        return _recording(path)
    for link in configuration.link:
        if isinstance(link, MavlinkLink) and _LINKS[form] == "mavlink":
            return _autopilots(path, form, link)
        if isinstance(link, CanLink) and _LINKS[form] == "can":
            try:
                return CanLogReader(path, link.name, can_settings(link), _CAN_SOURCES[form])
            except ValueError as error:
                raise LogError(f'link "{link.name}": {error}') from error
    raise LogError(f"{path} is a {form.value}, and the configuration has no link of kind {_LINKS[form]}")


def recorded_run(path: Path) -> RecordedRun | None:
    """Return the recorded run that a log holds, if it is a recording and holds one.

    Raises
    ------
    LogError
        It cannot be read.
    """
    if _format_of(path) is not Format.RECORDING:
        return None
    _recording(path)  # complains where the library is missing
    return run_in(path)


def _recording(path: Path) -> LogReader:
    """Return the reader of a recording, which names its links itself."""
    try:
        from drivers.logs.recording import RecordingReader
    except ImportError as error:
        raise LogError(f"{path}: recordings need mcap: pip install 'beliefd[record]'") from error
    return RecordingReader(path)


def _autopilots(path: Path, form: Format, link: MavlinkLink) -> LogReader:
    if form is Format.DATAFLASH:
        return DataflashReader(path, link.name)
    if form is Format.ULOG:
        return UlogReader(path, link.name)
    return TlogReader(path, link.name, mavlink_settings(link))


def merged(readers: list[LogReader]) -> Iterator[Sample]:
    """Yield the samples of all logs in the order of their arrival."""
    if len(readers) == 1:
        return iter(readers[0])
    return heapq.merge(*readers, key=lambda sample: sample.received)
