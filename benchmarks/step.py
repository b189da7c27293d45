"""The full step of the filter, timed: nanoseconds of CPU per particle beside a plain numpy float64 version.

    python benchmarks/step.py [--counts 1000,10000,100000,1000000] [--outliers 0.0] [--block 32768] [--stages]

The workload "rover-beacons": a unicycle drives figures of eight between four beacons, 50 steps a second;
motion with noise on distance and turn, four ranges, normalise, effective sample size, mean and covariance,
systematic resampling below half the count. Blended over the steps that resample and those that do not;
medians of CPU time, one thread.
"""

from __future__ import annotations

import argparse
import math
import statistics
import time
from collections import defaultdict
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from service import kernels

kernels.prepare()  # numba's own cache would not notice a change in a function that was inlined

from filters.motion import Unicycle, UnicycleControl  # noqa: E402
from filters.particle import ParticleFilter  # noqa: E402
from filters.sensing import Range, RangeMeasurement  # noqa: E402

DURATION = 0.02
SPEED, RADIUS = 3.0, 8.5
SPEED_SIGMA, YAW_RATE_SIGMA, HEADING_SIGMA, RANGE_SIGMA = 0.5, 0.2, 0.005, 0.3
TURN_SIGMA = math.hypot(YAW_RATE_SIGMA * DURATION, HEADING_SIGMA)
BEACONS = ((2.0, 2.0), (48.0, 4.0), (46.0, 47.0), (3.0, 45.0))
SPREAD = (0.5, 0.5, 0.1)
START = (25.0, 25.0, 0.0)
STEPS = {1_000: 1000, 10_000: 300, 100_000: 80, 1_000_000: 20}

Step = Callable[["Tick"], tuple[float, float]]


class Tick(NamedTuple):
    """One step of the trajectory."""

    distance: float
    turn: float
    ranges: tuple[float, ...]
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
            math.hypot(n - north, e - east) + RANGE_SIGMA * rng.standard_normal() for n, e in BEACONS
        )
        ticks.append(Tick(distance, turn, ranges, (north, east)))
    return ticks


def start(count: int, seed: int) -> NDArray[np.float64]:
    return np.array(START)[:, None] + np.array(SPREAD)[:, None] * np.random.default_rng(seed).standard_normal(
        (3, count)
    )


def columns_filter(
    count: int, outliers: float, block: int, lap: Callable[[str], None] = lambda stage: None
) -> Step:
    """Make the step through the public face of the filter."""
    motion = Unicycle(SPEED_SIGMA * math.sqrt(DURATION), TURN_SIGMA / math.sqrt(DURATION), 0.0, 0.0)
    belief = ParticleFilter(motion, capacity=count, seed=1, block=block)
    north, east, heading = start(count, 1)
    belief.initialize(
        {
            "north": north,
            "east": east,
            "heading": heading,
            "gyro_bias": np.zeros(count),
            "odometry_scale": np.ones(count),
        }
    )
    sensor = Range(RANGE_SIGMA, outliers=outliers)

    def step(tick: Tick) -> tuple[float, float]:
        lap("")
        belief.predict(UnicycleControl(tick.distance, tick.turn), DURATION)
        lap("predict")
        for distance, (n, e) in zip(tick.ranges, BEACONS, strict=True):
            belief.weigh(sensor, RangeMeasurement(distance, n, e))
        lap("weigh")
        belief.normalize()
        lap("normalize")
        moments = belief.moments()
        lap("moments")
        if belief.effective_sample_size < count / 2:
            belief.resample()
        lap("resample")
        return float(moments.mean[0]), float(moments.mean[1])

    return step


def plain_numpy(count: int) -> Step:
    """Make the step as one would write it in numpy, float64."""
    rng = np.random.default_rng(1)
    state = start(count, 1)
    log_weights = np.zeros(count)
    order = np.arange(count)

    def step(tick: Tick) -> tuple[float, float]:
        nonlocal state, log_weights
        noise = rng.standard_normal((2, count))
        rolled = tick.distance + SPEED_SIGMA * DURATION * noise[0]
        state[0] += rolled * np.cos(state[2])
        state[1] += rolled * np.sin(state[2])
        state[2] += tick.turn + TURN_SIGMA * noise[1]
        for distance, (n, e) in zip(tick.ranges, BEACONS, strict=True):
            residual = np.sqrt((state[0] - n) ** 2 + (state[1] - e) ** 2) - distance
            log_weights -= 0.5 / RANGE_SIGMA**2 * residual * residual
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
        return north, east

    return step


def timed(step: Step, ticks: list[Tick]) -> tuple[float, float]:
    """Return the mean CPU time of a step without its slowest tenth, and the error in position (RMS)."""
    costs: list[float] = []
    squares: list[float] = []
    for tick in ticks:
        before = time.process_time_ns()
        north, east = step(tick)
        costs.append(time.process_time_ns() - before)
        squares.append((north - tick.truth[0]) ** 2 + (east - tick.truth[1]) ** 2)
    settled = sorted(costs[len(costs) // 10 :])
    return statistics.fmean(settled[: len(settled) * 9 // 10]), math.sqrt(statistics.fmean(squares))


def stages(count: int, outliers: float, block: int, ticks: list[Tick]) -> dict[str, float]:
    """Return the median wall time of each stage, nanoseconds per particle."""
    laps: dict[str, list[int]] = defaultdict(list)
    latest = 0

    def lap(stage: str) -> None:
        nonlocal latest
        now = time.perf_counter_ns()
        laps[stage].append(now - latest)
        latest = time.perf_counter_ns()

    step = columns_filter(count, outliers, block, lap)
    for tick in ticks:
        step(tick)
    medians = {stage: statistics.median(times) / count for stage, times in laps.items() if stage}
    resampled = [nanoseconds for nanoseconds in laps["resample"] if nanoseconds > 0.5 * count]
    medians["resample"] = statistics.median(resampled) / count if resampled else math.nan
    return medians


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--counts", default="1000,10000,100000,1000000")
    parser.add_argument("--outliers", type=float, default=0.0)
    parser.add_argument("--block", type=int, default=32768)
    parser.add_argument("--stages", action="store_true")
    arguments = parser.parse_args()
    print(f"{'particles':>9} {'µs/step':>9} {'ns/particle':>11} {'numpy ns':>9} {'ratio':>6}  RMSE m (numpy)")
    for count in (int(text) for text in arguments.counts.split(",")):
        ticks = trajectory(STEPS.get(count, 100))
        cost, error = timed(columns_filter(count, arguments.outliers, arguments.block), ticks)
        plain, plain_error = timed(plain_numpy(count), ticks[: max(12, len(ticks) // 4)])
        print(
            f"{count:9d} {cost / 1e3:9.1f} {cost / count:11.2f} {plain / count:9.1f} {plain / cost:6.1f}  "
            f"{error:.3f} ({plain_error:.3f})"
        )
        if arguments.stages:
            for stage, each in stages(count, arguments.outliers, arguments.block, ticks).items():
                print(f"{'':9} {stage:>10} {each:8.2f} ns/particle")


if __name__ == "__main__":
    main()
