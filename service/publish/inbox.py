"""The publishing process's end of the loop's datagrams: newest wins, and what was overtaken is counted.

A datagram is one tag byte and a payload (:data:`TAGS`). Estimates, budgets, sensors and clouds are *states*:
when several wait, only the newest is worth sending. Changes of health are *events*: each goes out, in order.
"""

from __future__ import annotations

import socket
import struct
from collections import Counter
from dataclasses import dataclass

from service.publish.topics import BUDGET, CLOUD_BYTES, ESTIMATE, HEALTH, HYPOTHESES, PARTICLES, SENSORS

PROCESSES = "processes"
TAGS = {
    b"E": ESTIMATE.key,
    b"B": BUDGET.key,
    b"S": SENSORS.key,
    b"H": HEALTH.key,
    b"P": PARTICLES.key,
    b"Y": HYPOTHESES.key,
    b"R": PROCESSES,
}

_LARGEST = 256 * 1024
_ROW_BYTES = 16
_LENGTH = struct.Struct("<I")


@dataclass(frozen=True)
class Value:
    """What arrived for one topic: the bytes to forward, and those that go along as the attachment."""

    topic: str
    payload: bytes
    attachment: bytes | None = None


class MalformedError(ValueError):
    """A datagram that is none; ``kind`` names why, in one word."""

    def __init__(self, kind: str) -> None:
        super().__init__(kind)
        self.kind = kind


class Inbox:
    """Drains a datagram socket without ever waiting.

    Attributes
    ----------
    superseded : Counter[str]
        Values that a newer one of the same topic overtook while they waited.
    malformed : Counter[str]
        Datagrams that were refused, by the kind of :class:`MalformedError`.
    """

    def __init__(self, estimates: socket.socket, at_once: int = 512) -> None:
        estimates.setblocking(False)
        self._socket = estimates
        self._at_once = at_once
        self._buffer = bytearray(_LARGEST)
        self.superseded: Counter[str] = Counter()
        self.malformed: Counter[str] = Counter()

    def drain(self) -> list[Value]:
        """Return what waited, in order of arrival, but of every state only the newest.

        At most ``at_once`` datagrams are taken in one go, so that a flood cannot keep the caller from its
        other work.
        """
        newest: dict[str, Value] = {}
        events: list[Value] = []
        for _ in range(self._at_once):
            try:
                length = self._socket.recv_into(self._buffer)
            except BlockingIOError:
                break
            try:
                value = parse(memoryview(self._buffer)[:length])
            except MalformedError as error:
                self.malformed[error.kind] += 1
                continue
            if value.topic == HEALTH.key:
                events.append(value)
            else:
                if newest.pop(value.topic, None) is not None:
                    self.superseded[value.topic] += 1
                newest[value.topic] = value
        return events + list(newest.values())


def parse(datagram: memoryview | bytes) -> Value:
    """Take one datagram apart. The JSON inside is forwarded as it is.

    Raises
    ------
    MalformedError
        ``unknown_tag``, ``empty``, ``too_long``; of a cloud ``broken_cloud`` (not whole rows of four float32,
        or shorter than it says) and ``large_cloud`` (over :data:`~service.publish.topics.CLOUD_BYTES`).
    """
    if len(datagram) >= _LARGEST:
        raise MalformedError("too_long")
    topic = TAGS.get(bytes(datagram[:1]))
    if topic is None:
        raise MalformedError("unknown_tag")
    if len(datagram) < 2:
        raise MalformedError("empty")
    if topic == PARTICLES.key:
        return _cloud(datagram[1:])
    return Value(topic, bytes(datagram[1:]))


def _cloud(body: memoryview | bytes) -> Value:
    if len(body) < _LENGTH.size:
        raise MalformedError("broken_cloud")
    (length,) = _LENGTH.unpack_from(body)
    description = bytes(body[_LENGTH.size : _LENGTH.size + length])
    rows = bytes(body[_LENGTH.size + length :])
    if not length or len(description) != length or len(rows) % _ROW_BYTES:
        raise MalformedError("broken_cloud")
    if len(rows) > CLOUD_BYTES:
        raise MalformedError("large_cloud")
    return Value(PARTICLES.key, rows, description)
