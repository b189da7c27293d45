"""The figures of motion.md, drawn from the project's own code: python docs/figures.py motion."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from filters.motion import FREE, ConstantVelocity, Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.sensing import Heading, HeadingMeasurement, Position, PositionMeasurement
from service.textbook.style import BLUE, GREEN, ORANGE, RED


def bias() -> Figure:
    """A gyro's bias learned from headings, with what the filter claims to know of it."""
    rng = np.random.default_rng(3)
    count, rate, true_bias = 2000, 10, 0.02
    motion = Unicycle(0.05, 0.01, 1e-4, 1e-4, gyro_bias_sigma=0.03)
    belief = ParticleFilter(motion, capacity=count, seed=3)
    belief.initialize(
        {name: np.zeros(count) for name in ("north", "east", "gyro_bias")}
        | {"heading": rng.normal(0.0, 0.05, count), "odometry_scale": np.ones(count)}
    )
    compass, rows = Heading(0.05), []
    for tick in range(60 * rate):
        belief.predict(UnicycleControl(0.1, true_bias / rate), 1.0 / rate)  # it drives straight on
        if tick % rate == rate - 1:
            belief.weigh(compass, HeadingMeasurement(0.05 * rng.standard_normal()))
            belief.normalize()
        moments = belief.moments()
        given_path = motion.conditional_variances["gyro_bias"]
        rows.append((moments.mean[3], moments.variance[3] - given_path, given_path))
        if belief.effective_sample_size < 0.5 * count:
            belief.resample()
    mean, spread, conditional = np.array(rows).T
    time = (np.arange(len(rows)) + 1) / rate
    sigma = np.sqrt(spread + conditional)
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(6.8, 4.2), sharex=True, layout="constrained", height_ratios=(3, 2)
    )
    above.fill_between(
        time, mean - 2 * sigma, mean + 2 * sigma, color=BLUE, alpha=0.2, linewidth=0, label="± 2 sigma"
    )
    above.plot(time, mean, color=BLUE, label="mean")
    above.axhline(true_bias, color=RED, linewidth=1, label="truth")
    above.set_ylabel("gyro bias, rad/s")
    above.legend(loc="upper right", ncols=3)
    below.semilogy(time, np.sqrt(spread), color=ORANGE, label="of the particles' means")
    below.semilogy(time, np.sqrt(conditional), color=GREEN, label="given a path, shared by all")
    below.set_ylabel("sigma, rad/s")
    below.set_xlabel("time, s (a heading each second, sigma 0.05 rad)")
    below.legend(loc="upper right")
    return figure


def velocity() -> Figure:
    """A tag's velocity learned from positions alone: it stands, walks north, and walks back."""
    rng = np.random.default_rng(5)
    count, rate, sigma = 2000, 10, 0.2
    motion = ConstantVelocity(0.7, velocity_sigma=1.0)
    belief = ParticleFilter(motion, capacity=count, seed=5)
    belief.initialize({name: np.zeros(count) for name in motion.names})
    sensor, north = Position(sigma), 0.0
    rows: list[tuple[float, float, float]] = []
    speeds = np.repeat([0.0, 1.2, -0.8], 10 * rate)
    for speed in speeds:
        north += speed / rate
        belief.predict(FREE, 1.0 / rate)
        belief.weigh(sensor, PositionMeasurement(*(sigma * rng.standard_normal(2) + (north, 0.0))))
        belief.normalize()
        moments = belief.moments()
        given_path = motion.conditional_variances["velocity_north"]
        rows.append((moments.mean[3], moments.variance[3] - given_path, given_path))
        if belief.effective_sample_size < 0.5 * count:
            belief.resample()
    mean, spread, conditional = np.array(rows).T
    time = (np.arange(len(rows)) + 1) / rate
    reach = 2.0 * np.sqrt(spread + conditional)
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(6.8, 4.2), sharex=True, layout="constrained", height_ratios=(3, 2)
    )
    above.fill_between(
        time, mean - reach, mean + reach, color=BLUE, alpha=0.2, linewidth=0, label="± 2 sigma"
    )
    above.plot(time, mean, color=BLUE, label="mean")
    above.plot(time, speeds, color=RED, linewidth=1, label="truth")
    above.set_ylabel("velocity north, m/s")
    above.legend(loc="lower left", ncols=3)
    below.semilogy(time, np.sqrt(spread), color=ORANGE, label="of the particles' means")
    below.semilogy(time, np.sqrt(conditional), color=GREEN, label="given a path, shared by all")
    below.set_ylabel("sigma, m/s")
    below.set_xlabel("time, s (ten positions a second, sigma 0.2 m)")
    below.legend(loc="upper right")
    return figure


FIGURES = {"bias": bias, "velocity": velocity}
