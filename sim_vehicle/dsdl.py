"""DroneCAN values to CAN frames, by the ``dronecan`` package's own serialisation, without a node or a thread.

The package carries no types: this module is where its values come in, to leave as
:class:`~sim_vehicle.frame.CanFrame`.
"""

from __future__ import annotations

from collections import defaultdict
from typing import Any, cast

import dronecan
from dronecan import transport

from sim_vehicle.frame import CanFrame

PRIORITY = 16
"""Of every transfer, 0 the highest to 31 the lowest."""


def message(name: str, **values: Any) -> Any:
    """Return a DroneCAN message by its name (``uavcan.equipment.gnss.Fix2``), its plain fields filled in.

    Raises
    ------
    KeyError
        There is no such message.
    """
    types = cast("dict[str, Any]", cast(Any, dronecan).TYPENAMES)
    return types[name](**values)


class Node:
    """One node's sending side: its number, and the transfer numbers that it counts for each kind of message.

    Parameters
    ----------
    number : int
        1 to 127.

    Raises
    ------
    ValueError
        No node can have this number.
    """

    def __init__(self, number: int) -> None:
        if not 1 <= number <= 127:
            raise ValueError(f"DroneCAN node: number needs to be from 1 to 127, got {number}")
        self.number = number
        self._transfers: defaultdict[str, int] = defaultdict(int)

    def frames(self, value: Any) -> list[CanFrame]:
        """Return the frames of one broadcast transfer: tail bytes, and a CRC before several."""
        kind = str(cast(Any, dronecan).get_dronecan_data_type(value))
        transfer = cast(Any, transport).Transfer(
            transfer_id=self._transfers[kind],
            source_node_id=self.number,
            payload=value,
            transfer_priority=PRIORITY,
        )
        self._transfers[kind] = (self._transfers[kind] + 1) % 32
        return [CanFrame(int(frame.message_id), bytes(frame.bytes)) for frame in transfer.to_frames()]
