"""The workload "rover-beacons", and three programs that do it: the product's filter, C by hand, and plain numpy.

A unicycle drives figures of eight between four beacons, 50 steps a second; motion with noise on distance and turn,
four ranges, normalise, effective sample size, mean and covariance, systematic resampling below half the count.
Every step returns where it thinks the vehicle is, and the processor time that it took, nanoseconds.
"""

from __future__ import annotations

import ctypes
import math
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from filters.crew import Crew
from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.sensing import Range, RangeMeasurement

DURATION = 0.02
SPEED, RADIUS = 3.0, 8.5
SPEED_SIGMA, YAW_RATE_SIGMA, HEADING_SIGMA, RANGE_SIGMA = 0.5, 0.2, 0.005, 0.3
TURN_SIGMA = math.hypot(YAW_RATE_SIGMA * DURATION, HEADING_SIGMA)
BEACONS = ((2.0, 2.0), (48.0, 4.0), (46.0, 47.0), (3.0, 45.0))
SPREAD = (0.5, 0.5, 0.1)
START = (25.0, 25.0, 0.0)

COMPILERS = ("clang", *(f"clang-{version}" for version in range(22, 13, -1)), "gcc", "cc")
"""gcc leaves the main loops of limit.c scalar; it is taken only where there is no clang, and the table says so."""

Step = Callable[["Tick"], tuple[float, float, float]]


class Tick(NamedTuple):
    """One step of the trajectory."""

    control: UnicycleControl
    ranges: tuple[RangeMeasurement, ...]
    truth: tuple[float, float]


def trajectory(steps: int) -> list[Tick]:
    rng = np.random.default_rng(20261104)
    rate = SPEED / RADIUS
    lap = round(2.0 * math.pi / rate / DURATION)
    north, east, heading = START
    ticks: list[Tick] = []
    for k in range(steps):
        distance = SPEED * DURATION
        turn = (rate if (k // lap) % 2 == 0 else -rate) * DURATION
        rolled = distance + SPEED_SIGMA * DURATION * rng.standard_normal()
        north += rolled * math.cos(heading)
        east += rolled * math.sin(heading)
        heading += turn + TURN_SIGMA * rng.standard_normal()
        ranges = tuple(
            RangeMeasurement(math.hypot(n - north, e - east) + RANGE_SIGMA * rng.standard_normal(), n, e)
            for n, e in BEACONS
        )
        ticks.append(Tick(UnicycleControl(distance, turn), ranges, (north, east)))
    return ticks


def start(count: int, seed: int) -> NDArray[np.float64]:
    return np.array(START)[:, None] + np.array(SPREAD)[:, None] * np.random.default_rng(seed).standard_normal(
        (3, count)
    )


def product_filter(count: int, block: int, crew: Crew | None = None) -> ParticleFilter[UnicycleControl]:
    motion = Unicycle(SPEED_SIGMA * math.sqrt(DURATION), TURN_SIGMA / math.sqrt(DURATION), 0.0, 0.0)
    belief = ParticleFilter(motion, capacity=count, seed=1, block=block, crew=crew)
    north, east, heading = start(count, 1)
    pose = {"north": north, "east": east, "heading": heading}
    belief.initialize({**pose, "gyro_bias": np.zeros(count), "odometry_scale": np.ones(count)})
    return belief


def product(
    count: int, block: int, crew: Crew | None = None, clock: Callable[[], int] = time.process_time_ns
) -> Step:
    """Make the step through the public face of the filter, evidence of every range included."""
    belief = product_filter(count, block, crew)
    sensor = Range(RANGE_SIGMA, outliers=0.0)

    def step(tick: Tick) -> tuple[float, float, float]:
        before = clock()
        belief.predict(tick.control, DURATION)
        belief.weigh_all(sensor, tick.ranges)
        belief.normalize()
        moments = belief.moments()
        if belief.effective_sample_size < 0.5 * count:
            belief.resample()
        cost = clock() - before
        return float(moments.mean[0]), float(moments.mean[1]), cost

    return step


def plain_numpy(count: int) -> Step:
    """Make the step as one would write it in numpy, float64."""
    rng = np.random.default_rng(1)
    state = start(count, 1)
    log_weights = np.zeros(count)
    order = np.arange(count)

    def step(tick: Tick) -> tuple[float, float, float]:
        nonlocal state, log_weights
        before = time.process_time_ns()
        noise = rng.standard_normal((2, count))
        rolled = tick.control.distance + SPEED_SIGMA * DURATION * noise[0]
        state[0] += rolled * np.cos(state[2])
        state[1] += rolled * np.sin(state[2])
        state[2] += tick.control.turn + TURN_SIGMA * noise[1]
        for measured in tick.ranges:
            away = np.sqrt((state[0] - measured.north) ** 2 + (state[1] - measured.east) ** 2)
            log_weights -= 0.5 / RANGE_SIGMA**2 * (away - measured.distance) ** 2
        weights = np.exp(log_weights - log_weights.max())
        weights /= weights.sum()
        north, east = weights @ state[0], weights @ state[1]
        heading = math.atan2(weights @ np.sin(state[2]), weights @ np.cos(state[2]))
        turned = (state[2] - heading + np.pi) % (2 * np.pi) - np.pi
        offsets = np.stack([state[0] - north, state[1] - east, turned])
        _ = (offsets * weights) @ offsets.T
        if 1.0 / np.sum(weights * weights) < count / 2:
            cumulative = np.cumsum(weights)
            cumulative[-1] = 1.0
            state = state[:, np.searchsorted(cumulative, (order + rng.random()) / count)]
            log_weights = np.zeros(count)
        else:
            log_weights -= log_weights.max()
        return north, east, time.process_time_ns() - before

    return step


def compiler() -> str | None:
    """Name the compiler that limit.c is built with, or ``None``."""
    return next((name for name in COMPILERS if shutil.which(name)), None)


def build() -> ctypes.CDLL | None:
    """Build limit.c, or return ``None`` if nobody can."""
    name = compiler()
    if name is None:
        return None
    target = Path(tempfile.mkdtemp(prefix="beliefd-limit-")) / "limit.so"
    source = Path(__file__).with_name("limit.c")
    flags = ("-O3", "-march=native", "-ffast-math", "-fopenmp-simd", "-shared", "-fPIC")
    subprocess.run([name, *flags, str(source), "-o", str(target), "-lm"], check=True)
    library = ctypes.CDLL(str(target))
    library.make.restype = ctypes.c_void_p
    library.step.restype = ctypes.c_double
    library.step.argtypes = [
        ctypes.c_void_p,
        ctypes.c_float,
        ctypes.c_float,
        ctypes.c_void_p,
        ctypes.c_void_p,
    ]
    return library


def by_hand(library: ctypes.CDLL, count: int) -> Step:
    """Make the step of limit.c."""
    given = np.ascontiguousarray(start(count, 1), np.float32)
    places = np.array(BEACONS, np.float32)
    sigmas = (ctypes.c_float(s) for s in (SPEED_SIGMA * DURATION, TURN_SIGMA, RANGE_SIGMA))
    made = library.make(count, given.ctypes, places.ctypes, *sigmas)
    out = np.zeros(2)

    def step(tick: Tick) -> tuple[float, float, float]:
        ranges = np.array([measured.distance for measured in tick.ranges], np.float32)
        cost = library.step(
            made, tick.control.distance, tick.control.turn, ranges.ctypes.data, out.ctypes.data
        )
        return float(out[0]), float(out[1]), float(cost)

    return step
