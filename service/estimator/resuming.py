"""A belief handed from one process to the next: what is kept of it, and how another one goes on from there.

What happened in between nobody heard. The particles are moved over it by the vehicle's own model of controls that are
silent, so the belief is as wide as if odometer and gyro had failed for that time.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from filters.particle import ParticleFilter
from filters.resampling import systematic
from service.checkpoint import PARTICLES, Kept
from service.estimate import Estimate
from service.estimator.intake import Intake
from service.estimator.start import Anchor
from service.estimator.vehicle import Vehicle
from service.geodesy import Geodetic


def kept_of(
    belief: ParticleFilter[Any], time: int, vehicle: Vehicle, intake: Intake, spoken: Estimate | None
) -> Kept:
    """Return what to keep of ``belief``, which is of ``time``: equally likely particles, all columns of them."""
    count = min(PARTICLES, belief.count)
    chosen = systematic(belief.weights, count, 0.5)
    origin = None if intake.frame is None else intake.frame.origin
    return Kept(
        time,
        belief.names,
        belief.columns[:, chosen],
        vehicle.height,
        None if origin is None else (origin.latitude, origin.longitude, origin.altitude),
        0 if spoken is None else spoken.reset_counter,
        "" if spoken is None else spoken.health.value,
    )


def begin_again(kept: Kept, belief: ParticleFilter[Any], vehicle: Vehicle, intake: Intake) -> None:
    """Fill ``belief`` with what was kept, and the height and the local frame beside it.

    Raises
    ------
    ValueError
        It is of a belief with other dimensions, or of more particles than there is room for.
    """
    if kept.names != belief.names:
        raise ValueError(
            f"is of a belief over {', '.join(kept.names)}, and this one is over {', '.join(belief.names)}"
        )
    chosen = np.random.Generator(np.random.Philox(key=kept.columns.shape[1])).permutation(
        kept.columns.shape[1]
    )
    belief.initialize(dict(zip(kept.names, kept.columns[:, chosen[: belief.capacity]], strict=True)))
    if kept.origin is not None:
        intake.learn_origin(Geodetic(*kept.origin))
    if kept.height is not None:
        sigma = math.sqrt(kept.height[1])
        vehicle.stand_at(Anchor((0.0, 0.0, kept.height[0]), (sigma, sigma, sigma)))
