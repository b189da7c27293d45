"""The values on the wire: what the daemon says about its belief, its budget, its sensors and its health.

One set of typed structs serves every consumer: JSON on Zenoh, JSON Schema on request (``@rpc/schema``), rows
of a replay. SI units, radians, north-east-down. A figure that is not known is ``null``, never a zero or NaN.
"""

from service.estimate.belief import Estimate, HealthState, MotionMode, Triangle, Triple
from service.estimate.budget import Budget, Distribution, StageCost
from service.estimate.density import Cell, Cloud, Component, Density
from service.estimate.health import Health
from service.estimate.hypotheses import Hypotheses, Hypothesis
from service.estimate.schema import schema
from service.estimate.sensors import LinkStatus, Sensors, SensorStatus
from service.estimate.status import ProcessStatus, Publishing, Status

__all__ = [
    "Budget",
    "Cell",
    "Cloud",
    "Component",
    "Density",
    "Distribution",
    "Estimate",
    "Health",
    "HealthState",
    "Hypotheses",
    "Hypothesis",
    "LinkStatus",
    "MotionMode",
    "ProcessStatus",
    "Publishing",
    "SensorStatus",
    "Sensors",
    "StageCost",
    "Status",
    "Triangle",
    "Triple",
    "schema",
]
