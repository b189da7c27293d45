"""MAVLink: frames in bytes, messages in frames, samples in messages; and the live link."""

from drivers.mavlink.decode import Decoder
from drivers.mavlink.settings import DEFAULT_RATES, MavlinkSettings, ServoCalibration

__all__ = ["DEFAULT_RATES", "Decoder", "MavlinkSettings", "ServoCalibration"]
