"""What observes the truth: each sensor is its settings, its own random numbers, and ``measure(truth)``."""

from sim_vehicle.sensors.barometer import Barometer, BarometerSettings, PressureReading
from sim_vehicle.sensors.beacons import BeaconReading, BeaconSite, Ranger, RangerSettings
from sim_vehicle.sensors.cadence import Cadence
from sim_vehicle.sensors.compass import Compass, CompassReading, CompassSettings
from sim_vehicle.sensors.gnss import Gnss, GnssReading, GnssSettings
from sim_vehicle.sensors.inertial import Inertial, InertialReading, InertialSettings
from sim_vehicle.sensors.wheels import WheelReading, Wheels, WheelSettings

__all__ = [
    "Barometer",
    "BarometerSettings",
    "BeaconReading",
    "BeaconSite",
    "Cadence",
    "Compass",
    "CompassReading",
    "CompassSettings",
    "Gnss",
    "GnssReading",
    "GnssSettings",
    "Inertial",
    "InertialReading",
    "InertialSettings",
    "PressureReading",
    "Ranger",
    "RangerSettings",
    "WheelReading",
    "WheelSettings",
    "Wheels",
]
