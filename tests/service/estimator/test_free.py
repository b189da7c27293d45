"""A tag without odometry through the estimator: no heading, a velocity of its own, a bias for every beacon."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from drivers.sample import LocalPosition, Range, Sample
from service.config import Configuration, validated
from service.estimate import Estimate, HealthState
from service.estimator import Estimator
from service.estimator.shadow import Shadow

SECOND = 1_000_000_000
ANCHORS = {1: (12.0, 10.0, -2.0), 2: (12.0, -10.0, -0.5), 3: (-12.0, 10.0, -3.0), 4: (-12.0, -10.0, 0.0)}
BIASES = {1: 0.25, 2: -0.15, 3: 0.0, 4: 0.1}
DOWN = -0.8


def configuration(**sections: Any) -> Configuration:
    file: dict[str, Any] = {
        "vehicle": {"name": "tag", "motion": "constant_velocity"},
        "start": {"position": [0.0, 5.0, 0.0]},
        "loop": {"rate": 20.0, "horizon_ms": 100.0},
        "budget": {"particles_max": 3000},
        "link": [{"name": "l", "kind": "mavlink", "url": "udpin:127.0.0.1:0"}],
        "sensor": [{"kind": "range", "sigma": 0.1, "estimate": ["bias"]}],
        "beacon": [{"id": i, "position": list(p)} for i, p in ANCHORS.items()],
    }
    return validated(file | sections, Configuration, "tag.toml")


def place(t: float) -> tuple[float, float, float, float]:
    """North, east and their rates on an oval of 8 by 5 metres, once a minute."""
    rate = math.tau / 60.0
    angle = rate * t
    return 8 * math.sin(angle), 5 * math.cos(angle), 8 * rate * math.cos(angle), -5 * rate * math.sin(angle)


def ranges(seconds: float, seed: int) -> list[Sample]:
    """Every anchor ten times a second, with its bias; one in fifty is metres too long."""
    random = np.random.default_rng(seed)
    samples: list[Sample] = []
    for index in range(round(seconds * 40)):
        t = index / 40.0
        beacon = 1 + index % 4
        north, east, _, _ = place(t)
        n, e, d = ANCHORS[beacon]
        distance = math.dist((north, east, DOWN), (n, e, d)) + BIASES[beacon] + 0.1 * random.normal()
        distance += random.exponential(3.0) if random.uniform() < 0.02 else 0.0
        time = round(t * SECOND)
        samples.append(Sample(time, time, "l", "RANGING_BEACON", Range(beacon, distance)))
    return samples


def run(estimator: Estimator, samples: list[Sample], until: float, since: float = 0.0) -> list[Estimate]:
    waiting, estimates = iter(samples), list[Estimate]()
    sample = next(waiting, None)
    for tick in range(round(since * 20) + 1, round(until * 20) + 1):
        now = tick * SECOND // 20
        batch: list[Sample] = []
        while sample is not None and sample.received <= now:
            batch.append(sample)
            sample = next(waiting, None)
        estimator.ingest(batch)
        estimates.append(estimator.tick(now, now, 3000))
    return estimates


def test_a_tag_is_tracked_by_its_ranges_alone() -> None:
    """After a minute's round position, height and velocity lie within 3.3 standard deviations, and every bias is known
    to 0.15 m, of the 0.25 m that it may be: the shadow beside it knows as much."""
    estimator = Estimator(configuration(), seed=3)
    shadow = estimator.accompany(Shadow)
    samples = ranges(60.0, 1)
    run(estimator, samples[:40], 1.0)
    assert shadow.at(SECOND) is not None
    last = run(estimator, samples[40:], 60.0, 1.0)[-1]
    assert last.health is HealthState.TRACKING, last.reason
    assert last.heading is None
    assert last.heading_variance is None
    assert estimator.missing == []
    north, east, north_rate, east_rate = place(60.0)
    nn, ne, nd, ee, _, dd = (float("nan") if value is None else value for value in last.position_covariance)
    error = np.array([(last.position[0] or 0.0) - north, (last.position[1] or 0.0) - east])
    assert float(error @ np.linalg.inv([[nn, ne], [ne, ee]]) @ error) < 14.0  # chi-square, 2 degrees, 0.999
    assert math.hypot(*error) < 0.4
    assert last.position[2] == pytest.approx(DOWN, abs=3.3 * math.sqrt(dd))
    assert math.isfinite(nd)
    velocity_nn, velocity_ee = last.velocity_covariance[0] or 0.0, last.velocity_covariance[3] or 0.0
    assert last.velocity[0] == pytest.approx(north_rate, abs=3.3 * math.sqrt(velocity_nn))
    assert last.velocity[1] == pytest.approx(east_rate, abs=3.3 * math.sqrt(velocity_ee))
    assert last.velocity[2] is None
    for beacon, bias in BIASES.items():
        value, sigma = last.biases[f"range_bias/{beacon}"]
        assert value == pytest.approx(bias, abs=0.15)
        assert 0.005 < sigma < 0.2
    assert set(last.biases) == {f"range_bias/{beacon}" for beacon in BIASES}
    beside = shadow.at(60 * SECOND)
    assert beside is not None
    assert not shadow.unsupported
    assert math.hypot(beside.mean("north") - north, beside.mean("east") - east) < 0.4


def test_the_same_seed_gives_the_same_numbers() -> None:
    samples = ranges(3.0, 2)
    first, second = (run(Estimator(configuration(), seed=9), samples, 3.0)[-1] for _ in range(2))
    assert first == second


def fixes(seconds: float) -> list[Sample]:
    random = np.random.default_rng(4)
    samples: list[Sample] = []
    for index in range(round(seconds * 5)):
        t = index / 5.0
        north, east, _, _ = place(t)
        noise = 0.3 * random.normal(size=3)
        fix = LocalPosition(north + noise[0], east + noise[1], DOWN - 0.2 * t + noise[2], 0.3, 0.3)
        samples.append(Sample(round(t * SECOND), round(t * SECOND), "l", "fix", fix))
    return samples


def test_in_three_dimensions_it_climbs() -> None:
    """0.2 m/s up for 20 s, told by position fixes: height and its rate within three standard deviations."""
    free = configuration(
        start={"mode": "first_fix"},
        motion={"dimensions": 3, "acceleration_noise": 0.2},
        sensor=[{"kind": "position"}],
    )
    last = run(Estimator(free, seed=1), fixes(20.0), 20.0)[-1]
    dd, rate_variance = last.position_covariance[5], last.velocity_covariance[5]
    assert dd is not None
    assert rate_variance is not None
    assert last.position[2] == pytest.approx(DOWN - 4.0, abs=3.3 * math.sqrt(dd))
    assert last.velocity[2] == pytest.approx(-0.2, abs=3.3 * math.sqrt(rate_variance))
    assert rate_variance < 0.3**2


def test_on_the_plane_fixes_keep_the_height_beside_the_particles() -> None:
    plane = configuration(start={"mode": "first_fix"}, sensor=[{"kind": "position"}])
    last = run(Estimator(plane, seed=1), fixes(5.0), 5.0)[-1]
    assert last.position[2] == pytest.approx(DOWN - 0.8, abs=1.0)
    assert last.position_covariance[2] == 0.0
    assert last.biases == {}
