"""A short drive for the tests of trust and motion mode: a known truth, odometry, and a particle filter that follows."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from drivers.sample import SECOND, LocalPosition, Sample
from filters.belief import Evidence
from filters.motion.standing import StandingUnicycle
from filters.motion.unicycle import UnicycleControl
from filters.particle import ParticleFilter
from filters.sensing import (
    Position,
    PositionMeasurement,
    Range,
    RangeMeasurement,
    Velocity,
    VelocityMeasurement,
)
from service.estimator.measuring import Measurement

STEP = 0.2
SPEED = 1.5
BEACONS = ((40.0, 0.0), (0.0, 40.0), (-40.0, 0.0), (0.0, -40.0))


@dataclass
class Drive:
    """A vehicle that circles; wheels and gyro are right but for ``odometry``."""

    seed: int = 1
    turn_rate: float = 0.05
    odometry: Callable[[float], float] = lambda time: 1.0
    speed: Callable[[float], float] = lambda time: SPEED
    time: float = 0.0
    truth: Any = field(default_factory=lambda: np.array([0.0, 0.0, 0.3]))
    controls: dict[int, UnicycleControl] = field(default_factory=dict[int, UnicycleControl])

    def __post_init__(self) -> None:
        self.chance = np.random.default_rng(self.seed)
        self.motion = StandingUnicycle(
            0.1,
            0.02,
            1e-4,
            1e-4,
            slip_noise=0.05,
            turn_noise=0.01,
            gyro_bias_sigma=0.002,
            odometry_scale_sigma=0.01,
        )
        self.belief = ParticleFilter[UnicycleControl](self.motion, capacity=400, seed=self.seed)
        draw = self.chance.standard_normal
        self.belief.initialize(
            {
                "north": 0.3 * draw(400),
                "east": 0.3 * draw(400),
                "heading": 0.3 + 0.05 * draw(400),
                "gyro_bias": np.zeros(400),
                "odometry_scale": np.ones(400),
            }
        )

    @property
    def now(self) -> int:
        """Nanoseconds."""
        return round(self.time * SECOND)

    def control(self, start: int, end: int) -> UnicycleControl:
        """What wheels and gyro said; only whole steps are asked for."""
        return self.controls[start]

    def step(self) -> tuple[int, int]:
        """Move the truth by one step and return its beginning and end."""
        start = self.now
        distance, turn = (
            self.speed(self.time) * STEP,
            (self.turn_rate * STEP if self.speed(self.time) else 0.0),
        )
        middle = self.truth[2] + 0.5 * turn
        self.truth += (distance * math.cos(middle), distance * math.sin(middle), turn)
        self.controls[start] = UnicycleControl(distance * self.odometry(self.time), turn)
        self.time += STEP
        return start, self.now

    @property
    def error(self) -> float:
        """Of the belief, metres."""
        return math.dist(self.belief.moments().mean[:2], self.truth[:2])

    def position(self, offset: tuple[float, float] = (0.0, 0.0), sigma: float = 0.4) -> Measurement:
        """A fix of the true place plus an offset and noise."""
        noise = sigma * self.chance.standard_normal(2)
        repeats = 1.0 / STEP
        where = self.truth[:2] + offset + noise
        value = PositionMeasurement(float(where[0]), float(where[1]), sigma * math.sqrt(repeats))
        return Measurement(
            "position/bus", Position(1.0, outliers=0.02), value, True, math.log(0.02e-6), repeats
        )

    def velocity(self, offset: tuple[float, float] = (0.0, 0.0)) -> Measurement:
        """The velocity of the same receiver."""
        speed, repeats = self.speed(self.time), 1.0 / STEP
        north, east = speed * math.cos(self.truth[2]) + offset[0], speed * math.sin(self.truth[2]) + offset[1]
        north, east = north + 0.1 * self.chance.standard_normal(), east + 0.1 * self.chance.standard_normal()
        value = VelocityMeasurement(north, east, speed, 0.1 * math.sqrt(repeats))
        return Measurement(
            "velocity/bus", Velocity(0.3, outliers=0.02), value, False, math.log(0.02e-4), repeats
        )

    def range(self, beacon: int, excess: float = 0.0) -> Measurement:
        """The range to one of :data:`BEACONS`."""
        north, east = BEACONS[beacon]
        distance = math.hypot(self.truth[0] - north, self.truth[1] - east) + excess
        value = RangeMeasurement(distance + 0.3 * self.chance.standard_normal(), north, east, 0.0, 0.3)
        model = Range(0.3, outliers=0.05, span=200.0)
        return Measurement(f"range/bus/{beacon}", model, value, True, math.log(0.05 / 200.0), 1.0)

    def sample(self) -> Sample:
        """The envelope of a measurement of now."""
        return Sample(self.now, self.now, "bus", "receiver", LocalPosition(0.0, 0.0))

    def weigh(self, measured: Measurement) -> Evidence:
        """Weigh the particles."""
        return self.belief.weigh(measured.model, measured.value)

    def settle(self) -> None:
        """Normalise, and resample where the weights are worn."""
        self.belief.normalize()
        if self.belief.effective_sample_size < 200.0:
            self.belief.resample()
