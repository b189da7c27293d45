"""A belief of two places, for those who follow and publish hypotheses."""

from __future__ import annotations

import numpy as np

from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from service.estimator.hypotheses import INTERVAL, Tracker

Images = ParticleFilter[UnicycleControl]


def images(count: int = 4000, share: float = 0.4, apart: float = 14.0, heading: float = 0.0) -> Images:
    """Return a belief with ``share`` of its particles ``apart`` metres east of the others."""
    rng = np.random.default_rng(1)
    there = rng.random(count) < share
    belief = ParticleFilter(Unicycle(0.1, 0.01, 0.0, 0.0), capacity=2 * count, seed=1)
    belief.initialize(
        {
            "north": rng.normal(0.0, 0.4, count),
            "east": rng.normal(np.where(there, apart, 0.0), 0.3),
            "heading": rng.normal(np.where(there, heading, 0.0), 0.05),
            "gyro_bias": rng.normal(np.where(there, 0.01, -0.01), 0.001),
            "odometry_scale": np.ones(count),
        }
    )
    return belief


def tracked(belief: Images, looks: int = 3, start: int = 0) -> Tracker:
    """Return who has looked at it often enough to know."""
    tracker = Tracker(belief)
    for index in range(looks):
        tracker.look(start + index * INTERVAL)
    return tracker


def shift(belief: Images, odds: float, beyond: float = 7.0) -> None:
    """Multiply the weights of the particles east of ``beyond`` by ``odds``."""
    particles = belief.particles
    particles.log_weights[: belief.count][belief.column("east") > beyond] += np.float32(np.log(odds))
    belief.normalize()
