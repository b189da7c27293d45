"""CAN: a bus or its recording into samples. DroneCAN today."""

from drivers.can.dronecan import Decoder
from drivers.can.frame import CanFrame
from drivers.can.link import CanLink
from drivers.can.settings import CanSettings

__all__ = ["CanFrame", "CanLink", "CanSettings", "Decoder"]
