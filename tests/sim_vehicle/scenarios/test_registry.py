"""The scenarios by name, and that each is drawn from its seed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_vehicle import scenarios


def test_the_names_are_listed_with_a_line_each() -> None:
    assert {"beacons", "demo", "mirror", "kidnap", "spoof", "slip", "outage"} <= set(scenarios.names())
    for name in scenarios.names():
        assert "\n" not in scenarios.description(name)
        assert scenarios.draw(name, 1).name == name


def test_an_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match="no scenario 'nosuch'; there are beacons, demo, jam"):
        scenarios.draw("nosuch", 1)


@pytest.mark.parametrize("name", scenarios.names())
def test_a_seed_draws_the_same_and_another_seed_another(name: str) -> None:
    assert scenarios.draw(name, 5) == scenarios.draw(name, 5)
    first, second = scenarios.draw(name, 5), scenarios.draw(name, 6)
    assert first.start != second.start
    assert first.wheels is not None
    assert second.wheels is not None
    assert first.wheels.scale != second.wheels.scale
    assert first.clock != second.clock


@pytest.mark.parametrize("name", scenarios.names())
def test_events_lie_within_the_drive_and_in_order(name: str) -> None:
    for seed in range(3):
        drawn = scenarios.draw(name, seed)
        times = [event.time for event in drawn.events]
        assert times == sorted(times)
        assert all(0.0 < time < drawn.seconds for time in times)


def test_the_start_is_told_as_wrong_as_its_sigmas_say() -> None:
    """300 seeds, normalised errors: five sigma of a mean (0.29) and of a variance (0.41)."""
    errors = []
    for seed in range(300):
        drawn = scenarios.draw("beacons", seed)
        belief, start = drawn.belief, drawn.start
        errors.append(
            [
                (belief.position[0] - start.north) / belief.sigma[0],
                (belief.position[1] - start.east) / belief.sigma[1],
                math.remainder(belief.heading - start.heading, math.tau) / belief.sigma_heading,
            ]
        )
    assert np.abs(np.mean(errors, axis=0)).max() < 5.0 / math.sqrt(300)
    assert np.abs(np.var(errors, axis=0) - 1.0).max() < 5.0 * math.sqrt(2.0 / 300)
