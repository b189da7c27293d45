"""What a CAN link needs to know, as the configuration's ``[[link]]`` table says it."""

from __future__ import annotations

import msgspec

PROTOCOLS = ("dronecan",)


class CanSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One CAN bus and the language spoken on it.

    Attributes
    ----------
    interface : str
        Any interface of python-can (``socketcan``, ``slcan``, ``virtual``, ``udp_multicast`` …), or
        ``mcast``: the multicast bus of ArduPilot's simulator.
    channel : str
        The interface's own name for the bus: ``can0``, ``/dev/ttyACM0``, ``239.74.163.2``; for ``mcast`` its
        number.
    bitrate : int or None
        Bits per second; ``None`` leaves it as it is (SocketCAN's is set by ``ip link``).
    protocol : str
        ``dronecan``.
    options : dict
        Further arguments of the python-can interface, e.g. ``{rtscts = true}`` for ``slcan``.
    range_orientation : int
        Where a range finder looks (MAV_SENSOR_ORIENTATION, 25: down) when its message leaves that undefined.
    """

    interface: str = "socketcan"
    channel: str = "can0"
    bitrate: int | None = None
    protocol: str = "dronecan"
    options: dict[str, str | int | float | bool] = {}
    range_orientation: int = 25

    def __post_init__(self) -> None:
        """Refuse what would otherwise fail only when the bus is opened.

        Raises
        ------
        ValueError
            The protocol is not one that can be decoded.
        """
        if self.protocol not in PROTOCOLS:
            raise ValueError(
                f"protocol: {self.protocol!r} cannot be decoded; supported: {', '.join(PROTOCOLS)}"
            )
