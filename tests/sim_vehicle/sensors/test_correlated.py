"""Gauss-Markov errors against their closed-form statistics."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_vehicle.chance import stream
from sim_vehicle.sensors.correlated import Wander


def test_spread_and_memory_are_those_of_the_settings() -> None:
    """4,000 independent paths: variance within 5 sqrt(2/N) of its own, correlation within 5/sqrt(N)."""
    count, chance = 4000, stream(1, "wander")
    paths = np.array(
        [[path.at(10.0), path.at(17.0)] for path in (Wander(0.5, 20.0, chance) for _ in range(count))]
    )
    bound = 5.0 * math.sqrt(2.0 / count)
    assert paths.var(axis=0) / 0.25 == pytest.approx([1.0, 1.0], abs=bound)
    correlation = np.corrcoef(paths.T)[0, 1]
    assert correlation == pytest.approx(math.exp(-7.0 / 20.0), abs=5.0 / math.sqrt(count))


def test_without_time_nothing_changes() -> None:
    wander = Wander(1.0, 5.0, stream(1, "w"))
    assert wander.at(3.0) == wander.at(3.0)
