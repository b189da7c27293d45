"""Nanoseconds per particle of every model and every stage by itself; medians of processor time."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable

import numpy as np
from workload import DURATION, product_filter

from filters.geometry import GridGeometry
from filters.kernels import random
from filters.motion import Unicycle, UnicycleControl
from filters.sensing import (
    Heading,
    HeadingMeasurement,
    Position,
    PositionMeasurement,
    Range,
    RangeMeasurement,
    Velocity,
    VelocityMeasurement,
)
from filters.sensing.scan import Scan, ScanMeasurement

REPETITIONS = 41


def table(count: int, block: int) -> dict[str, float]:
    belief = product_filter(count, block)
    bounds = belief.blocks
    particles = belief.particles
    noise = np.zeros((2, count), np.float32)
    motion = Unicycle(0.1, 0.1, 1e-3, 1e-3, gyro_bias_sigma=0.01, odometry_scale_sigma=0.01)
    move = motion.begin(UnicycleControl(0.06, 0.007), DURATION)
    occupied = np.zeros((100, 100), bool)
    occupied[::7, ::9] = True
    scan = Scan(GridGeometry(0.5, 0.0, 0.0, 100, 100), occupied, sigma=0.5)
    hits = ScanMeasurement(sum(((5.0 * math.cos(a), 5.0 * math.sin(a), 0.1) for a in range(36)), ()))
    near = RangeMeasurement(32.0, 2.0, 2.0)

    def blocks(act: Callable[[int, int], object]) -> Callable[[], None]:
        def run() -> None:
            for first, last in bounds:
                act(first, last)

        return run

    stages: dict[str, Callable[[], object]] = {
        "noise, a pair of normals": blocks(lambda a, b: random.normal_pairs(a, b, 1, 2, noise, 0)),
        "motion Unicycle": blocks(lambda a, b: motion.move(particles, a, b, noise, move)),
        "sensor Range, Gaussian": lambda: Range(0.3, outliers=0.0).weigh(particles, 0, count, near),
        "sensor Range, with outliers": lambda: Range(0.3).weigh(particles, 0, count, near),
        "sensor Position": lambda: Position(2.0).weigh(particles, 0, count, PositionMeasurement(25.0, 25.0)),
        "sensor Velocity": lambda: Velocity(0.3).weigh(
            particles, 0, count, VelocityMeasurement(3.0, 0.0, 3.0)
        ),
        "sensor Heading": lambda: Heading(0.1).weigh(particles, 0, count, HeadingMeasurement(0.1)),
        "sensor Scan, 36 hits": lambda: scan.weigh(particles, 0, count, hits),
        "evidence of one measurement": lambda: belief.weigh(Range(0.3, outliers=0.0), near),
        "normalize": belief.normalize,
        "moments": belief.moments,
        "resample": lambda: belief.resample(count),
    }
    result = {name: _median(act) / count for name, act in stages.items()}
    result["evidence of one measurement"] -= result["sensor Range, Gaussian"]
    return result


def _median(act: Callable[[], object]) -> float:
    costs: list[int] = []
    for _ in range(REPETITIONS):
        before = time.process_time_ns()
        act()
        costs.append(time.process_time_ns() - before)
    return statistics.median(costs)
