"""CAN: a bus or its recording into samples, spoken as DroneCAN or described by a DBC file."""

from drivers.can.decoder import FrameDecoder, decoder_of
from drivers.can.dronecan import Decoder
from drivers.can.frame import CanFrame
from drivers.can.link import CanLink
from drivers.can.settings import CanSettings, SignalSettings

__all__ = [
    "CanFrame",
    "CanLink",
    "CanSettings",
    "Decoder",
    "FrameDecoder",
    "SignalSettings",
    "decoder_of",
]
