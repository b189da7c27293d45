"""When a sensor measures, and when its reading is there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Cadence:
    """The rhythm of one sensor.

    Attributes
    ----------
    rate : float
        Readings per second.
    phase : float
        When the first one is taken, seconds after the drive began.
    latency : float
        Seconds from the measurement until the reading is there.
    jitter : float
        Mean of the further delay, exponentially distributed, seconds.
    dropout : float
        Share of readings that never come.
    """

    rate: float
    phase: float = 0.0
    latency: float = 0.0
    jitter: float = 0.0
    dropout: float = 0.0

    def __post_init__(self) -> None:
        """Refuse figures that no sensor can have."""
        if self.rate <= 0.0:
            raise ValueError(f"cadence: rate needs to be above 0, got {self.rate}")
        if min(self.phase, self.latency, self.jitter) < 0.0:
            raise ValueError(f"cadence: phase, latency and jitter need to be at least 0, got {self}")
        if not 0.0 <= self.dropout <= 1.0:
            raise ValueError(f"cadence: dropout needs to be a share from 0 to 1, got {self.dropout}")

    def due(self, count: int) -> float:
        """Return when the measurement number ``count`` is taken, seconds since the drive began."""
        return self.phase + count / self.rate

    def delay(self, chance: np.random.Generator) -> float | None:
        """Draw how long a reading takes, seconds; ``None``: it never comes."""
        further, luck = float(chance.exponential()), float(chance.random())
        return None if luck < self.dropout else self.latency + self.jitter * further
