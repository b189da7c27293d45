"""The multicast bus of ArduPilot's simulator as a python-can bus, received by the ``dronecan`` package.

ArduPilot SITL sends each frame as a UDP datagram with a header of its own to 239.65.82.N; python-can's
``udp_multicast`` frames differently. The package's driver receives in a child process. That process is
started here rather than by the driver's constructor, because the driver's never ends it, waits for frames by
spinning, and keeps a million of them.
"""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import queue
import signal
from typing import Any

import can
from dronecan.driver import CANFrame
from dronecan.driver.mcast import io_process  # pyright: ignore[reportUnknownVariableType]

_RECEIVE_QUEUE = 10_000
_SEND_QUEUE = 1_000
_PR_SET_PDEATHSIG = 1
_SECONDS_TO_END = 1.0


def _receive(bus_number: str, to_send: Any, received: Any, parent: int) -> None:
    """Run the driver's loop; say what ended it. Ends with its parent, however that ends."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        return  # it ended before it could be watched
    try:
        io_process(bus_number, to_send, received)
    except OSError as error:
        received.put(f"{error.strerror or error}; multicast needs a route: ip route add 224.0.0.0/4 dev lo")
    except queue.Full:
        return  # whoever reads is too slow, and finds this process gone


class MulticastBus(can.BusABC):
    """One bus of ArduPilot's simulator.

    Parameters
    ----------
    channel : str
        The bus number, 0 to 255: the last part of the group's address.

    Raises
    ------
    ValueError
        The channel is not such a number.
    """

    def __init__(self, channel: str) -> None:
        if not (channel.isdecimal() and int(channel) <= 255):
            raise ValueError(f"channel: mcast needs the number of the bus, 0 to 255, got {channel!r}")
        # Forked: nothing is imported anew, and the process that opens a link has no other thread.
        context = multiprocessing.get_context("fork")
        self._received: Any = context.Queue(_RECEIVE_QUEUE)
        self._to_send: Any = context.Queue(_SEND_QUEUE)
        self._process = context.Process(
            target=_receive,
            name=f"mcast {channel}",
            args=(channel, self._to_send, self._received, os.getpid()),
            daemon=True,
        )
        self._process.start()
        self.channel_info = f"mcast {channel}"
        super().__init__(channel)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        try:
            frame = self._received.get(block=timeout != 0.0, timeout=timeout)
        except queue.Empty:
            if not self._process.is_alive():
                raise can.CanOperationError("the receiving process has ended") from None
            return None, False
        if isinstance(frame, str):
            raise can.CanOperationError(frame)
        message = can.Message(
            timestamp=frame.ts_real,
            arbitration_id=frame.id,
            is_extended_id=frame.extended,
            is_fd=frame.canfd,
            data=frame.data,
        )
        return message, False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Queue a frame for the group."""
        frame: Any = CANFrame(msg.arbitration_id, bytes(msg.data), msg.is_extended_id, canfd=msg.is_fd)
        self._to_send.put(frame, timeout=timeout)

    def shutdown(self) -> None:
        """End the receiving process and wait for it."""
        super().shutdown()
        self._process.kill()
        self._process.join(_SECONDS_TO_END)
        for frames in (self._received, self._to_send):
            frames.cancel_join_thread()
            frames.close()
