"""Particle filters to begin a test with."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter

QUIET = Unicycle(0.0, 0.0, 0.0, 0.0)
Filter = ParticleFilter[UnicycleControl]


def columns(
    count: int, seed: int = 1, spread: float = 1.0, heading: float = 0.0, heading_spread: float = 0.1
) -> dict[str, NDArray[np.float64]]:
    rng = np.random.default_rng(seed)
    return {
        "north": rng.normal(0, spread, count),
        "east": rng.normal(0, spread, count),
        "heading": rng.normal(heading, heading_spread, count),
        "gyro_bias": np.zeros(count),
        "odometry_scale": np.ones(count),
    }


def started(
    count: int,
    *,
    motion: Unicycle = QUIET,
    capacity: int = 0,
    block: int = 32768,
    seed: int = 3,
    **spread: Any,
) -> Filter:
    belief = ParticleFilter(motion, capacity=max(capacity, count), seed=seed, block=block)
    belief.initialize(columns(count, **spread))
    return belief


def pose(belief: Filter) -> NDArray[np.float64]:
    return np.stack([belief.column(name) for name in ("north", "east", "heading")]).astype(np.float64)
