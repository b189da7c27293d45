"""What a CAN link needs to know, as the configuration's ``[[link]]`` table says it."""

from __future__ import annotations

import msgspec

DRONECAN = "dronecan"
DBC = "dbc"
PROTOCOLS = (DRONECAN, DBC)


class SignalSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One signal of a DBC file and what it says of the vehicle.

    Attributes
    ----------
    signal : str
        ``MESSAGE.SIGNAL``, as the DBC file names them.
    measures : str
        One of :data:`drivers.can.units.MEASURES`.
    scale : float or None
        Factor from the value that the DBC file gives to SI; ``None``: by the unit that it gives.
    offset : float
        Added after scaling, SI units.
    reversed : bool
        The signal counts the other way: its sign is changed, before the offset is added.
    index : int
        Which wheel or motor.
    beacon : int or None
        For a range: to which beacon.
    sigma : float or None
        Standard deviation that the readings claim, SI units.
    """

    signal: str
    measures: str
    scale: float | None = None
    offset: float = 0.0
    reversed: bool = False
    index: int = 0
    beacon: int | None = None
    sigma: float | None = None


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
        ``dronecan`` or ``dbc``.
    dbc : str
        The DBC file, for ``protocol = "dbc"``.
    signals : tuple of SignalSettings
        What of it is wanted.
    options : dict
        Further arguments of the python-can interface, e.g. ``{rtscts = true}`` for ``slcan``.
    range_orientation : int
        Where a range finder looks (MAV_SENSOR_ORIENTATION, 25: down) when its message leaves that undefined.
    """

    interface: str = "socketcan"
    channel: str = "can0"
    bitrate: int | None = None
    protocol: str = DRONECAN
    dbc: str = ""
    signals: tuple[SignalSettings, ...] = ()
    options: dict[str, str | int | float | bool] = {}
    range_orientation: int = 25

    def __post_init__(self) -> None:
        """Refuse what would otherwise fail only when the bus is opened.

        Raises
        ------
        ValueError
            The protocol is not one that can be decoded, or lacks what it needs.
        """
        if self.protocol not in PROTOCOLS:
            raise ValueError(
                f"protocol: {self.protocol!r} cannot be decoded; supported: {', '.join(PROTOCOLS)}"
            )
        if self.protocol == DBC and not (self.dbc and self.signals):
            raise ValueError("protocol: 'dbc' needs a DBC file and at least one signal")
