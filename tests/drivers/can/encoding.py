"""DroneCAN frames as the dronecan package's own encoder makes them."""

from __future__ import annotations

from typing import Any

import dronecan
from dronecan.transport import Transfer

from drivers.can import CanFrame


def message(name: str, /, **fields: Any) -> Any:
    """A message of the standard name space, e.g. ``message("esc.RawCommand", cmd=[1, 2])``."""
    return dronecan.TYPENAMES[f"uavcan.equipment.{name}"](**fields)


def frames(payload: Any, *, source: int = 42, number: int = 0, flexible: bool = False) -> list[CanFrame]:
    """The frames of one transfer."""
    transfer = Transfer(
        payload=payload, source_node_id=source, transfer_id=number, transfer_priority=16, canfd=flexible
    )
    if not transfer.payload:
        transfer.payload = b""
    return [CanFrame(f.message_id, bytes(f.bytes), True, flexible) for f in transfer.to_frames()]


def fix(**fields: Any) -> Any:
    """A gnss.Fix2 of ten frames: a rover in Canberra, unless a field says otherwise."""
    position = dronecan.uavcan.equipment.gnss.Fix2(
        latitude_deg_1e8=-3536326100,
        longitude_deg_1e8=14916523000,
        height_msl_mm=584_000,
        height_ellipsoid_mm=603_000,
        ned_velocity=[1.5, -2.25, 0.125],
        sats_used=10,
        status=3,
        covariance=[0.25, 0.25, 1.0, 0.0625, 0.0625, 0.0625],
    )
    for name, value in fields.items():
        setattr(position, name, value)
    return position
