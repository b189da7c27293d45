"""What the link says: messages packed by pymavlink, as an onboard computer of the vehicle."""

from __future__ import annotations

from typing import Any, cast

from drivers.mavlink.dialect import mavlink
from drivers.mavlink.requests import SET_MESSAGE_INTERVAL, IntervalRequest, StreamRequest
from drivers.mavlink.signing import stamp_now
from drivers.mavlink.timesync import TimeSync

ONBOARD_CONTROLLER, NO_AUTOPILOT, ACTIVE, VERSION = 18, 8, 4, 3


class Speaker:
    """Packs messages with our address, sequence and, with a key, signature.

    Parameters
    ----------
    system, component : int
        Our address; :attr:`system` follows the vehicle once it is known.
    key : bytes or None
        To sign with.
    """

    def __init__(self, system: int, component: int, key: bytes | None) -> None:
        self._mav: Any = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        if key is not None:
            signing = self._mav.signing
            signing.secret_key, signing.sign_outgoing, signing.timestamp = key, True, stamp_now()

    @property
    def system(self) -> int:
        """Our system id."""
        return cast(int, self._mav.srcSystem)

    @system.setter
    def system(self, system: int) -> None:
        self._mav.srcSystem = system

    @property
    def component(self) -> int:
        """Our component id."""
        return cast(int, self._mav.srcComponent)

    def heartbeat(self) -> bytes:
        """Return HEARTBEAT as an onboard controller without an autopilot."""
        return self._pack(
            mavlink.MAVLink_heartbeat_message(ONBOARD_CONTROLLER, NO_AUTOPILOT, 0, 0, ACTIVE, VERSION)
        )

    def timesync(self, values: TimeSync) -> bytes:
        """Return TIMESYNC."""
        return self._pack(mavlink.MAVLink_timesync_message(values.tc1, values.ts1))

    def request(self, target: tuple[int, int], request: IntervalRequest | StreamRequest) -> bytes:
        """Return the question for a message or a stream, to (system, component)."""
        system, component = target
        if isinstance(request, StreamRequest):
            message = mavlink.MAVLink_request_data_stream_message(
                system, component, request.stream, request.rate, 1
            )
        else:
            message = mavlink.MAVLink_command_long_message(
                system,
                component,
                SET_MESSAGE_INTERVAL,
                0,
                *(float(request.identifier), float(request.interval_us), 0.0, 0.0, 0.0, 0.0, 0.0),
            )
        return self._pack(message)

    def _pack(self, message: Any) -> bytes:
        signing = self._mav.signing
        signing.timestamp = max(signing.timestamp, stamp_now())
        packed = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
        return packed
