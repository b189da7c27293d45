"""Paths against a particle set that is never resampled: there a late measurement and a timely one weigh the same."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from filters.belief import Displacement
from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.paths import Paths
from filters.sensing import Position, PositionMeasurement

COUNT = 2000
SECOND = 1_000_000_000


def belief(seed: int = 3, count: int = COUNT) -> ParticleFilter[UnicycleControl]:
    result = ParticleFilter(Unicycle(0.2, 0.05, 1e-3, 1e-3), capacity=COUNT, seed=seed)
    chance = np.random.default_rng(seed)
    result.initialize(
        {
            "north": chance.normal(0, 2, count),
            "east": chance.normal(0, 2, count),
            "heading": chance.uniform(-math.pi, math.pi, count),
            "gyro_bias": np.zeros(count),
            "odometry_scale": np.ones(count),
        }
    )
    return result


CONTROL = UnicycleControl(0.7, 0.15)


def way(start: int, end: int) -> Displacement:
    """The way of CONTROL once a second, as chords of a hundredth."""
    steps = 100
    share = (end - start) / SECOND / steps
    forward = right = turn = 0.0
    for _ in range(steps):
        forward += 0.7 * share * math.cos(turn + 0.075 * share)
        right += 0.7 * share * math.sin(turn + 0.075 * share)
        turn += 0.15 * share
    return Displacement(forward, right, turn)


def poses(of: ParticleFilter[UnicycleControl]) -> NDArray[np.float32]:
    return of.columns[:3, : of.count].copy()


Story = list[NDArray[np.float32]]


def driven(
    seconds: int, resampled: tuple[int, ...] = ()
) -> tuple[ParticleFilter[UnicycleControl], Paths, Story]:
    """Drive, mark every second, resample after some of them by weights that differ; keep what was, by identity."""
    filter_ = belief()
    paths_ = Paths(filter_, marks=8)
    paths_.mark(0)
    story = [poses(filter_)]
    for second in range(1, seconds + 1):
        filter_.predict(CONTROL, 1.0)
        if second in resampled:
            filter_.weigh(Position(3.0), PositionMeasurement(1.0, 1.0))
            before = poses(filter_)
            filter_.resample()
            where = {tuple(column): index for index, column in enumerate(before.T.tolist())}
            parents = [where[tuple(column)] for column in poses(filter_).T.tolist()]
            story = [was[:, parents] for was in story]
        paths_.mark(second * SECOND)
        story.append(poses(filter_))
    return filter_, paths_, story


@pytest.mark.parametrize("resampled", [(), (2,), (1, 2, 4), (3, 5)])
@pytest.mark.parametrize("second", [0, 1, 2, 4, 5])
def test_at_a_mark_every_particle_is_where_its_ancestor_was(second: int, resampled: tuple[int, ...]) -> None:
    """Exactly, through any number of resamplings."""
    _, paths, story = driven(5, resampled)
    past = paths.at(second * SECOND, 5 * SECOND, way)
    assert past is not None
    assert past.known.all()
    np.testing.assert_allclose(past.particles.columns[:2, :COUNT], story[second][:2], atol=2e-6)
    turned = past.particles.columns[2, :COUNT] - story[second][2]
    assert np.abs(np.remainder(turned + math.pi, 2 * math.pi) - math.pi).max() < 2e-6


def test_between_marks_a_path_is_the_mean_of_what_can_have_been() -> None:
    """Of 300 drives with half a second each: the middle, given both ends, has no bias beyond 5 standard errors."""
    errors: Story = []
    for seed in range(300):
        filter_ = belief(seed, 20)
        paths = Paths(filter_, marks=4)
        paths.mark(0)
        filter_.predict(UnicycleControl(0.35, 0.075), 0.5)
        middle = poses(filter_)
        filter_.predict(UnicycleControl(0.35, 0.075), 0.5)
        past = paths.at(SECOND // 2, SECOND, way)
        assert past is not None
        errors.append((past.particles.columns[:3, :20] - middle + np.pi) % (2 * np.pi) - np.pi)
    gathered = np.concatenate(errors, axis=1)
    spread = gathered.std(axis=1)
    # a bridge over a second has half the deviation in its middle: 0.2 m along, 0.05 rad
    assert 0.08 < np.hypot(*spread[:2]) < 0.14
    assert 0.02 < spread[2] < 0.03
    assert (np.abs(gathered.mean(axis=1)) < 5 * spread / math.sqrt(gathered.shape[1])).all()


def test_a_late_measurement_weighs_as_a_timely_one() -> None:
    """Log weights to 1e-5: between them no resampling, so that both have the same particles."""
    late, paths, _ = driven(5)
    timely = belief()
    for second in range(1, 6):
        timely.predict(CONTROL, 1.0)
        if second == 2:
            said = timely.weigh(Position(0.5), PositionMeasurement(1.0, -0.5))
    past = paths.at(2 * SECOND, 5 * SECOND, way)
    assert past is not None
    evidence = late.weigh_past(Position(0.5), PositionMeasurement(1.0, -0.5), *past)
    np.testing.assert_allclose(late.weights, timely.weights, atol=1e-5)
    assert evidence.log_mean == pytest.approx(said.log_mean, abs=1e-4)
    assert late.moments().mean == pytest.approx(timely.moments().mean, abs=1e-4)


def test_what_is_older_than_the_marks_is_not_known() -> None:
    filter_, paths, _ = driven(10)
    assert paths.earliest == 3 * SECOND
    assert paths.at(3 * SECOND - 1, 10 * SECOND, way) is None
    assert paths.at(3 * SECOND, 10 * SECOND, way) is not None
    paths.begin()
    assert paths.earliest is None
    assert paths.at(10 * SECOND, 10 * SECOND, way) is None
    assert filter_.count == COUNT


def test_those_that_were_injected_keep_their_share() -> None:
    """A tenth of the belief has no path; after a measurement of the past it still is a tenth, to 1e-5."""
    filter_, paths, _ = driven(3)
    filter_.inject({"north": np.full(200, 500.0), "east": np.full(200, 500.0)})
    past = paths.at(SECOND, 3 * SECOND, way)
    assert past is not None
    assert int((~past.known).sum()) == 200
    filter_.weigh_past(Position(0.5), PositionMeasurement(1.0, 0.0), *past)
    share = float(filter_.weights[~past.known].sum(dtype=np.float64) / filter_.weights.sum(dtype=np.float64))
    assert share == pytest.approx(0.1, abs=1e-5)


def test_nonsense_is_refused() -> None:
    filter_ = belief()
    with pytest.raises(ValueError, match="marks"):
        Paths(filter_, 1)
    with pytest.raises(ValueError, match="follow"):
        filter_.follow(np.zeros(3, np.int32))
    paths = Paths(filter_, 2)
    paths.mark(0)
    past = paths.at(0, 0, way)
    assert past is not None
    before = filter_.weights.copy()
    with pytest.raises(ValueError, match="finite"):
        filter_.weigh_past(Position(1.0), PositionMeasurement(math.nan, 0.0), *past)
    assert not filter_.weigh_past(Position(1.0), PositionMeasurement(0.0, 0.0, -1.0), *past).accepted
    np.testing.assert_array_equal(filter_.weights, before)
