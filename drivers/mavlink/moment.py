"""What a handler is given beside the fields: when they came, the sender's clocks, what to count."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

from drivers.clock import BOOT_MS, BOOT_US_32, DeviceClocks
from drivers.sample import AnyReading

Timed = tuple[int, AnyReading]


class Moment:
    """One message at hand.

    Attributes
    ----------
    name : str
        Of the message.
    received : int
        When it arrived, nanoseconds.
    autopilot : int or None
        MAV_AUTOPILOT of the vehicle; ``None`` before its first heartbeat.
    """

    __slots__ = ("_clocks", "_passed_over", "_refused", "autopilot", "name", "received")

    def __init__(
        self,
        name: str,
        received: int,
        clocks: DeviceClocks,
        autopilot: int | None,
        refused: Counter[str],
        passed_over: Counter[str],
    ) -> None:
        self.name = name
        self.received = received
        self.autopilot = autopilot
        self._clocks = clocks
        self._refused = refused
        self._passed_over = passed_over

    def refuse(self, field: str) -> None:
        """Count a field that is broken (no number, impossible), under ``MESSAGE.field``."""
        self._refused[f"{self.name}.{field}"] += 1

    def pass_over(self, field: str) -> None:
        """Count a field by which a sound message says that it has nothing for us, under ``MESSAGE.field``."""
        self._passed_over[f"{self.name}.{field}"] += 1

    def boot_ms(self, stamp: int) -> int:
        """Map ``time_boot_ms``, which wraps after 49.7 days."""
        return self._clocks.boot.host_time(stamp, BOOT_MS, self.received)

    def boot_us_32(self, stamp: int) -> int:
        """Map a ``time_usec`` of 32 bits, which wraps after 71 minutes."""
        return self._clocks.boot.host_time(stamp, BOOT_US_32, self.received)

    def microseconds(self, stamp: int) -> int:
        """Map a ``time_usec`` of 64 bits, since boot or since 1970."""
        return self._clocks.microseconds(stamp, self.received)


Handler = Callable[[Any, Moment], list[Timed]]
"""Makes readings with their times of the fields of one message; keeps what it must remember of one sender."""
