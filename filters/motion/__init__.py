"""Motion models: how a belief moves (line 4 of Table 4.3)."""

from filters.motion.constant_velocity import FREE, ConstantVelocity, ConstantVelocityStep, FreeControl
from filters.motion.model import Motion
from filters.motion.slow import RandomWalk
from filters.motion.unicycle import Unicycle, UnicycleControl, UnicycleStep

__all__ = [
    "FREE",
    "ConstantVelocity",
    "ConstantVelocityStep",
    "FreeControl",
    "Motion",
    "RandomWalk",
    "Unicycle",
    "UnicycleControl",
    "UnicycleStep",
]
