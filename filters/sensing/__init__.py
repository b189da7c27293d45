"""Sensor models: what a measurement says about a state (line 5 of Table 4.3)."""

from filters.sensing.model import Sensor
from filters.sensing.position import Position, PositionMeasurement
from filters.sensing.range import Range, RangeMeasurement

__all__ = ["Position", "PositionMeasurement", "Range", "RangeMeasurement", "Sensor"]
