"""ULog files as PX4 writes them: a header, definitions, then messages of a size, a letter and a content.

There is no checksum. A message is believed when its letter is known and another one, or the end, follows at its
size; one with data must also be of a topic that the log has subscribed to, and as long as that is. What lies between,
after damage, is searched for the next such pair. Times are microseconds since boot; where a receiver knew the time,
the log's clock is UTC (as Unix time), else it is the time since boot.
"""

from __future__ import annotations

import mmap
import re
import struct
from collections import Counter
from collections.abc import Iterator

from drivers.logs.log_file import lost
from drivers.logs.onboard import Fields, Handler, OnboardReader, settled
from drivers.logs.receive_clock import LARGEST_STAMP, on_clock
from drivers.logs.ulog.layout import Formats, Topic
from drivers.logs.ulog.records import BLENDED, FIX_3D, RAW, handlers
from drivers.sample import Sample

MAGIC = b"ULog\x01\x12\x35"
HEADER_LENGTH = 16
MESSAGE_HEADER = struct.Struct("<HB")
SYNC = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
LETTERS = frozenset(b"BFIMPQARDLCSO")
CANDIDATES = re.compile(rb"..[BFIMPQARDLCSO]", re.DOTALL)
CHAIN = 8
LONGEST = MESSAGE_HEADER.size + 2**16
FLAGS = struct.Struct("<8s8s3Q")
APPENDED = 1

EARLIEST_UTC = (
    946_684_800_000_000  # µs: 2000; an earlier one comes from a receiver that does not know the date
)


class Log:
    """The data messages of a log, in order, with what was damaged or lost.

    Attributes
    ----------
    topics : dict[int, Topic]
        Subscriptions so far, by message id.
    faults : Counter[str]
        ``bad_magic``; ``bad_header``: stretches where no message was to be made out; ``lost_bytes`` in them;
        ``bad_format``; ``dropout`` and ``dropout_ms``: what PX4 itself could not write in time; ``unknown_flags``: the
        log says that it needs a newer reader.
    kinds : Counter[str]
        Data messages by topic.
    position : int
        Bytes read.
    """

    def __init__(self, data: mmap.mmap) -> None:
        self._data = data
        self._formats = Formats()
        self._appended: list[int] = []
        self.topics: dict[int, Topic] = {}
        self.faults: Counter[str] = Counter()
        self.kinds: Counter[str] = Counter()
        self.position = 0

    def __iter__(self) -> Iterator[tuple[Topic, bytes]]:
        """Yield the topic and the content of every data message."""
        at = HEADER_LENGTH
        if self._data[: len(MAGIC)] != MAGIC:
            self.faults["bad_magic"] += 1
            at = 0
        self.position = min(at, len(self._data))
        while at < len(self._data):
            end = self._end_of(at)
            if end is None:
                at = self.position = self._resynchronise(at)
                continue
            letter, body = self._data[at + 2], self._data[at + 3 : end]
            if letter == ord("D"):
                topic = self.topics[int.from_bytes(body[:2], "little")]
                self.kinds[topic.name] += 1
                yield topic, body[2:]
            else:
                self._learn(letter, body)
            at = self.position = end

    def _end_of(self, at: int) -> int | None:
        """Return where the message at ``at`` ends, if one is there and something follows it."""
        end = self._end(at)
        if end is None:
            return None
        cut_off = any(end <= place <= end + LONGEST for place in self._appended)
        return end if end == len(self._data) or cut_off or self._end(end) is not None else None

    def _end(self, at: int) -> int | None:
        data = self._data
        if at + 3 > len(data):
            return None
        size, letter = MESSAGE_HEADER.unpack(data[at : at + 3])
        end = at + 3 + size
        if letter not in LETTERS or end > len(data) or any(at < place < end for place in self._appended):
            return None
        if letter == ord("S"):
            return end if data[at + 3 : end] == SYNC else None
        if letter != ord("D"):
            return end
        topic = self.topics.get(int.from_bytes(data[at + 3 : at + 5], "little"))
        if topic is None or size < 2:
            return None
        shortest, longest = topic.sizes
        return end if shortest <= size - 2 <= longest else None

    def _resynchronise(self, at: int) -> int:
        """Return where the next good message starts.

        One that was cut off where data were appended (by a fault handler, after a crash) is no damage in the rest.
        """
        search = at + 1
        while candidate := CANDIDATES.search(self._data, search):
            if self._convincing(candidate.start()):
                break
            search = candidate.start() + 1
        found = candidate.start() if candidate else len(self._data)
        return lost(self.faults, "bad_header", at, found)

    def _convincing(self, at: int) -> bool:
        """Whether bytes found after damage are messages again.

        Those with data and the synchronisation bytes are told from noise by what they hold, the others only by
        a chain of them: of 256 letters 13 are known, and any size is possible.
        """
        for _ in range(CHAIN):
            end = self._end(at)
            if end is None:
                return False
            if end == len(self._data):
                return True
            if self._data[at + 2] in b"DS":
                return self._end(end) is not None
            at = end
        return True

    def _learn(self, letter: int, body: bytes) -> None:
        """Take in what the log says of itself."""
        if letter == ord("F"):
            self.faults["bad_format"] += not self._formats.define(body.decode("ascii", errors="replace"))
        elif letter == ord("A") and len(body) > 3:
            self._subscribe(body)
        elif letter == ord("R") and len(body) >= 2:
            self.topics.pop(int.from_bytes(body[:2], "little"), None)
        elif letter == ord("O") and len(body) >= 2:
            self.faults["dropout"] += 1
            self.faults["dropout_ms"] += int.from_bytes(body[:2], "little")
        elif letter == ord("B") and len(body) >= FLAGS.size:
            self._flags(body)

    def _subscribe(self, body: bytes) -> None:
        topic = self._formats.topic(body[3:].decode("ascii", errors="replace"), body[0])
        if topic is None:
            self.faults["bad_format"] += 1
        else:
            self.topics[int.from_bytes(body[1:3], "little")] = topic

    def _flags(self, body: bytes) -> None:
        _, incompatible, *offsets = FLAGS.unpack_from(body)
        if incompatible[0] & APPENDED:
            self._appended = [offset for offset in offsets if offset > 0]
        if incompatible[0] & ~APPENDED or any(incompatible[1:]):
            self.faults["unknown_flags"] += 1


class UlogReader(OnboardReader):
    """Reads a .ulg."""

    clock = "utc"

    def begin(self) -> None:
        """Forget the log, and what its messages have said."""
        super().begin()
        self._handlers: dict[tuple[str, int], Handler | None] = {}
        self._blended = False

    def samples(self, data: mmap.mmap) -> Iterator[Sample]:
        """Yield the samples in the order of the log."""
        self.base, self._blended = unix_at_boot(data)
        self.log = log = Log(data)
        for time, (topic, fields) in on_clock(self._wanted(log), self.tally.faults):
            yield from self._samples_of(topic, fields, time, self.base or 0)

    def _wanted(self, log: Log) -> Iterator[tuple[int, tuple[Topic, Fields]]]:
        """Yield the messages that have a handler, with their stamps."""
        for topic, body in log:
            if self._handler(topic) is None:
                self.tally.ignored += 1
                continue
            fields = topic.fields(body)
            yield min(int(fields["timestamp"]), LARGEST_STAMP // 2), (topic, fields)

    def _handler(self, topic: Topic) -> Handler | None:
        """Return the handler of a topic and instance; of most topics only the first instance has one."""
        key = (topic.name, topic.instance)
        if key not in self._handlers:
            several = topic.name in ("distance_sensor", "ranging_beacon")
            repeated = topic.name == RAW and self._blended
            wanted = (topic.instance == 0 or several) and not repeated and "timestamp" in topic.columns
            self._handlers[key] = handlers().get(topic.name) if wanted else None
        return self._handlers[key]

    def _samples_of(self, topic: Topic, fields: Fields, received: int, base: int) -> Iterator[Sample]:
        handler = self._handler(topic)
        assert handler is not None
        measured, stamp = int(fields.get("timestamp_sample", 0)), int(fields["timestamp"])
        age = (stamp - measured) * 1_000 if 0 < measured <= stamp else 0
        times = max(0, received - age) + base, received + base
        yield from self.tally.samples_of(topic.name, handler, fields, *times)


def unix_at_boot(data: mmap.mmap) -> tuple[int | None, bool]:
    """Return Unix time less time since boot (ns) by the first fixes, and whether the blended position is logged.

    The first is ``None`` where no receiver knew the time.
    """
    blended = settled(_bases(data, BLENDED))
    return (settled(_bases(data, RAW)), False) if blended is None else (blended, True)


def _bases(data: mmap.mmap, name: str) -> Iterator[int]:
    for topic, body in Log(data):
        if topic.name != name or topic.instance != 0:
            continue
        fields = topic.fields(body)
        stamp, utc = int(fields.get("timestamp", 0)), int(fields.get("time_utc_usec", 0))
        if fields.get("fix_type", 0) >= FIX_3D and EARLIEST_UTC <= utc <= LARGEST_STAMP and stamp <= utc:
            yield (utc - stamp) * 1_000
