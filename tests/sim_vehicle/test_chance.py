"""Streams of random numbers: the same for the same name and seed, apart for others."""

from __future__ import annotations

import numpy as np
import pytest

from sim_vehicle.chance import stream


def test_the_same_name_and_seed_give_the_same_numbers() -> None:
    assert np.array_equal(stream(7, "wheels").random(100), stream(7, "wheels").random(100))


def test_other_names_and_seeds_are_independent() -> None:
    """Correlations of 10^5 normals: sigma 0.0032; 0.0145 fails by chance once in 14,000 tests."""
    streams = [
        stream(seed, name).standard_normal(100_000) for seed in (0, 1) for name in ("wheels", "gnss", "")
    ]
    correlations = np.corrcoef(streams)[np.triu_indices(len(streams), 1)]
    assert np.abs(correlations).max() < 0.0145


def test_a_negative_seed_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 0, got -1"):
        stream(-1, "wheels")
