"""The vehicle's models linearised, for the extended Kalman filter: one file for each of the particle filter's models.

Each is made of the particle filter's own model and takes the same controls and measurements, so both filters can
run on the same samples with the same parameters. What they leave out is the outlier part: a Gaussian has a gate.
"""

from filters.linearised.altitude import LinearisedAltitude
from filters.linearised.bearing import LinearisedBearing
from filters.linearised.biased_range import LinearisedBiasedRange
from filters.linearised.constant_velocity import LinearisedConstantVelocity
from filters.linearised.down import LinearisedDown
from filters.linearised.heading import LinearisedHeading
from filters.linearised.position import LinearisedPosition
from filters.linearised.range import LinearisedRange
from filters.linearised.range_bearing import LinearisedRangeBearing
from filters.linearised.speed import LinearisedGroundSpeed, LinearisedWheelSpeed
from filters.linearised.unicycle import LinearisedUnicycle
from filters.linearised.velocity import LinearisedVelocity

__all__ = [
    "LinearisedAltitude",
    "LinearisedBearing",
    "LinearisedBiasedRange",
    "LinearisedConstantVelocity",
    "LinearisedDown",
    "LinearisedGroundSpeed",
    "LinearisedHeading",
    "LinearisedPosition",
    "LinearisedRange",
    "LinearisedRangeBearing",
    "LinearisedUnicycle",
    "LinearisedVelocity",
    "LinearisedWheelSpeed",
]
