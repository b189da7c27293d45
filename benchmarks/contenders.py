"""One workload, written for each library as its own users would write it; a worker that steps one of them.

"rover-beacons": a unicycle drives figures of eight between four beacons, 50 steps a second; motion with three normals
per particle, four ranges, normalise, weighted mean and covariance, systematic resampling when the effective sample size
falls below half the count. ``python contenders.py NAME COUNT`` reads numbers of steps from standard input, and after
each says on standard output what they cost and how far off the estimates were. Only numpy and the library are needed.
"""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

DT = 0.02
SPEED, RADIUS = 3.0, 8.5
SPEED_SIGMA, YAW_RATE_SIGMA, HEADING_SIGMA, RANGE_SIGMA = 0.5, 0.2, 0.005, 0.3
BEACONS = np.array([[2.0, 2.0], [48.0, 4.0], [46.0, 47.0], [3.0, 45.0]])
START, SPREAD = np.array([25.0, 25.0, 0.0]), np.array([0.5, 0.5, 0.1])
LONGEST = 4000

Step = Callable[[np.ndarray, np.ndarray], tuple[float, float]]


def trajectory() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return controls (speed, yaw rate), ranges and true positions of every step, always the same."""
    rng = np.random.default_rng(20261104)
    lap = round(2.0 * math.pi * RADIUS / SPEED / DT)
    controls = np.array([[SPEED, SPEED / RADIUS * (1 if k // lap % 2 == 0 else -1)] for k in range(LONGEST)])
    state, places = START.copy(), np.empty((LONGEST, 2))
    for k, control in enumerate(controls):
        speed, rate = control + [SPEED_SIGMA, YAW_RATE_SIGMA] * rng.standard_normal(2)
        state += [
            speed * DT * math.cos(state[2]),
            speed * DT * math.sin(state[2]),
            rate * DT + HEADING_SIGMA * rng.standard_normal(),
        ]
        places[k] = state[:2]
    offsets = places[:, None, :] - BEACONS
    return controls, np.hypot(*offsets.T).T + RANGE_SIGMA * rng.standard_normal((LONGEST, 4)), places


def moved(state: np.ndarray, control: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return particles (count, 3) after one step, each with its own noise."""
    noise = rng.standard_normal((3, len(state)))
    speed = control[0] + SPEED_SIGMA * noise[0]
    turn = (control[1] + YAW_RATE_SIGMA * noise[1]) * DT + HEADING_SIGMA * noise[2]
    heading = state[:, 2]
    return np.column_stack(
        [
            state[:, 0] + speed * DT * np.cos(heading),
            state[:, 1] + speed * DT * np.sin(heading),
            heading + turn,
        ]
    )


def log_likelihood(state: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    expected = np.sqrt((state[:, :1] - BEACONS[:, 0]) ** 2 + (state[:, 1:2] - BEACONS[:, 1]) ** 2)
    return -0.5 / RANGE_SIGMA**2 * ((expected - ranges) ** 2).sum(axis=1)


def moments(state: np.ndarray, weights: np.ndarray) -> tuple[float, float]:
    """Compute weighted mean and covariance (the heading circular); return the position."""
    heading = math.atan2(weights @ np.sin(state[:, 2]), weights @ np.cos(state[:, 2]))
    mean = np.array([*(weights @ state[:, :2]), heading])
    offsets = state - mean
    offsets[:, 2] = (offsets[:, 2] + np.pi) % (2 * np.pi) - np.pi
    _ = (offsets * weights[:, None]).T @ offsets
    return float(mean[0]), float(mean[1])


def numpy_float64(count: int) -> Step:
    """As an engineer would write it: columns, vectorised."""
    rng = np.random.default_rng(1)
    north, east, heading = START[:, None] + SPREAD[:, None] * rng.standard_normal((3, count))
    log_weights, order = np.zeros(count), np.arange(count)

    def step(control: np.ndarray, ranges: np.ndarray) -> tuple[float, float]:
        nonlocal north, east, heading, log_weights
        noise = rng.standard_normal((3, count))
        rolled = (control[0] + SPEED_SIGMA * noise[0]) * DT
        north = north + rolled * np.cos(heading)
        east = east + rolled * np.sin(heading)
        heading = heading + (control[1] + YAW_RATE_SIGMA * noise[1]) * DT + HEADING_SIGMA * noise[2]
        for (n, e), distance in zip(BEACONS, ranges, strict=True):
            log_weights -= (
                0.5 / RANGE_SIGMA**2 * (np.sqrt((north - n) ** 2 + (east - e) ** 2) - distance) ** 2
            )
        weights = np.exp(log_weights - log_weights.max())
        weights /= weights.sum()
        mean = np.array([weights @ north, weights @ east])
        centre = math.atan2(weights @ np.sin(heading), weights @ np.cos(heading))
        offsets = np.stack(
            [north - mean[0], east - mean[1], (heading - centre + np.pi) % (2 * np.pi) - np.pi]
        )
        _ = (offsets * weights) @ offsets.T
        if 1.0 / (weights @ weights) < count / 2:
            cumulative = np.cumsum(weights)
            cumulative[-1] = 1.0
            kept = np.searchsorted(cumulative, (order + rng.random()) / count)
            north, east, heading = north[kept], east[kept], heading[kept]
            log_weights = np.zeros(count)
        else:
            log_weights -= log_weights.max()
        return float(mean[0]), float(mean[1])

    return step


def beliefd(count: int) -> Step:
    """Through the public face of the filter; the ranges are Gaussian, as the others have them."""
    sys.path.insert(0, str(Path(__file__).parents[1]))
    from service import kernels

    kernels.prepare()
    from filters.motion import Unicycle, UnicycleControl
    from filters.particle import ParticleFilter
    from filters.sensing import Range, RangeMeasurement

    turn_sigma = math.hypot(YAW_RATE_SIGMA * DT, HEADING_SIGMA)
    motion = Unicycle(SPEED_SIGMA * math.sqrt(DT), turn_sigma / math.sqrt(DT), 0.0, 0.0)
    belief = ParticleFilter(motion, capacity=count, seed=1)
    start = START[:, None] + SPREAD[:, None] * np.random.default_rng(1).standard_normal((3, count))
    names = ("north", "east", "heading", "gyro_bias", "odometry_scale")
    belief.initialize(dict(zip(names, (*start, np.zeros(count), np.ones(count)), strict=True)))
    sensor = Range(RANGE_SIGMA, outliers=0.0)
    beacons = [(float(n), float(e)) for n, e in BEACONS]

    def step(control: np.ndarray, ranges: np.ndarray) -> tuple[float, float]:
        belief.predict(UnicycleControl(float(control[0]) * DT, float(control[1]) * DT), DT)
        told = zip(ranges.tolist(), beacons, strict=True)
        belief.weigh_all(sensor, [RangeMeasurement(distance, n, e) for distance, (n, e) in told])
        belief.normalize()
        found = belief.moments()
        if belief.effective_sample_size < count / 2:
            belief.resample()
        return float(found.mean[0]), float(found.mean[1])

    return step


def particles(count: int) -> Step:
    """nchopin/particles: a Feynman-Kac model in its SMC."""
    import particles as library

    rng = np.random.default_rng(1)
    now: dict[str, np.ndarray] = {}

    class Rover(library.FeynmanKac):
        def M0(self, N: int) -> np.ndarray:  # noqa: N802, N803  the library's names
            start = START + SPREAD * rng.standard_normal((N, 3))
            return moved(start, now["control"], rng)

        def M(self, t: int, xp: np.ndarray) -> np.ndarray:  # noqa: N802
            return moved(xp, now["control"], rng)

        def logG(self, t: int, xp: Any, x: np.ndarray) -> np.ndarray:  # noqa: N802
            return log_likelihood(x, now["ranges"])

    algorithm = library.SMC(fk=Rover(T=10**9), N=count, resampling="systematic", ESSrmin=0.5)

    def step(control: np.ndarray, ranges: np.ndarray) -> tuple[float, float]:
        now.update(control=control, ranges=ranges)
        next(algorithm)
        return moments(algorithm.X, algorithm.W)

    return step


def pfilter(count: int) -> Step:
    """johnhw/pfilter: functions for dynamics, observation and weight."""
    from pfilter import ParticleFilter, systematic_resample

    rng = np.random.default_rng(1)
    now: dict[str, np.ndarray] = {}
    belief = ParticleFilter(
        prior_fn=lambda n: START + SPREAD * rng.standard_normal((n, 3)),
        observe_fn=lambda x: np.sqrt((x[:, :1] - BEACONS[:, 0]) ** 2 + (x[:, 1:2] - BEACONS[:, 1]) ** 2),
        dynamics_fn=lambda x: moved(x, now["control"], rng),
        noise_fn=lambda x: x,
        weight_fn=lambda expected, observed: np.exp(
            -0.5 / RANGE_SIGMA**2 * ((expected - observed) ** 2).sum(axis=1)
        ),
        n_particles=count,
        resample_proportion=0.0,
        resample_fn=systematic_resample,
        n_eff_threshold=0.5,
    )

    def step(control: np.ndarray, ranges: np.ndarray) -> tuple[float, float]:
        now["control"] = control
        belief.update(ranges)  # mean and covariance included
        return float(belief.mean_state[0]), float(belief.mean_state[1])

    return step


def filterpy(count: int) -> Step:
    """filterpy brings the resampling; the filter about it is the one of its book."""
    from filterpy.monte_carlo import systematic_resample

    rng = np.random.default_rng(1)
    np.random.seed(1)  # noqa: NPY002  what the library draws from
    state = START + SPREAD * rng.standard_normal((count, 3))
    weights = np.full(count, 1.0 / count)

    def step(control: np.ndarray, ranges: np.ndarray) -> tuple[float, float]:
        nonlocal state, weights
        state = moved(state, control, rng)
        logs = log_likelihood(state, ranges)
        weights = weights * np.exp(logs - logs.max()) + 1e-300
        weights /= weights.sum()
        found = moments(state, weights)
        if 1.0 / (weights @ weights) < count / 2:
            state = state[systematic_resample(weights)]
            weights = np.full(count, 1.0 / count)
        return found

    return step


def stonesoup(count: int) -> Step:
    """Stone Soup: models of its own kinds, ParticlePredictor, ParticleUpdater, ESSResampler."""
    from datetime import datetime, timedelta

    from stonesoup.base import Property
    from stonesoup.models.measurement.base import MeasurementModel
    from stonesoup.models.transition.base import TransitionModel
    from stonesoup.predictor.particle import ParticlePredictor
    from stonesoup.resampler.particle import ESSResampler, SystematicResampler
    from stonesoup.types.array import StateVector, StateVectors
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import ParticleState
    from stonesoup.updater.particle import ParticleUpdater

    rng = np.random.default_rng(1)
    now: dict[str, np.ndarray] = {}

    class Drive(TransitionModel):
        ndim_state: int = Property(default=3)

        def function(self, state: Any, noise: Any = False, **_: Any) -> Any:
            return StateVectors(moved(np.asarray(state.state_vector, float).T, now["control"], rng).T)

        def rvs(self, num_samples: int = 1, **_: Any) -> Any:
            return StateVectors(np.zeros((3, num_samples)))

        def pdf(self, *_: Any, **__: Any) -> Any:
            raise NotImplementedError

    class Ranges(MeasurementModel):
        ndim_state: int = Property(default=3)
        mapping: tuple[int, int] = Property(default=(0, 1))

        @property
        def ndim_meas(self) -> int:
            return 4

        def function(self, state: Any, noise: Any = False, **_: Any) -> Any:
            x = np.asarray(state.state_vector, float)
            return StateVectors(np.hypot(x[0] - BEACONS[:, :1], x[1] - BEACONS[:, 1:]))

        def rvs(self, num_samples: int = 1, **_: Any) -> Any:
            return StateVectors(RANGE_SIGMA * rng.standard_normal((4, num_samples)))

        def logpdf(self, measured: Any, state: Any, **_: Any) -> np.ndarray:
            return log_likelihood(
                np.asarray(state.state_vector, float).T, np.asarray(measured.state_vector, float).ravel()
            )

        def pdf(self, measured: Any, state: Any, **_: Any) -> np.ndarray:
            return np.exp(self.logpdf(measured, state))

    model = Ranges()
    predictor = ParticlePredictor(Drive())
    updater = ParticleUpdater(
        model, resampler=ESSResampler(threshold=count / 2, resampler=SystematicResampler())
    )
    instant = datetime(2026, 1, 1)  # noqa: DTZ001  the library's own times are naive
    belief: Any = ParticleState(
        StateVectors(START[:, None] + SPREAD[:, None] * rng.standard_normal((3, count))),
        weight=np.full(count, 1.0 / count),
        timestamp=instant,
    )

    def step(control: np.ndarray, ranges: np.ndarray) -> tuple[float, float]:
        nonlocal belief, instant
        now["control"] = control
        instant = instant + timedelta(seconds=DT)
        prediction = predictor.predict(belief, timestamp=instant)
        detection = Detection(StateVector(ranges), timestamp=instant, measurement_model=model)
        belief = updater.update(SingleHypothesis(prediction, detection))
        _ = belief.covar
        return float(belief.mean[0]), float(belief.mean[1])

    return step


CONTENDERS: dict[str, Callable[[int], Step]] = {
    "beliefd": beliefd,
    "numpy": numpy_float64,
    "particles": particles,
    "pfilter": pfilter,
    "filterpy": filterpy,
    "stonesoup": stonesoup,
}


def main() -> None:
    name, count = sys.argv[1], int(sys.argv[2])
    controls, ranges, places = trajectory()
    step, at = CONTENDERS[name](count), 0
    for line in sys.stdin:
        costs, squares = [], []
        for _ in range(int(line)):
            before = time.process_time_ns()
            north, east = step(controls[at], ranges[at])
            costs.append(time.process_time_ns() - before)
            squares.append((north - places[at, 0]) ** 2 + (east - places[at, 1]) ** 2)
            at = (at + 1) % LONGEST
        print(json.dumps({"ns": sum(costs) / len(costs), "squares": squares}), flush=True)


if __name__ == "__main__":
    main()
