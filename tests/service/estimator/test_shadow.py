"""The shadow beside the estimator: the same samples, a start once the heading is known, no effect on the particles."""

from __future__ import annotations

import subprocess
import sys
from itertools import chain

import numpy as np
import pytest

from filters.belief import Evidence
from filters.sensing import Position, PositionMeasurement
from service.config import Configuration
from service.estimator import Estimator
from service.estimator.binding import Measurement
from service.estimator.ground import HEADING_KNOWN
from service.estimator.shadow import Shadow
from service.replay.run import ticks_of
from service.replay.site import setting_of
from service.replay.sources import merged, open_log

Drive = tuple[Configuration, list[tuple[int, list[object]]]]


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Drive:
    """Twenty seconds among beacons, cut into ticks."""
    stem = tmp_path_factory.mktemp("shadow") / "beacons"
    options = ["--seed", "2", "--seconds", "20", "--write", str(stem)]
    subprocess.run(
        [sys.executable, "-m", "sim_vehicle", "beacons", *options], check=True, capture_output=True
    )
    logs = tuple(p for e in (".tlog", ".candump.log") if (p := stem.with_name("beacons" + e)).is_file())
    configuration = setting_of(logs, None, None).configuration
    samples = merged([open_log(log, configuration) for log in logs if log.stat().st_size])
    return configuration, list(ticks_of(chain(samples), configuration.loop.rate))


def driven(drive: Drive, shadowed: bool) -> tuple[list[tuple[object, ...]], Shadow | None, Estimator]:
    configuration, ticks = drive
    estimator = Estimator(configuration, seed=3)
    shadow = estimator.accompany(Shadow) if shadowed else None
    said: list[tuple[object, ...]] = []
    for now, batch in ticks:
        estimator.ingest(batch)
        estimate = estimator.tick(now, now, 800)
        pose = shadow.at(now) if shadow is not None else None
        said.append((estimate.position, estimate.position_covariance, estimate.particles, pose))
    return said, shadow, estimator


def test_the_particles_do_not_notice_the_shadow(drive: Drive) -> None:
    alone, _, _ = driven(drive, shadowed=False)
    followed, _, _ = driven(drive, shadowed=True)
    assert [tick[:3] for tick in alone] == [tick[:3] for tick in followed]


def test_it_gets_every_measurement_and_agrees_where_the_belief_is_one_gaussian(drive: Drive) -> None:
    said, shadow, estimator = driven(drive, shadowed=True)
    assert shadow is not None
    assert shadow.failure == ""
    begun = [tick for tick in said if tick[3] is not None]
    assert len(begun) > 0.8 * len(said)
    weighed = sum(s.accepted + s.refused.get("outlier", 0) for s in estimator.sensors(0))
    assert 0.9 * weighed < shadow.accepted.total() + shadow.gated.total() <= weighed
    position, covariance, _, pose = begun[-1]
    apart = np.hypot(position[0] - pose.mean("north"), position[1] - pose.mean("east"))
    assert apart < 3.0 * np.sqrt(covariance[0] + covariance[3])


def test_it_waits_for_a_heading_and_for_a_new_start(drive: Drive) -> None:
    configuration, _ = drive
    start = configuration.start.model_copy(update={"heading": None, "sigma_heading": None})
    honesty = configuration.honesty.model_copy(
        update={"hypotheses": False}
    )  # or what is said is the leader's
    estimator = Estimator(configuration.model_copy(update={"start": start, "honesty": honesty}), seed=3)
    shadow = estimator.accompany(Shadow)
    assert shadow.at(0) is None
    _, ticks = drive
    began: float | None = None
    for now, batch in ticks:
        estimator.ingest(batch)
        estimate = estimator.tick(now, now, 2000)
        if shadow.at(now) is not None and estimate.heading_variance is not None:
            began = estimate.heading_variance
            break
        assert estimate.heading_variance is None or estimate.heading_variance > 0.9 * HEADING_KNOWN**2
    assert began is not None
    assert began < 1.1 * HEADING_KNOWN**2
    shadow.started(now)
    assert not shadow.failure


class Oddity:
    """A sensor model that has no derivative."""


def test_a_model_without_a_derivative_is_counted(drive: Drive) -> None:
    _, shadow, _ = driven(drive, shadowed=True)
    assert shadow is not None
    unknown = Measurement("odd/link", Oddity(), (1.0,), False, 0.0, 1.0)  # pyright: ignore[reportArgumentType]
    shadow.weighed(0, unknown, Evidence(0.0, 0.0, accepted=True), False)
    assert shadow.unsupported == {"odd/link": 1}


def test_what_is_no_number_stops_it_and_says_so(drive: Drive) -> None:
    said, shadow, _ = driven(drive, shadowed=True)
    assert shadow is not None
    broken = Measurement("position/x", Position(1.0), PositionMeasurement(np.inf, 0.0, 1.0), True, 0.0, 1.0)
    shadow.weighed(0, broken, Evidence(0.0, 0.0, accepted=True), False)
    assert "finite" in shadow.failure
    assert shadow.at(0) is None
    assert said[-1][0][0] is not None
