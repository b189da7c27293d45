"""The clocks on board: each counts from its own boot and runs a little fast or slow against the host's."""

from __future__ import annotations

from dataclasses import dataclass

LOG_EPOCH = 1_700_000_000
"""Unix seconds at which every written drive begins; a drive in real time begins when it is started."""


@dataclass(frozen=True, slots=True)
class BoardClock:
    """A clock on board.

    Attributes
    ----------
    uptime : float
        Seconds since its boot when the drive begins.
    drift : float
        How much faster than true time it runs: 20e-6 gains 20 microseconds a second.
    """

    uptime: float = 0.0
    drift: float = 0.0

    def nanoseconds(self, time: float) -> int:
        """Return nanoseconds since boot at ``time``, seconds since the drive began."""
        return max(0, round((self.uptime + time * (1.0 + self.drift)) * 1e9))

    def microseconds(self, time: float) -> int:
        """Return microseconds since boot at ``time``."""
        return self.nanoseconds(time) // 1000

    def milliseconds(self, time: float) -> int:
        """Return milliseconds since boot at ``time``, in the 32 bits of the wire (a wrap in 49.7 days)."""
        return (self.nanoseconds(time) // 1_000_000) & 0xFFFF_FFFF
