"""A sensor's clock on the host's: from a device's stamp to nanoseconds on the host's monotonic clock.

Two methods, as DESIGN.md "Time" asks. Where the peer answers TIMESYNC, the exchange with the shortest round
trip bounds the offset from both sides (Cristian's algorithm: the error is at most half the round trip).
Otherwise the lower envelope of arrival minus stamp: latency only ever adds, so the smallest difference of the
last half minute is the offset plus the shortest latency. Both let the offset rise by :data:`DRIFT` per second
between hits, so that a clock that is some tens of ppm off is followed in either direction.

Nothing here reads a clock: whoever calls says when the bytes arrived, on the monotonic clock (in a replay: on
the log's receive clock), so steps of the wall clock change nothing.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from drivers.sample import SECOND

DRIFT = 100e-6  # crystals are within 50 ppm, cheap resonators within 100
BUCKET = 15 * SECOND  # half of the window that the envelope remembers
ENOUGH_IN_BUCKET = 20  # a bucket with fewer arrivals has not seen a quick one: silence forgets nothing
EXCHANGES_NEEDED = 8
EXCHANGES_KEPT = 64
EXCHANGE_STALE = 30 * SECOND
SLOWEST_EXCHANGE = 10 * SECOND
OFF_LINE = SECOND  # a stamp that much behind the newest, or ahead of what is possible, is not on this line
LATEST = 5 * SECOND  # nor is one that is later than that: no link holds data back so long, and steadily
# Stamps in a row that advance as time does make a new line (reboot, clock set or stopped): so many, …
NEW_LINE_AFTER = 3
NEW_LINE_WITHIN = 750_000_000  # … within the worst jitter of arrival seen on a real autopilot, …
NEW_LINE_SPAN = 2 * SECOND  # … for so long unless they lie behind: a backlog delivered late advances faster
EPOCH_FROM_US = 10**15  # 31 years since boot, or September 2001: a stamp beyond is Unix time


class StampKind(NamedTuple):
    """How a device counts: nanoseconds per count, and nanoseconds until it wraps (``None``: never)."""

    unit: int
    period: int | None


BOOT_MS = StampKind(1_000_000, 2**32 * 1_000_000)  # 49.7 days
BOOT_US_32 = StampKind(1_000, 2**32 * 1_000)  # 71 minutes
US_56 = StampKind(1_000, 2**56 * 1_000)  # DroneCAN's timestamp
BOOT_US = StampKind(1_000, None)
NANOSECONDS = StampKind(1, None)


class Waiting(NamedTuple):
    """Stamps off the line that may make a new one: the first of them, when it came, how many so far."""

    raw: int
    received: int
    seen: int


class Envelope:
    """The lower envelope of arrival minus stamp: a minimum over two buckets that rise as drift may."""

    def __init__(self) -> None:
        self._older: tuple[int, int] | None = None  # (offset, at)
        self._newer: tuple[int, int] | None = None
        self._started = 0
        self._count = 0

    def add(self, offset: int, now: int) -> int:
        """Take in one difference (ns) at ``now`` and return the envelope there."""
        if self._newer is None:
            self._newer, self._started, self._count = (offset, now), now, 1
            return offset
        if now - self._started >= BUCKET and self._count >= ENOUGH_IN_BUCKET:
            self._older, self._newer = self._newer, (offset, now)
            self._started, self._count = now, 0
        self._count += 1
        newer = risen(self._newer, now)
        if offset <= newer:
            self._newer, newer = (offset, now), offset
        return newer if self._older is None else min(newer, risen(self._older, now))

    def at(self, now: int) -> int:
        """Return the envelope at ``now``; there must have been a difference."""
        if self._newer is None:
            raise ValueError("envelope: no arrival yet; add one first")
        newer = risen(self._newer, now)
        return newer if self._older is None else min(newer, risen(self._older, now))


def risen(minimum: tuple[int, int], now: int) -> int:
    """Return a minimum ``(offset, at)`` as it may have drifted up by ``now``."""
    offset, at = minimum
    return offset + int(DRIFT * max(0, now - at))


class Exchange(NamedTuple):
    """One answered TIMESYNC: host minus peer (ns), the round trip (ns), when it ended (host, ns)."""

    offset: int
    round_trip: int
    at: int

    def error(self, now: int) -> float:
        """Bound on the error of the offset at ``now``: half the round trip, and what drifted since (ns)."""
        return self.round_trip / 2 + DRIFT * (now - self.at)


class ClockMap:
    """Maps one clock of one device to the host's monotonic clock, in nanoseconds.

    Stamps of several kinds may share a map when they count from the same instant (milliseconds, microseconds
    and TIMESYNC nanoseconds since boot): counters that wrap are unwrapped to the turn nearest to what is
    expected.

    Attributes
    ----------
    epoch : int
        Counts how often the clock started anew: three stamps in a row, advancing as time does, lay behind.
    disagreements : int
        Answered exchanges that were not used since they contradict the stamps (the peer answers on another
        clock).
    """

    def __init__(self) -> None:
        self.epoch = 0
        self.disagreements = 0
        self._jitter = 0.0
        self._start(None)

    def _start(self, line: tuple[int, int] | None) -> None:
        """Forget what is known of the offset; ``line`` is the first (sensor, received) of the new count."""
        self._latest = line
        self._envelope = Envelope()
        self._offset: int | None = None
        self._exchanges: deque[Exchange] = deque(maxlen=EXCHANGES_KEPT)
        self._best: Exchange | None = None
        self._pending: dict[StampKind, Waiting] = {}

    @property
    def offset(self) -> float | None:
        """Host minus sensor in seconds, ``None`` while nothing is known."""
        return None if self._offset is None else self._offset / SECOND

    @property
    def jitter(self) -> float | None:
        """Running mean of how much later than the offset says the stamps arrive, seconds."""
        return None if self._offset is None else self._jitter / SECOND

    @property
    def method(self) -> str:
        """``timesync``, ``envelope``, or ``arrival`` while no stamp has come."""
        if self._best is not None:
            return "timesync"
        return "arrival" if self._offset is None else "envelope"

    def host_time(self, stamp: int, kind: StampKind, received: int) -> int:
        """Return when ``stamp`` was on the host's clock.

        Parameters
        ----------
        stamp : int
            The device's count; 0 means that it does not know, and gives ``received``.
        kind : StampKind
            What the count is.
        received : int
            When the bytes arrived, nanoseconds on the host's clock.

        Returns
        -------
        int
            Nanoseconds on the host's clock, never later than ``received``, nor below 0: beside a stamp from
            the far future a true one would lie further back than a sample's time can say.
        """
        if stamp == 0:
            return received
        sensor, on_line = self._place(stamp * kind.unit, kind, received)
        if on_line:
            self._arrived(sensor, received)
        return received if self._offset is None else min(received, max(0, sensor + self._offset))

    def exchanged(self, sent: int, peer: int, received: int) -> None:
        """Take in one answered TIMESYNC: the peer read ``peer`` between ``sent`` and ``received`` (ns)."""
        round_trip = received - sent
        usable = 0 <= round_trip <= SLOWEST_EXCHANGE
        if not usable or not self._place(peer, NANOSECONDS, received)[1]:
            self.disagreements += 1
            return
        self._exchanges.append(Exchange((sent + received) // 2 - peer, round_trip, received))
        self._best = self._choose(self._envelope.add(received - peer, received), received)
        self._arrived(peer, received)

    def _choose(self, envelope: int, now: int) -> Exchange | None:
        """Return the exchange with the smallest error, if there are enough of them and it fits the stamps."""
        if len(self._exchanges) < EXCHANGES_NEEDED:
            return None
        best = min(self._exchanges, key=lambda exchange: exchange.error(now))
        if best.offset <= envelope + best.error(now):  # else a stamp came before it can have been given
            return best
        self.disagreements += 1
        return None

    def _arrived(self, sensor: int, received: int) -> None:
        """Renew the offset (and the jitter) with one arrival on the line."""
        self._offset = self._envelope.add(received - sensor, received)
        if self._best is not None and received - self._exchanges[-1].at > EXCHANGE_STALE:
            self._best = None
        if self._best is not None:
            self._offset = min(self._offset, self._best.offset)
        self._jitter += 0.02 * (received - sensor - self._offset - self._jitter)

    def _place(self, raw: int, kind: StampKind, received: int) -> tuple[int, bool]:
        """Return ``raw`` (ns) unwrapped, and whether it lies on the line of this clock."""
        if self._latest is None:
            self._latest = (raw, received)
            return raw, True
        newest, at = self._latest
        expected = newest + received - at
        sensor = raw if kind.period is None else raw + kind.period * round((expected - raw) / kind.period)
        late = self._offset is not None and received - sensor - self._offset > LATEST
        if newest - OFF_LINE <= sensor <= expected + OFF_LINE and not late:
            self._pending.pop(kind, None)
            if sensor > newest:
                self._latest = (sensor, received)
            return sensor, True
        if self._starts_anew(raw, kind, received, newest):
            self.epoch += raw < newest
            self._start((raw, received))
            return raw, True
        return sensor, False

    def _starts_anew(self, raw: int, kind: StampKind, received: int, newest: int) -> bool:
        """Whether a stamp off the line goes on a new count, rather than being stale or wrong."""
        first = self._pending.get(kind)
        if first is None or abs(raw - first.raw - (received - first.received)) > NEW_LINE_WITHIN:
            self._pending[kind] = Waiting(raw, received, 1)
            return False
        self._pending[kind] = first = first._replace(seen=first.seen + 1)
        long_enough = raw < newest - OFF_LINE or received - first.received >= NEW_LINE_SPAN
        return first.seen >= NEW_LINE_AFTER and raw > first.raw and long_enough


class DeviceClocks:
    """The clocks of one device: what counts from its boot, and what counts from 1970."""

    def __init__(self) -> None:
        self.boot = ClockMap()
        self.unix = ClockMap()

    def microseconds(self, stamp: int, received: int) -> int:
        """Map a 64-bit ``time_usec``, which is since boot or since 1970 by its magnitude."""
        clock = self.unix if stamp > EPOCH_FROM_US else self.boot
        return clock.host_time(stamp, BOOT_US, received)

    def exchanged(self, sent: int, peer: int, received: int) -> None:
        """Take in one answered TIMESYNC (ns) for the clock that it speaks of."""
        clock = self.unix if peer > EPOCH_FROM_US * 1000 else self.boot
        clock.exchanged(sent, peer, received)
