"""Readings in the terms of the sensor models: one module for each kind of measurement, and the table of them all."""

from service.estimator.measuring.altitude import ALTITUDE
from service.estimator.measuring.heading import HEADING
from service.estimator.measuring.kind import Kind, Measurement, Place, Refusal, Surroundings
from service.estimator.measuring.landmarks import BEARING, RANGE_BEARING
from service.estimator.measuring.position import POSITION, position_of
from service.estimator.measuring.range import RANGE
from service.estimator.measuring.speed import SPEED
from service.estimator.measuring.surroundings import surroundings_of
from service.estimator.measuring.velocity import VELOCITY

KINDS: dict[str, Kind] = {
    "position": POSITION,
    "velocity": VELOCITY,
    "range": RANGE,
    "heading": HEADING,
    "bearing": BEARING,
    "range_bearing": RANGE_BEARING,
    "speed": SPEED,
    "altitude": ALTITUDE,
}
"""By the name that ``[[sensor]] kind`` gives them."""

__all__ = [
    "KINDS",
    "Kind",
    "Measurement",
    "Place",
    "Refusal",
    "Surroundings",
    "position_of",
    "surroundings_of",
]
