"""The configuration: one TOML file, checked as a whole, frozen once read."""

from service.config.belief import Area, Beacon, Honesty, Map, Motion, Origin, Sensor, Start, Vehicle
from service.config.complaints import ConfigurationError
from service.config.configuration import Configuration, Site
from service.config.links import CanLink, Link, MavlinkLink, ServoCalibration, Signal, ZenohLink
from service.config.reading import load, site, validated
from service.config.running import Budget, Loop, Publish, State

__all__ = [
    "Area",
    "Beacon",
    "Budget",
    "CanLink",
    "Configuration",
    "ConfigurationError",
    "Honesty",
    "Link",
    "Loop",
    "Map",
    "MavlinkLink",
    "Motion",
    "Origin",
    "Publish",
    "Sensor",
    "ServoCalibration",
    "Signal",
    "Site",
    "Start",
    "State",
    "Vehicle",
    "ZenohLink",
    "load",
    "site",
    "validated",
]
