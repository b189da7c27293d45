"""Vector's binary recordings (.blf): objects in compressed containers.

The format is not published; what is known of it comes from Toby Lorenz' library and from python-can, which reads it but
stops at the first damage. A container is an object (``LOBJ``) of type 10; its content, zlib or plain, is a
stretch of the stream of the inner objects, which may cross from one container into the next. A damaged container is
left out with its bytes counted, and the stream is taken up at the next object that is whole.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import BinaryIO, NamedTuple

from drivers.can import CanFrame
from drivers.can.frame import LARGEST_EXTENDED
from drivers.logs.canlog import LoggedFrame, Tally
from drivers.logs.log_file import lost
from drivers.sample import SECOND

FILE_MAGIC = b"LOGG"
_MAGIC = b"LOBJ"
_FILE = struct.Struct("<4sL8BQQLL8H8H")
_OBJECT = struct.Struct("<4sHHLL")  # magic, header size, header version, object size, type
_HEADER_1 = struct.Struct("<LHHQ")  # flags, client, version, stamp
_HEADER_2 = struct.Struct("<LBxHQ8x")
_CONTAINER = struct.Struct("<H6xL4x")  # compression, size when it is undone
_CLASSIC = struct.Struct("<HBBL8s")  # channel, flags, length, identifier, data
_FD = struct.Struct("<HBBLLBBB5x64s")  # …, frame length, bits, FD flags, valid bytes, data
_FD_64 = struct.Struct("<BBBBLLLLLLLHBBL")

_CONTAINER_TYPE = 10
_CLASSIC_TYPES = (1, 86)
_FD_TYPE, _FD_64_TYPE = 100, 101
_PLAIN, _ZLIB = 0, 2
_TEN_MICROSECONDS = 1
_EXTENDED = 0x80000000
_REMOTE = 0x80
_REMOTE_64 = 0x10

_CHUNK = 1 << 16
LARGEST_CONTAINER = 16 << 20
"""Bytes; writers use 128 KB. Something larger is damage, and nothing that memory should be spent on."""
LARGEST_OBJECT = 1 << 20
LARGEST_FRAME = 1 << 10
_FRAMES = frozenset({*_CLASSIC_TYPES, _FD_TYPE, _FD_64_TYPE})
_LATEST = 2**62  # ns; the year 2116


def _start_of(header: bytes, tally: Tally) -> int:
    """Return the start of the recording, Unix nanoseconds; 0 where the head does not say."""
    if len(header) < _FILE.size or header[:4] != FILE_MAGIC:
        tally.refused["bad_magic"] += 1
        return 0
    year, month, _, day, hour, minute, second, milliseconds = _FILE.unpack(header)[14:22]
    try:
        start = datetime(year, month, day, hour, minute, second, tzinfo=UTC)
    except ValueError:
        return 0
    return max(0, int(start.timestamp())) * SECOND + milliseconds * 1_000_000


def _inflate(content: bytes, compression: int, tally: Tally) -> tuple[bytes, bool]:
    """Return what a container holds as far as it can be read, and whether that is all; never more than it may."""
    if compression == _PLAIN:
        return content, True
    inflater = zlib.decompressobj()
    found = bytearray()
    try:
        for at in range(0, len(content) if compression == _ZLIB else 0, _CHUNK):
            found += inflater.decompress(content[at : at + _CHUNK], LARGEST_CONTAINER - len(found))
            if inflater.unconsumed_tail or len(found) >= LARGEST_CONTAINER:
                break
    except zlib.error:
        pass  # counted below: the end was not reached
    if not inflater.eof:
        tally.refused["bad_container"] += 1
    return bytes(found), inflater.eof


def _containers(file: BinaryIO, tally: Tally) -> Iterator[bytes]:
    """Yield stretches of the stream of objects; an empty one where some of it was lost."""
    while True:
        at = file.tell()
        head = file.read(_OBJECT.size)
        if len(head) < _OBJECT.size:
            tally.refused["truncated_file"] += bool(head)
            return
        magic, _, _, size, kind = _OBJECT.unpack(head)
        if magic != _MAGIC or not _OBJECT.size <= size <= LARGEST_CONTAINER:
            yield b""
            if not _resynchronise(file, at, tally):
                return
            continue
        body = file.read(size - _OBJECT.size)
        cut = len(body) < size - _OBJECT.size
        tally.refused["truncated_file"] += cut
        yield from _content(kind, head, body, tally)
        file.seek(at + size + size % 4)
        if cut or file.read(4) not in (_MAGIC, b""):  # its size may be wrong, and the next lie inside
            yield b""
            if not _resynchronise(file, at, tally):
                return
            continue
        file.seek(at + size + size % 4)


def _content(kind: int, head: bytes, body: bytes, tally: Tally) -> Iterator[bytes]:
    """Yield what an object of the file adds to the stream; one that is no container is an object of it."""
    if kind != _CONTAINER_TYPE:
        yield head + body
    elif len(body) >= _CONTAINER.size:
        compression, _ = _CONTAINER.unpack_from(body)
        content, whole = _inflate(body[_CONTAINER.size :], compression, tally)
        yield content
        if not whole:
            yield b""


def _resynchronise(file: BinaryIO, at: int, tally: Tally) -> bool:
    """Go to the next object after damage at ``at``; ``False`` when there is none."""
    start = at + 1
    file.seek(start)
    kept = b""
    while chunk := file.read(_CHUNK):
        window = kept + chunk
        found = window.find(_MAGIC)
        if found >= 0:
            place = start + found
            file.seek(place)
            lost(tally.refused, "bad_header", at, place)
            return True
        kept = window[-3:]
        start += len(window) - len(kept)
    lost(tally.refused, "bad_header", at, file.tell())
    return False


class _Object(NamedTuple):
    """One object of the stream: when (ns since the start), its type, what follows its header of so many bytes."""

    stamp: int
    kind: int
    header: int
    body: bytes


def _frame(found: _Object) -> tuple[int, CanFrame | None] | None:
    """Return the bus and the frame of an object, no frame for a remote one; ``None`` for another object.

    Raises
    ------
    ValueError, struct.error
        It is damaged.
    """
    body = found.body
    if found.kind in _CLASSIC_TYPES:
        channel, flags, length, identifier, data = _CLASSIC.unpack_from(body)
        remote, flexible = flags & _REMOTE, False
        length = min(length, 8)
    elif found.kind == _FD_TYPE:
        channel, flags, _, identifier, _, _, fd, length, data = _FD.unpack_from(body)
        remote, flexible = flags & _REMOTE, bool(fd & 1)
    elif found.kind == _FD_64_TYPE:
        channel, _, length, _, identifier, _, flags, *_, offset, _ = _FD_64.unpack_from(body)
        remote, flexible = flags & _REMOTE_64, bool(flags & 0x1000)
        # some writers claim more bytes than there are; the rest is zeros
        end = max(0, offset - found.header) if offset else len(body)
        data = body[_FD_64.size : end][:length].ljust(length, b"\0")
    else:
        return None
    if length > len(data) or length > 64:
        raise ValueError("bad_object")
    if remote:
        return channel, None
    return channel, CanFrame(
        identifier & LARGEST_EXTENDED, bytes(data[:length]), bool(identifier & _EXTENDED), flexible
    )


def _objects(contents: Iterator[bytes], tally: Tally) -> Iterator[_Object]:
    """Yield the objects of the stream."""
    stream = b""
    for content in contents:
        if not content:  # some of the stream is lost: what was begun will not go on
            tally.refused["lost_bytes"] += len(stream)
            stream = b""
            continue
        stream += content
        at = 0
        while (found := _next_object(stream, at, tally)) is not None:
            at, size = found
            if at + size + _OBJECT.size > len(stream):
                break
            if _MAGIC not in stream[at + size : at + size + 7]:  # its size is wrong, and so may be all of it
                at = lost(tally.refused, "bad_object", at, at + 4)
                continue
            yield from _opened(stream[at : at + size], tally)
            at += size
        else:
            at = max(at, len(stream) - 3)
        stream = stream[at:]
    yield from _last(stream, tally)


def _last(stream: bytes, tally: Tally) -> Iterator[_Object]:
    """Yield what the stream ends with: nothing follows it to confirm its size."""
    at = 0
    while (found := _next_object(stream, at, tally)) is not None and sum(found) <= len(stream):
        at, size = found
        yield from _opened(stream[at : at + size], tally)
        at += size
    tally.refused["lost_bytes"] += len(stream[at:].strip(b"\0"))


def _next_object(stream: bytes, at: int, tally: Tally) -> tuple[int, int] | None:
    """Return place and size of the next object from ``at`` whose header can be; the bytes before it are lost.

    Objects are padded to four bytes, so up to three bytes between two are none. One whose header is not there yet has
    the size of that.
    """
    found = stream.find(_MAGIC, at)
    while found >= 0:
        size = _OBJECT.size
        if found + size <= len(stream):
            _, header, _, size, kind = _OBJECT.unpack_from(stream, found)
            largest = LARGEST_FRAME if kind in _FRAMES else LARGEST_OBJECT
            if not _OBJECT.size <= header <= size <= largest:
                found = stream.find(_MAGIC, found + 4)
                continue
        else:
            size = LARGEST_OBJECT
        if found - at > 3:
            tally.refused["bad_object"] += 1
            tally.refused["lost_bytes"] += found - at
        return found, size
    return None


def _opened(content: bytes, tally: Tally) -> Iterator[_Object]:
    _, _, version, _, kind = _OBJECT.unpack_from(content)
    header = {1: _HEADER_1, 2: _HEADER_2}.get(version)
    if header is None or len(content) < _OBJECT.size + header.size:
        tally.refused["bad_object"] += 1
        return
    flags, _, _, stamp = header.unpack_from(content, _OBJECT.size)
    length = _OBJECT.size + header.size
    yield _Object(stamp * (10_000 if flags == _TEN_MICROSECONDS else 1), kind, length, content[length:])


def frames(file: BinaryIO, tally: Tally) -> Iterator[LoggedFrame]:
    """Yield the frames of a recording; what is damaged is counted and left out."""
    header = file.read(_FILE.size)
    start = _start_of(header, tally)
    size = int.from_bytes(header[4:8], "little") if header[:4] == FILE_MAGIC else 0
    file.seek(size if _FILE.size <= size <= 4096 else 0)
    for thing in _objects(_containers(file, tally), tally):
        try:
            found = _frame(thing)
        except (ValueError, struct.error):
            tally.refused["bad_object"] += 1
            continue
        if found is None or found[1] is None:
            tally.skipped += 1
        else:
            yield LoggedFrame(min(start + thing.stamp, _LATEST), str(found[0]), found[1])
