"""Invented runs whose every figure is known: a circle driven at 50 ticks a second, off by a known amount."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from drivers.sample import LinkReport
from service.config import MavlinkLink, Site, Vehicle
from service.replay.run import Plan, Run
from service.replay.tally import ShadowRun
from service.replay.trace import HEALTH, Innovations, Trace
from service.score import Truth, score

START = 1_700_000_000.0
RATE = 50.0
OFF = 0.3
"""Metres by which the estimate lies north of the truth, and twice as far for the shadow."""


def trace(seconds: float, sensors: int = 2) -> tuple[Trace, Truth]:
    """Return a trace of a circle of 20 m, with sigma 0.25 m, and its truth; half a second of it without a belief."""
    count = round(seconds * RATE)
    time = START + np.arange(count) / RATE
    angle = 2 * math.pi * (time - START) / 60.0
    north, east = 20.0 * np.cos(angle), 20.0 * np.sin(angle)
    unknown = time - START < 0.5
    random = np.random.default_rng(5)

    def known(values: np.ndarray) -> np.ndarray:
        return np.where(unknown, np.nan, values)

    flat: Callable[[float], np.ndarray] = lambda value: np.full(count, value)  # noqa: E731
    health = np.where(unknown, HEALTH.index(HEALTH[0]), np.where(time - START < 0.75 * seconds, 2, 5))
    ticks = {
        "time": time,
        "north": known(north + OFF),
        "east": known(east),
        "nn": known(flat(0.0625)),
        "ne": known(flat(0.01)),
        "ee": known(flat(0.0625)),
        "radius95": known(flat(0.65)),
        "health": health.astype(np.float64),
        "particles": flat(5000.0),
        "demanded": 4000.0 + 100.0 * np.sin(angle),
        "afforded": flat(5000.0),
        "level": flat(0.0),
    }
    shadow = {name: ticks[name] for name in ("east", "nn", "ne", "ee")} | {"north": known(north + 2 * OFF)}
    slow = {"gyro_bias": (known(flat(0.005)), known(flat(0.001)))}

    def innovations(dimensions: int) -> Innovations:
        readings = round(seconds * 10)
        value = random.standard_normal(readings)
        when = np.sort(random.uniform(START, START + seconds, readings))
        return Innovations(when, value, np.ones(readings), np.abs(value) > 2.5, dimensions)

    sensed = {f"range/autopilot/{k}": innovations(1) for k in range(sensors)} | {
        "position/gnss": innovations(2)
    }
    return Trace(ticks, shadow, slow, sensed), Truth(time, north, east)


def run_of(traced: Trace, truth: Truth | None, seed: int = 0) -> Run:
    own = score(traced.track(), truth) if truth else score(traced.track(), Truth(*np.zeros((3, 2))))
    beside = score(traced.shadow_track(), truth) if truth else own
    return Run(
        seed=seed,
        score=own,
        particles_mean=5000.0,
        late_samples=0,
        dropped=0,
        health={"tracking": 0.75, "lost": 0.25},
        seconds=10.0,
        real_time_factor=31.4,
        ticks=traced.ticks["time"].size,
        biases={"gyro_bias": (0.005, 0.001)},
        sensors={"range/autopilot/0": (100, {"outlier": 3})},
        links=[LinkReport("autopilot", "up")],
        shadow=ShadowRun(beside, 10, {"range/autopilot/0": 90}, {"range/autopilot/0": 13}, {}, ""),
        trace=traced,
    )


def plan_of(truth: Truth | None, log: str = "drive.tlog") -> Plan:
    link = MavlinkLink(name="autopilot", kind="mavlink", url="udpin:127.0.0.1:14550")
    configuration = Site().configuration(Vehicle(name="replay"), (link,), ())
    return Plan((Path(log),), configuration, 5000, truth, None, 0)
