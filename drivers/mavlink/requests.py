"""Asking an autopilot for messages: MAV_CMD_SET_MESSAGE_INTERVAL, REQUEST_DATA_STREAM where it refuses.

One question is open at a time, since COMMAND_ACK does not say which message it is about. What was granted and
then falls silent is asked for again, ever more rarely; after a reboot of the autopilot everything is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from drivers.mavlink.dialect import IDENTIFIERS
from drivers.sample import SECOND

SET_MESSAGE_INTERVAL = 511
ACCEPTED, TEMPORARILY_REJECTED, IN_PROGRESS = 0, 1, 5  # MAV_RESULT

ANSWER_WITHIN = SECOND
TRIES = 3
SILENT_AFTER = 5 * SECOND
RAREST = 60 * SECOND

# MAV_DATA_STREAM in which ArduPilot sends a message (GCS_Mavlink.cpp); it refuses an interval for
# WHEEL_DISTANCE
STREAMS: dict[str, int] = {
    "RAW_IMU": 1,
    "SCALED_IMU": 1,
    "SCALED_IMU2": 1,
    "SCALED_IMU3": 1,
    "HIGHRES_IMU": 1,
    "SCALED_PRESSURE": 1,
    "SCALED_PRESSURE2": 1,
    "SCALED_PRESSURE3": 1,
    "GPS_RAW_INT": 2,
    "GPS2_RAW": 2,
    "POSITION_TARGET_LOCAL_NED": 2,
    "SERVO_OUTPUT_RAW": 3,
    "ATTITUDE": 10,
    "RPM": 10,
    "WHEEL_DISTANCE": 10,
    "VFR_HUD": 11,
    "DISTANCE_SENSOR": 12,
}


class IntervalRequest(NamedTuple):
    """MAV_CMD_SET_MESSAGE_INTERVAL: the message's id, and microseconds between two of them."""

    identifier: int
    interval_us: int


class StreamRequest(NamedTuple):
    """REQUEST_DATA_STREAM: the stream, and how many a second."""

    stream: int
    rate: int


class State(Enum):
    """What became of the wish for one message."""

    UNASKED = 0
    ASKED = 1
    GRANTED = 2
    REFUSED = 3


@dataclass
class Wish:
    """One message that is wanted: how often, what became of it, when it was asked for and heard (ns)."""

    name: str
    rate: float
    state: State = State.UNASKED
    tries: int = 0
    asked: int = 0
    heard: int = 0
    patience: int = SILENT_AFTER


class MessageRequests:
    """Asks for messages, one at a time.

    Parameters
    ----------
    rates : mapping of str to float
        Hertz by message name; HEARTBEAT need not be asked for.

    Raises
    ------
    ValueError
        A message that no dialect knows, or a rate that is not positive.
    """

    def __init__(self, rates: Mapping[str, float]) -> None:
        for name, rate in rates.items():
            if name not in IDENTIFIERS:
                raise ValueError(f"rates.{name}: no such message in the dialect 'all'")
            if not 0.0 < rate <= 1000.0:
                raise ValueError(f"rates.{name}: must be above 0 and at most 1000 Hz, got {rate}")
        self._wishes = {
            IDENTIFIERS[name]: Wish(name, rate) for name, rate in rates.items() if name != "HEARTBEAT"
        }
        self._open: int | None = None
        self._streams: list[int] = []

    @property
    def refused(self) -> list[str]:
        """The messages for which the autopilot will not take an interval."""
        return [wish.name for wish in self._wishes.values() if wish.state is State.REFUSED]

    def restart(self) -> None:
        """Ask for everything anew: the autopilot has rebooted and forgotten."""
        for wish in self._wishes.values():
            wish.state, wish.tries, wish.patience = State.UNASKED, 0, SILENT_AFTER
        self._open = None
        self._streams = []

    def heard(self, identifier: int, now: int) -> None:
        """Note that a message came."""
        wish = self._wishes.get(identifier)
        if wish is not None:
            wish.heard = now
            wish.patience = SILENT_AFTER

    def acknowledged(self, result: int) -> None:
        """Take in the COMMAND_ACK to the question that is open; harmless when none is."""
        if self._open is None or result == IN_PROGRESS:
            return
        wish = self._wishes[self._open]
        self._open = None
        if result == ACCEPTED:
            wish.state, wish.tries = State.GRANTED, 0
        elif result != TEMPORARILY_REJECTED or wish.tries >= TRIES:
            self._refuse(wish)
        else:
            wish.state = State.UNASKED

    def due(self, now: int) -> IntervalRequest | StreamRequest | None:
        """Return what to send now, if anything."""
        if self._open is not None:
            open_wish = self._wishes[self._open]
            if now - open_wish.asked < ANSWER_WITHIN:
                return None
            self._unanswered(open_wish)
        if self._streams:
            return self._ask_stream(self._streams.pop(0))
        for identifier, wish in self._wishes.items():
            if wish.state is State.GRANTED and now - max(wish.heard, wish.asked) > wish.patience:
                wish.state, wish.patience = State.UNASKED, min(2 * wish.patience, RAREST)
            if wish.state is State.UNASKED:
                wish.state, wish.asked, wish.tries = State.ASKED, now, wish.tries + 1
                self._open = identifier
                return IntervalRequest(identifier, round(1e6 / wish.rate))
        return None

    def _unanswered(self, wish: Wish) -> None:
        self._open = None
        if wish.tries < TRIES:
            wish.state = State.UNASKED
        elif wish.heard > wish.asked:
            wish.state, wish.tries = State.GRANTED, 0  # it comes: the answer was lost
        else:
            self._refuse(wish)

    def _refuse(self, wish: Wish) -> None:
        wish.state = State.REFUSED
        stream = STREAMS.get(wish.name)
        if stream is not None and stream not in self._streams:
            self._streams.append(stream)

    def _ask_stream(self, stream: int) -> StreamRequest:
        """Ask for a stream at the highest rate refused; intervals granted in it are then to be set again."""
        members = [wish for wish in self._wishes.values() if STREAMS.get(wish.name) == stream]
        for wish in members:
            if wish.state is State.GRANTED:
                wish.state = State.UNASKED
        rate = max((wish.rate for wish in members if wish.state is State.REFUSED), default=1.0)
        return StreamRequest(stream, max(1, round(rate)))
