"""CAN: a bus or its recording into samples. DroneCAN today."""

from drivers.can.dronecan import Decoder
from drivers.can.frame import CanFrame
from drivers.can.settings import CanSettings

__all__ = ["CanFrame", "CanSettings", "Decoder"]
