"""What observes the truth: each sensor is its settings, its own random numbers, and ``measure(truth)``."""

from sim_vehicle.sensors.barometer import Barometer, BarometerSettings, PressureReading
from sim_vehicle.sensors.beacons import (
    BeaconLoss,
    BeaconReading,
    BeaconSite,
    Ranger,
    RangerSettings,
    StrayRange,
)
from sim_vehicle.sensors.cadence import Cadence
from sim_vehicle.sensors.compass import Compass, CompassReading, CompassSettings
from sim_vehicle.sensors.gnss import Gnss, GnssReading, GnssSettings
from sim_vehicle.sensors.inertial import Inertial, InertialReading, InertialSettings
from sim_vehicle.sensors.interference import Drag, Interference, Jamming, Stray
from sim_vehicle.sensors.wheels import Slip, WheelReading, Wheels, WheelSettings

__all__ = [
    "Barometer",
    "BarometerSettings",
    "BeaconLoss",
    "BeaconReading",
    "BeaconSite",
    "Cadence",
    "Compass",
    "CompassReading",
    "CompassSettings",
    "Drag",
    "Gnss",
    "GnssReading",
    "GnssSettings",
    "Inertial",
    "InertialReading",
    "InertialSettings",
    "Interference",
    "Jamming",
    "PressureReading",
    "Ranger",
    "RangerSettings",
    "Slip",
    "Stray",
    "StrayRange",
    "WheelReading",
    "WheelSettings",
    "Wheels",
]
