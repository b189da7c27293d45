"""Sensor models: what a measurement says about a state (line 5 of Table 4.3)."""

from filters.sensing.heading import Heading, HeadingMeasurement
from filters.sensing.model import Sensor
from filters.sensing.position import Position, PositionMeasurement
from filters.sensing.range import Range, RangeMeasurement
from filters.sensing.velocity import Velocity, VelocityMeasurement

__all__ = [
    "Heading",
    "HeadingMeasurement",
    "Position",
    "PositionMeasurement",
    "Range",
    "RangeMeasurement",
    "Sensor",
    "Velocity",
    "VelocityMeasurement",
]
