"""The figures of binary.md, drawn from the project's own code: python docs/figures.py binary."""

from __future__ import annotations

import math

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from drivers.sample import LocalPosition, Sample
from filters.binary import BinaryBayesFilter
from filters.motion.unicycle import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.sensing import Position, PositionMeasurement
from service.estimator.measuring import Measurement
from service.estimator.trust import Trust
from service.textbook.style import BLUE, GREY, ORANGE, RED


def liar() -> Figure:
    """One cell, a sensor that is right four times in five and then lies; with and without a limit."""
    rng = np.random.default_rng(1)
    steps, lie, end = 220, (80, 110), 170
    truth = np.arange(steps) < end
    says = np.where(rng.random(steps) < 0.8, truth, ~truth)
    says[lie[0] : lie[1]] = False
    figure, axis = plt.subplots(figsize=(6.8, 3.4), layout="constrained")
    for limit, colour, label in ((math.inf, GREY, "without a limit"), (6.0, BLUE, "limit 6")):
        belief = BinaryBayesFilter(limit=limit)
        rows = []
        for occupied in says:
            belief.update(0.8 if occupied else 0.2)
            rows.append(float(belief.log_odds))
        axis.step(np.arange(steps), rows, where="post", color=colour, linewidth=1.3, label=label)
    axis.axvspan(*lie, color=ORANGE, alpha=0.2, linewidth=0)
    axis.text(sum(lie) / 2, 78, "it lies", ha="center", va="top", color="#a04000")
    axis.axvline(end, color=RED, linewidth=1)
    axis.text(end + 2, 78, "the door opens", va="top", color=RED)
    axis.axhline(0.0, color="black", linewidth=0.8)
    axis.set_ylim(-18, 80)
    axis.set_xlim(0, steps)
    axis.set_xlabel("measurement")
    axis.set_ylabel("log odds that the cell is occupied")
    axis.legend(loc="upper left")
    return figure


def trust() -> Figure:
    """Two sensors' health from whether their readings fit, when sensors may fail and be mended."""
    rng = np.random.default_rng(2)
    rate, seconds = 5, 60
    broken = (20.0, 40.0)
    belief = BinaryBayesFilter(0.95, shape=(2,))
    rows = []
    for time in np.arange(0, seconds, 1 / rate):
        fails = broken[0] <= time < broken[1]
        fits = rng.random(2) < np.array([0.15 if fails else 0.95, 0.95])
        belief.predict(1e-3 / rate, 0.02 / rate)
        belief.update_forward(np.where(fits, 0.95, 0.05), np.where(fits, 0.3, 0.7))
        rows.append((time, *belief.belief))
    time, first, second = np.array(rows).T
    figure, axis = plt.subplots(figsize=(6.8, 2.8), layout="constrained")
    axis.axvspan(*broken, color=ORANGE, alpha=0.2, linewidth=0, label="the first one is broken")
    axis.step(time, first, where="post", color=BLUE, label="first sensor")
    axis.step(time, second, where="post", color=GREY, linestyle="--", label="second sensor")
    axis.set_ylim(-0.02, 1.02)
    axis.set_xlim(0, seconds)
    axis.set_xlabel("time, s (five readings a second)")
    axis.set_ylabel("probability of being sound")
    axis.legend(loc="lower right", ncols=3, bbox_to_anchor=(1.0, 1.0))
    return figure


def jam() -> Figure:
    """Log odds of a receiver that is jammed, honest again, and then leads away: judged as the daemon does."""
    rng = np.random.default_rng(4)
    step, speed, turn, seconds = 0.2, 1.5, 0.05, 250.0
    motion = Unicycle(
        0.1, 0.02, 1e-4, 1e-4, slip_noise=0.05, gyro_bias_sigma=0.002, odometry_scale_sigma=0.01
    )
    belief = ParticleFilter[UnicycleControl](motion, capacity=400, seed=1)
    zero, noise = np.zeros(400), rng.standard_normal((3, 400))
    start = {"north": 0.3 * noise[0], "east": 0.3 * noise[1], "heading": 0.05 * noise[2]}
    belief.initialize({**start, "gyro_bias": zero, "odometry_scale": zero + 1.0})
    control = UnicycleControl(speed * step, turn * step)
    trust = Trust(motion, [], belief, lambda start, end: control, seed=1)
    place, model, rows = np.zeros(3), Position(1.0, outliers=0.02), []
    for k in range(int(seconds / step)):
        time, end = (k + 1) * step, round((k + 1) * step * 1e9)
        middle = place[2] + 0.5 * control.turn
        place += (control.distance * math.cos(middle), control.distance * math.sin(middle), control.turn)
        belief.predict(control, step)
        trust.moved(round(k * step * 1e9), end)
        off = (120.0 if 60.0 <= time < 90.0 else 0.0) + (time - 150.0 if 150.0 <= time < 210.0 else 0.0)
        fix = PositionMeasurement(place[0] + off + 0.4 * rng.normal(), place[1] + 0.4 * rng.normal(), 0.9)
        measured = Measurement("position/bus", model, fix, True, math.log(0.02e-6), 5.0)
        sample = Sample(end, end, "bus", "receiver", LocalPosition(fix.north, fix.east))
        admitted = trust.admits(end, sample, measured)
        particles = trust.take_back()
        if particles is not None:
            belief.inject(particles)
        if admitted:
            belief.weigh(model, fix)
        belief.normalize()
        if belief.effective_sample_size < 200:
            belief.resample()
        error = math.dist(belief.moments().mean[:2], place[:2])
        odds = trust.log_odds("position/bus")
        rows.append((time, off, error, math.nan if odds is None else odds))
    time, off, error, odds = np.array(rows).T
    figure, (above, below) = plt.subplots(2, figsize=(6.8, 4.6), sharex=True, layout="constrained")
    above.plot(time, odds, color=BLUE)
    for level, words in ((-5.0, "distrusted below"), (1.0, "trusted again above")):
        above.axhline(level, color=GREY, linewidth=0.8, linestyle="--")
        above.text(140.0, level, words, ha="center", va="bottom", color=GREY, fontsize=8)
    above.set_ylabel("log odds of honesty")
    below.plot(time, off, color=RED, label="the receiver's")
    below.plot(time, error, color=BLUE, linestyle="--", label="the belief's")
    below.set_ylabel("error, m")
    below.set_xlabel("time, s")
    below.set_xlim(0, seconds)
    below.legend(loc="upper right")
    return figure


FIGURES = {"liar": liar, "trust": trust, "jam": jam}
