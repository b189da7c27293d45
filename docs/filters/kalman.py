"""The figures of kalman.md, drawn from the project's own code: python docs/figures.py kalman."""

from __future__ import annotations

import math
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from filters import chi_square
from filters.belief import Moments
from filters.kalman import KalmanFilter
from filters.linearised.shadow import ShadowFilter
from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.sensing import Range, RangeMeasurement
from service.textbook.style import BLUE, GREY, ORANGE, RED

BEACONS = ((-20.0, 0.0), (20.0, 0.0))
COUNT, TICKS, TICK = 20_000, 300, 0.1
TURNS_AT, LOOKS = 150, (120, 300)
Array = NDArray[np.float64]


class Drive(NamedTuple):
    """Truth, and both filters' means and covariances of the pose, tick by tick; the particles at two moments."""

    truth: Array
    shadow_mean: Array
    shadow_covariance: Array
    particle_mean: Array
    particle_covariance: Array
    clouds: NDArray[np.float32]
    rejections: int


def drive(start: tuple[float, float], sigma: float) -> Drive:
    """Drive with two beacons on the north-south axis, which cannot tell east from west, from a start believed."""
    rng = np.random.default_rng(4)
    motion = Unicycle(0.05, 0.02, 0.0, 0.0)
    belief = ParticleFilter(motion, capacity=COUNT, seed=4)
    sigmas = np.array([sigma, sigma, 0.1, 0.0, 0.0])
    mean = np.array([*start, 0.0, 0.0, 1.0])
    columns = mean[:, None] + sigmas[:, None] * rng.standard_normal((5, COUNT))
    belief.initialize(dict(zip(motion.names, columns, strict=True)))
    shadow = ShadowFilter(motion)
    variance = np.square(sigmas)
    shadow.initialize(Moments(motion.names, mean, np.diag(variance[:3]), variance, math.inf))
    ranging = Range(0.3, outliers=0.0)
    pose = np.array([-12.0, 8.0, 0.0])
    clouds: list[NDArray[np.float32]] = []
    rows: list[tuple[Array, ...]] = []
    for tick in range(TICKS):
        rate = 0.0 if tick < TURNS_AT else 0.01
        control = UnicycleControl(0.08, rate)
        distance = 0.08 + 0.05 * math.sqrt(TICK) * rng.standard_normal()
        turn = rate + 0.02 * math.sqrt(TICK) * rng.standard_normal()
        middle = pose[2] + 0.5 * turn
        pose = pose + np.array([distance * math.cos(middle), distance * math.sin(middle), turn])
        place = BEACONS[tick % 2]
        away = math.hypot(pose[0] - place[0], pose[1] - place[1]) + 0.3 * rng.standard_normal()
        for each in (belief, shadow):
            each.predict(control, TICK)
            each.weigh(ranging, RangeMeasurement(away, *place))
        if belief.effective_sample_size < 0.5 * COUNT:
            belief.resample()
        if tick + 1 in LOOKS:
            clouds.append(belief.cloud(1500).copy())
        ours, theirs = shadow.moments(), belief.moments()
        rows.append((pose, ours.mean[:3], ours.pose_covariance, theirs.mean[:3], theirs.pose_covariance))
    columns_of = (np.array(row) for row in zip(*rows, strict=True))
    return Drive(*columns_of, np.array(clouds), shadow.rejections)


def ellipse(mean: Array, covariance: Array) -> tuple[Array, Array]:
    """East and north of the ellipse that holds 95 % of a Gaussian in the plane."""
    angle = np.linspace(0.0, 2.0 * math.pi, 121)
    root = np.linalg.cholesky(covariance[:2, :2]) * math.sqrt(chi_square.quantile(0.95, 2))
    north, east = mean[:2, None] + root @ np.stack([np.cos(angle), np.sin(angle)])
    return east, north


def shadow() -> Figure:
    """Draw a start that both can use, and one that only the particle filter can."""
    figure, axes = plt.subplots(1, 3, figsize=(9.2, 3.7), layout="constrained", width_ratios=(1.25, 1, 1))
    good, wide = drive((-11.0, 6.5), 2.0), drive((-12.0, -1.0), 6.0)
    time = TICK * (np.arange(TICKS) + 1)
    for mean, covariance, (colour, width), label in (
        (good.particle_mean, good.particle_covariance, (BLUE, 3.0), "particle filter"),
        (good.shadow_mean, good.shadow_covariance, (ORANGE, 1.0), "extended Kalman filter"),
    ):
        error = np.hypot(*(mean - good.truth)[:, :2].T)
        sigma = np.sqrt(np.trace(covariance[:, :2, :2], axis1=1, axis2=2))
        axes[0].semilogy(time, error, color=colour, linewidth=width, label=f"error, {label}")
        axes[0].semilogy(time, sigma, color=colour, linewidth=width, linestyle="--", label=f"sigma, {label}")
    axes[0].set_ylim(5e-3, 60)
    axes[0].set_xlabel("time, s")
    axes[0].set_ylabel("horizontal position, m")
    axes[0].set_title("start 1.8 m off, sigma 2 m", fontsize=9)
    axes[0].legend(loc="upper right", fontsize=8)
    print(
        f"kept out by the gate: {good.rejections} of {TICKS} from the near start, {wide.rejections} from the far one"
    )
    for axis, look, cloud in zip(axes[1:], LOOKS, wide.clouds, strict=True):
        axis.scatter(cloud[:, 1], cloud[:, 0], s=4, color=BLUE, alpha=0.3, linewidths=0, rasterized=True)
        axis.plot(wide.truth[:look, 1], wide.truth[:look, 0], color=RED, linewidth=1)
        axis.plot(wide.truth[look - 1, 1], wide.truth[look - 1, 0], "x", color=RED, markersize=7)
        axis.plot(wide.shadow_mean[:look, 1], wide.shadow_mean[:look, 0], color=ORANGE, linewidth=1)
        at = (wide.shadow_mean[look - 1], wide.shadow_covariance[look - 1])
        axis.plot(*ellipse(*at), color=ORANGE, linewidth=1.6)
        axis.plot([place[1] for place in BEACONS], [place[0] for place in BEACONS], "^", color="black")
        axis.set_aspect("equal")
        axis.set_xlim(-22, 22)
        axis.set_ylim(-24, 24)
        axis.set_xlabel("east, m")
        axis.set_title(f"start 9 m off, sigma 6 m: at {TICK * look:.0f} s", fontsize=9)
    axes[1].set_ylabel("north, m")
    return figure


def nis(sensor_sigma: float, believed: float) -> Array:
    """NIS of 20,000 position measurements of a body with noisy velocity, whose noise is believed to be ``believed``."""
    rng = np.random.default_rng(2)
    transition = np.kron(np.array([[1.0, 0.1], [0.0, 1.0]]), np.eye(2))
    noise = np.kron(np.array([[1e-4, 1e-3], [1e-3, 2e-2]]), np.eye(2))
    root = np.linalg.cholesky(noise)
    model = np.eye(2, 4)
    belief, state, found = KalmanFilter(np.zeros(4), np.eye(4)), rng.standard_normal(4), []
    for _ in range(20_000):
        state = transition @ state + root @ rng.standard_normal(4)
        belief.predict(transition, noise)
        z = state[:2] + sensor_sigma * rng.standard_normal(2)
        found.append(belief.correct(z, model, believed**2 * np.eye(2)).nis)
    return np.array(found)


def consistency() -> Figure:
    """Draw the NIS of a right and of a wrong noise against chi-square."""
    figure, axis = plt.subplots(figsize=(6.0, 3.2), layout="constrained")
    edges = np.arange(0.0, 20.25, 0.25)
    gate = chi_square.quantile(0.999, 2)
    for believed, colour, label in (
        (0.5, BLUE, "right noise"),
        (0.35, ORANGE, "sigma believed 0.35 m, not 0.5 m"),
    ):
        found = nis(0.5, believed)
        share = np.histogram(found, edges)[0] / found.size / 0.25
        outside = 100.0 * float(np.mean(found > gate))
        print(f"NIS, believed {believed}: mean {found.mean():.3f}, beyond the gate {outside:.2f} %")
        axis.stairs(share, edges, color=colour, linewidth=1.2, label=f"{label}: {outside:.1f} % beyond")
    axis.semilogy(edges, 0.5 * np.exp(-0.5 * edges), color=GREY, linewidth=1, label="chi-square, 2 degrees")
    axis.axvline(gate, ymax=0.68, color=GREY, linestyle="--", linewidth=1)
    axis.annotate("gate, 99.9 %", (gate, 0.02), xytext=(3, 0), textcoords="offset points", color=GREY)
    axis.set_ylim(1e-4, 0.8)
    axis.set_xlim(0, 20)
    axis.set_xlabel("normalised innovation squared")
    axis.set_ylabel("share per unit")
    axis.legend(loc="upper right")
    return figure


FIGURES = {"shadow": shadow, "nis": consistency}
