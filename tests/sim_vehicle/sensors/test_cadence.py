"""When readings are taken, and when they are there."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_vehicle.chance import stream
from sim_vehicle.sensors import Cadence


def test_measurements_are_evenly_spaced_from_the_phase() -> None:
    cadence = Cadence(20.0, phase=0.01)
    assert [cadence.due(count) for count in (0, 1, 20)] == pytest.approx([0.01, 0.06, 1.01])


def test_delay_and_dropout_have_the_statistics_of_the_settings() -> None:
    """20,000 draws: the bounds are five sigma, so a failure by chance is rarer than 10^-6."""
    cadence, chance = Cadence(10.0, latency=0.02, jitter=0.005, dropout=0.1), stream(1, "cadence")
    delays = [cadence.delay(chance) for _ in range(20_000)]
    there = np.array([delay for delay in delays if delay is not None])
    assert abs(20_000 - len(there) - 2000) < 5.0 * math.sqrt(1800)
    assert there.min() >= 0.02
    assert there.mean() == pytest.approx(0.025, abs=5.0 * 0.005 / math.sqrt(len(there)))


def test_dropout_leaves_the_random_numbers_of_the_other_readings() -> None:
    with_dropout, without = (
        [cadence.delay(chance) for _ in range(200)]
        for cadence, chance in (
            (Cadence(10.0, jitter=0.01, dropout=0.5), stream(1, "c")),
            (Cadence(10.0, jitter=0.01), stream(1, "c")),
        )
    )
    assert any(delay is None for delay in with_dropout)
    assert all(first in (None, second) for first, second in zip(with_dropout, without, strict=True))


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({"rate": 0.0}, "rate needs to be above 0"),
        ({"rate": 1.0, "latency": -1.0}, "at least 0"),
        ({"rate": 1.0, "dropout": 1.1}, "share from 0 to 1"),
    ],
)
def test_impossible_figures_are_refused(settings: dict[str, float], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        Cadence(**settings)
