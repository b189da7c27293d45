"""A live CAN bus, by python-can on any interface, or ArduPilot's simulated one."""

from __future__ import annotations

import errno
import logging
import os
import socket
import time
from collections import Counter
from typing import Any

import can
from can.interfaces.slcan import slcanBus

from drivers.can.arrival import ArrivalClock
from drivers.can.decoder import decoder_of
from drivers.can.frame import CanFrame
from drivers.can.multicast import MulticastBus
from drivers.can.settings import CanSettings
from drivers.link import LinkError
from drivers.sample import SECOND, LinkReport, Sample

MULTICAST = "mcast"
SERIAL = "slcan"
SOCKETCAN = "socketcan"

# What python-can logs it raises as well: at every attempt to open a bus that is not there the journal would grow.
logging.getLogger("can").setLevel(logging.CRITICAL)

_MOST_PER_POLL = 512
_MOST_DAMAGED = 1_000
_SILENT_NS = SECOND
_BUS_OFF = 0x40  # CAN_ERR_BUSOFF of linux/can/error.h, an error frame's class

# Interfaces that filter before a frame reaches Python; for the others the decoder's own look is cheaper.
_FILTERING = frozenset({SOCKETCAN, "kvaser", "vector", "etas", "systec"})

_REMEDIES = {
    errno.ENODEV: "no such interface; create it with ip link, or name one of those that ip link shows",
    errno.ENXIO: "the device has gone; plug it in again",
    errno.ENOENT: "no such device; plug it in, or correct the channel",
    errno.EIO: "the device has gone; plug it in again",
    errno.ENETDOWN: "the interface is down; bring it up with ip link set CHANNEL up",
    errno.EAFNOSUPPORT: "this kernel has no SocketCAN; load its modules can and can_raw, or use slcan",
    errno.EPROTONOSUPPORT: "this kernel has no raw CAN sockets; load its module can_raw, or use slcan",
    errno.EACCES: "permission denied; let the service's user read and write the device",
    errno.EPERM: "not permitted; let the service's user open CAN sockets (RestrictAddressFamilies)",
    errno.EBUSY: "another program holds it; stop that, or use another channel",
}
_OPEN_REMEDY = "check interface, channel, bitrate and options"
_READ_REMEDY = "the link is opened again"


def _code(error: BaseException) -> int | None:
    """Return the errno at the root of a python-can error, which wraps those of sockets and serial lines."""
    cause: BaseException | None = error
    while cause is not None:
        number = cause.errno if isinstance(cause, OSError) else getattr(cause, "error_code", None)
        if isinstance(number, int):
            return number
        cause = cause.__cause__
    return None


def _is_damage(error: Exception) -> bool:
    """Tell whether an interface could not read one frame; anything else is the end of the bus."""
    if isinstance(error, can.CanError):
        return isinstance(error.__cause__, Exception) and not isinstance(error.__cause__, OSError)
    return not isinstance(error, OSError)


def _expect_up(bus: can.BusABC) -> None:
    """Raise what the kernel has against a socket that it has bound: it binds to an interface that is down."""
    with socket.socket(fileno=os.dup(bus.fileno())) as bound:
        number = bound.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
    if number:
        raise OSError(number, os.strerror(number))


class CanLink:
    """One CAN bus; implements :class:`drivers.link.Link`.

    Parameters
    ----------
    name : str
        As in the configuration.
    settings : CanSettings
        Which bus, and what is spoken on it.

    Raises
    ------
    ValueError
        The DBC file cannot be used, or a signal is not in it.
    """

    def __init__(self, name: str, settings: CanSettings) -> None:
        self._name = name
        self._settings = settings
        self._decoder = decoder_of(name, settings)
        self._arrivals = ArrivalClock()
        self._bus: can.BusABC | None = None
        self._broken: LinkError | None = None
        self._refused: Counter[str] = Counter()
        self._damaged_in_a_row = 0
        self._samples = 0
        self._ignored = 0
        self._opened = 0
        self._heard_ns = 0

    @property
    def place(self) -> str:
        """The bus in words, for messages."""
        return f"{self._settings.interface} {self._settings.channel}"

    def _remedy(self, error: Exception, otherwise: str) -> str:
        return _REMEDIES.get(_code(error) or 0, otherwise).replace("CHANNEL", self._settings.channel)

    def open(self) -> None:
        """Open the bus and let only the wanted messages through.

        Raises
        ------
        LinkError
            The interface is absent, down or unknown, the device taken, an argument wrong.
        """
        self.close()
        try:
            self._bus = self._open_bus()
            if self._settings.interface == SOCKETCAN:
                _expect_up(self._bus)
        except (can.CanError, OSError, ImportError, ValueError, TypeError, RuntimeError) as error:
            self.close()
            remedy = self._remedy(error, _OPEN_REMEDY)
            if isinstance(error, NotImplementedError):  # unknown to python-can, or its driver is missing
                known = ", ".join(sorted({MULTICAST, *can.VALID_INTERFACES}))
                remedy = f"interface should be one of {known}, with its driver installed"
            raise LinkError(f"{self._name}: cannot open {self.place}: {error}; {remedy}") from error
        self._arrivals.seen_empty(time.monotonic_ns())
        self._broken = None
        self._opened += 1
        self._damaged_in_a_row = 0
        self._heard_ns = time.monotonic_ns()

    def _open_bus(self) -> can.BusABC:
        settings = self._settings
        if settings.interface == MULTICAST:
            return MulticastBus(settings.channel)
        arguments: dict[str, Any] = dict(settings.options)
        if settings.interface == SERIAL:
            # python-can sleeps 2 s here for adapters that restart when they are opened. Most do not, and all the
            # while nothing is read: after every reconnection the vehicle would go unheard for that long.
            arguments.setdefault("sleep_after_open", 0.0)
        if settings.bitrate is not None:
            arguments["bitrate"] = settings.bitrate
        if settings.interface in _FILTERING:
            arguments["can_filters"] = [
                {"can_id": wanted.identifier, "can_mask": wanted.mask, "extended": wanted.extended}
                for wanted in self._decoder.filters
            ]
        # Only what the configuration says: python-can would also read files of its own in the home directory.
        return can.Bus(settings.channel, settings.interface, ignore_config=True, **arguments)

    def poll(self, timeout: float) -> list[Sample]:
        """Wait at most ``timeout`` seconds for a frame; return its samples and of those behind it.

        Raises
        ------
        LinkError
            The bus is not open, has gone, is off, or brings nothing but damaged frames.
        """
        bus = self._bus
        if bus is None:
            raise LinkError(f"{self._name}: {self.place} is not open; open it first")
        if self._broken is not None:
            raise self._broken
        samples: list[Sample] = []
        try:
            if self._take(bus, 0.0, samples) or self._take(bus, timeout, samples):
                self._drain(bus, samples)
        except LinkError as error:
            if not samples:
                raise
            self._broken = error  # what came before it is not lost; the next call raises
        self._samples += len(samples)
        return samples

    def _drain(self, bus: can.BusABC, samples: list[Sample]) -> None:
        for _ in range(_MOST_PER_POLL):
            if not self._take(bus, 0.0, samples):
                return

    def _take(self, bus: can.BusABC, timeout: float, samples: list[Sample]) -> bool:
        """Receive one frame and append what it completes; false when none was waiting."""
        before_ns = time.monotonic_ns()
        try:
            message = bus.recv(timeout)
        except (can.CanError, OSError, ValueError, IndexError) as error:
            self._fail(error)
            return True
        if message is None:
            self._arrivals.seen_empty(before_ns)
            return False
        self._damaged_in_a_row = 0
        self._heard_ns = time.monotonic_ns()
        received_ns = self._arrivals.arrival(message.timestamp, self._heard_ns, time.time())
        if message.is_error_frame:
            self._count_error(message)
        elif message.is_remote_frame:
            self._ignored += 1
        else:
            frame = CanFrame(
                message.arbitration_id, bytes(message.data), message.is_extended_id, message.is_fd
            )
            samples += self._decoder.decode(frame, received_ns)
        return True

    def _fail(self, error: Exception) -> None:
        """Count a damaged frame; a broken bus ends the link."""
        if _is_damage(error):
            if isinstance(self._bus, slcanBus) and isinstance(error.__cause__, UnicodeDecodeError):
                self._bus.flush()  # python-can would keep the unreadable bytes, and fail for ever
            self._refused["damaged_frame"] += 1
            self._damaged_in_a_row += 1
            if self._damaged_in_a_row < _MOST_DAMAGED:
                return
            raise LinkError(
                f"{self._name}: {self.place} brings only damaged frames: {error}; check bitrate and interface"
            ) from error
        remedy = self._remedy(error, _READ_REMEDY)
        raise LinkError(f"{self._name}: {self.place} broke: {error}; {remedy}") from error

    def _count_error(self, message: can.Message) -> None:
        self._refused["error_frame"] += 1
        if message.arbitration_id & _BUS_OFF:
            raise LinkError(
                f"{self._name}: {self.place}: the controller is off the bus after too many errors; "
                "check wiring, termination and bitrate, and give the interface a restart-ms"
            )

    def report(self) -> LinkReport:
        """Return the totals since the link was made, and its state."""
        state, reason = "up", ""
        if self._bus is None:
            state = "opening"
        elif time.monotonic_ns() - self._heard_ns > _SILENT_NS:
            state, reason = "silent", f"nothing heard on {self.place} for more than a second"
        clock = self._decoder.clock
        return LinkReport(
            link=self._name,
            state=state,
            reason=reason,
            messages=self._decoder.messages,
            samples=self._samples,
            malformed=dict(self._decoder.malformed + self._refused),
            unusable=dict(self._decoder.unusable),
            ignored=self._decoder.ignored + self._ignored,
            opened=self._opened,
            clock="arrival" if clock is None else clock.method,
            offset=None if clock is None else clock.offset,
            jitter=None if clock is None else clock.jitter,
        )

    def close(self) -> None:
        """Close the bus; harmless when it is closed."""
        bus, self._bus = self._bus, None
        if bus is None:
            return
        try:
            bus.shutdown()
        except (can.CanError, OSError) as error:
            # The device went before the farewell; there is nothing left to close.
            self._refused[f"close.{type(error).__name__}"] += 1
