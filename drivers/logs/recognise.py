"""Which format a log has: by its first bytes, which are right more often than its name."""

from __future__ import annotations

import gzip
import re
import zlib
from collections.abc import Callable
from enum import Enum
from pathlib import Path

from drivers.logs import blf, candump
from drivers.logs.canlog import GZIP
from drivers.logs.ulog.reader import MAGIC as ULOG

HEAD = 4096
MCAP = b"\x89MCAP0\r\n"


class Format(Enum):
    """The formats that are told apart; the value is what a user calls it."""

    TLOG = "MAVLink telemetry log"
    DATAFLASH = "DataFlash log"
    DATAFLASH_TEXT = "DataFlash log as text"
    ULOG = "ULog"
    CANDUMP = "candump log"
    ASC = "Vector .asc log"
    BLF = "Vector .blf log"
    TRC = "PEAK .trc log"
    RECORDING = "recording of samples"


ENDINGS: dict[str, Format] = {
    ".tlog": Format.TLOG,
    ".bin": Format.DATAFLASH,
    ".ulg": Format.ULOG,
    ".log": Format.CANDUMP,
    ".candump": Format.CANDUMP,
    ".asc": Format.ASC,
    ".blf": Format.BLF,
    ".trc": Format.TRC,
    ".mcap": Format.RECORDING,
}
"""By the name's ending, without ``.gz``."""

_ASC = re.compile(rb"(?://|date\s|base\s+(?:hex|dec)|begin\s+triggerblock)", re.IGNORECASE)
_TLOG_STAMPS = range(946_684_800_000_000, 4_102_444_800_000_000)  # µs: 2000 to 2100


def _is_tlog(head: bytes) -> bool:
    return head[8:9] in (b"\xfd", b"\xfe") and int.from_bytes(head[:8], "big") in _TLOG_STAMPS


def _is_candump(head: bytes) -> bool:
    try:
        candump.parse(head.split(b"\n", 1)[0])
    except ValueError as error:
        return str(error) == "error_frame"
    return True


_SIGNS: tuple[tuple[Format, Callable[[bytes], bool]], ...] = (
    (Format.ULOG, lambda head: head.startswith(ULOG)),
    (Format.RECORDING, lambda head: head.startswith(MCAP)),
    (Format.DATAFLASH, lambda head: head.startswith(b"\xa3\x95\x80")),
    (Format.BLF, lambda head: head.startswith(blf.FILE_MAGIC)),
    (Format.DATAFLASH_TEXT, lambda head: head.startswith(b"FMT, ")),
    (Format.TLOG, _is_tlog),
    (Format.CANDUMP, _is_candump),
    (Format.TRC, lambda head: head.startswith((b";$FILEVERSION", b";##########"))),
    (Format.ASC, lambda head: _ASC.match(head) is not None),
)


def _head(path: Path) -> bytes:
    """Return the first bytes of a file, unzipped where it is; what of it can be read."""
    with path.open("rb") as file:
        head = file.read(HEAD)
    if not head.startswith(GZIP):
        return head
    try:
        return zlib.decompressobj(zlib.MAX_WBITS | 16).decompress(head, HEAD)
    except (zlib.error, gzip.BadGzipFile):
        return b""


def by_ending(name: str) -> Format | None:
    """Return the format that a file's name claims."""
    ending = Path(name.lower().removesuffix(".gz")).suffix
    return ENDINGS.get(ending)


def recognise(path: Path) -> Format | None:
    """Return the format of a log: by its content, or by its name where the content says nothing (damaged, empty).

    Raises
    ------
    OSError
        The file cannot be read.
    """
    head = _head(path).removeprefix(b"\xef\xbb\xbf")
    return next((form for form, fits in _SIGNS if fits(head)), None) or by_ending(path.name)
