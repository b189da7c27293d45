"""DBC files by cantools: messages and signals by name, and the values in a frame.

The one place where cantools is used. Files are read leniently (``strict=False``): those of reverse-engineered cars
hold signals that overlap.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, cast

import cantools.database
from cantools.database import Message as CantoolsMessage

LARGEST_FILE = 32 * 2**20
"""Bytes; the largest DBC files of whole cars have a few megabytes."""


class DbcError(ValueError):
    """A DBC file cannot be used; the text says which, where, and what would be right."""


class DamagedFrame(ValueError):  # noqa: N818  it names what arrived, and is always caught as such
    """A frame does not hold what its message should; the text is the kind of damage."""


class SignalFacts(NamedTuple):
    """What the file says of a signal.

    Attributes
    ----------
    unit : str
        As written there, possibly empty.
    span : float
        Where a counter of this many bits starts anew, in the file's unit.
    """

    name: str
    unit: str
    span: float


class DbcMessage:
    """One message of the file.

    Attributes
    ----------
    name : str
        Its name.
    identifier : int
        11 or 29 bits.
    extended : bool
        It has 29.
    group : bool
        A J1939 message: priority, source (and destination) in the identifier do not matter.
    signals : dict[str, SignalFacts]
        By name.
    """

    def __init__(self, message: CantoolsMessage) -> None:
        self._message: Any = message
        self.name = message.name
        self.identifier = message.frame_id
        self.extended = message.is_extended_frame
        self.group = message.is_extended_frame and message.protocol == "j1939"
        self.signals = {
            signal.name: SignalFacts(signal.name, signal.unit or "", abs(signal.scale) * 2.0**signal.length)
            for signal in message.signals
        }

    def values(self, data: bytes) -> dict[str, float | None]:
        """Return the signals that a frame holds, in the file's units.

        A signal that the multiplexer has not switched on is absent. ``None``: the file has a name for this
        value (``SNA``, ``invalid``), so it is no measurement.

        Raises
        ------
        DamagedFrame
            ``multiplexer``: it selects what the file does not know; ``undecodable``.
        """
        try:
            decoded = cast("dict[str, Any]", self._message.decode(data, allow_truncated=True))
        except cantools.database.DecodeError as error:
            raise DamagedFrame("multiplexer" if "multiplexer" in str(error) else "undecodable") from error
        except (ValueError, ArithmeticError, LookupError, NotImplementedError) as error:
            raise DamagedFrame("undecodable") from error
        return {
            name: float(value) if isinstance(value, int | float) else None for name, value in decoded.items()
        }

    def cut_short(self, data: bytes) -> bool:
        """Whether a frame has fewer bytes than the message."""
        return len(data) < int(self._message.length)


class Database(NamedTuple):
    """A DBC file, read."""

    path: str
    messages: dict[str, DbcMessage]

    def find(self, signal: str) -> tuple[DbcMessage, SignalFacts]:
        """Return what ``MESSAGE.SIGNAL`` names.

        Raises
        ------
        DbcError
            There is no such message or signal.
        """
        name, _, inner = signal.partition(".")
        message = self.messages.get(name)
        if message is None:
            raise DbcError(f"{self.path}: there is no message {name} in it")
        facts = message.signals.get(inner)
        if facts is None:
            raise DbcError(f"{self.path}: message {name} has no signal {inner}")
        return message, facts


def read(path: str) -> Database:
    """Read a DBC file.

    Raises
    ------
    DbcError
        It cannot be read, or is none.
    """
    try:
        status = Path(path).stat()
    except OSError as error:
        raise DbcError(f"{path}: cannot be read: {error.strerror or error}") from error
    if status.st_size > LARGEST_FILE:
        raise DbcError(f"{path}: no DBC file: larger than {LARGEST_FILE // 2**20} MB")
    return _parsed(path, status.st_mtime_ns)


@lru_cache(maxsize=4)
def _parsed(path: str, _modified: int) -> Database:
    """Read and parse a file that has not changed since only once: the buses of one log share it."""
    try:
        database = cast(
            "Any", cantools.database.load_string(_text(Path(path).read_bytes()), "dbc", strict=False)
        )
    except OSError as error:
        raise DbcError(f"{path}: cannot be read: {error.strerror or error}") from error
    except Exception as error:  # cantools lets many kinds through: its parser's, KeyError, TypeError
        raise DbcError(f"{path}: not a DBC file: {error}") from error
    messages = [DbcMessage(message) for message in cast("list[CantoolsMessage]", database.messages)]
    return Database(path, {message.name: message for message in messages})


def _text(content: bytes) -> str:
    """Return the file's text: tools write it in the Windows code page, and lately in UTF-8."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")
