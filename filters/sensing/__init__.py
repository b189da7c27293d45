"""Sensor models: what a measurement says about a state (line 5 of Table 4.3)."""

from filters.sensing.bearing import Bearing, BearingMeasurement
from filters.sensing.heading import Heading, HeadingMeasurement
from filters.sensing.model import Sensor
from filters.sensing.position import Position, PositionMeasurement
from filters.sensing.range import Range, RangeMeasurement
from filters.sensing.range_bearing import RangeBearing, RangeBearingMeasurement
from filters.sensing.velocity import Velocity, VelocityMeasurement

__all__ = [
    "Bearing",
    "BearingMeasurement",
    "Heading",
    "HeadingMeasurement",
    "Position",
    "PositionMeasurement",
    "Range",
    "RangeBearing",
    "RangeBearingMeasurement",
    "RangeMeasurement",
    "Sensor",
    "Velocity",
    "VelocityMeasurement",
]
