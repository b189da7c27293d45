"""The scan's likelihood against the same written with scipy's densities and a brute-force distance."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from filters.geometry import GridGeometry
from filters.kernels.compile import INTERPRETED
from filters.motion import Unicycle
from filters.occupancy import OccupancyGrid
from filters.particle import ParticleFilter
from filters.particle_set import ParticleSet
from filters.sectors import RangeSectors
from filters.sensing.scan import Scan, ScanMeasurement, distance_field

GEOMETRY = GridGeometry(0.25, -3.0, 5.0, 24, 32)
COUNT = 150 if INTERPRETED else 1500
MANY = 400 if INTERPRETED else 4000


def walls() -> np.ndarray:
    occupied = np.zeros(GEOMETRY.shape, bool)
    occupied[0] = occupied[-1] = True
    occupied[:, 0] = occupied[10:, -1] = True
    occupied[12, 14:20] = True
    return occupied


def sectors(width: float = 0.0) -> RangeSectors:
    ranges = [1.0, 2.5, math.inf, 0.7, math.nan, 3.0]
    return RangeSectors.of(np.arange(6) * 1.1 - 2.0, ranges, 4.0, width=width, shortest=0.2)


def particles(count: int = COUNT) -> ParticleSet:
    rng = np.random.default_rng(1)
    result = ParticleSet(("north", "east", "heading"), count)
    result.count = count
    result.columns[:] = (
        rng.uniform(-4.0, 4.0, count),
        rng.uniform(4.0, 14.0, count),
        rng.uniform(-math.pi, math.pi, count),
    )
    return result


def brute_distance(north: np.ndarray, east: np.ndarray, farthest: float) -> tuple[np.ndarray, np.ndarray]:
    """Distance from the middle of the cell that a place lies in to the nearest obstacle's; and its doubt.

    In doubt is a place so near a cell's edge that float32 may see it in the neighbour.
    """
    middle_north, middle_east = GEOMETRY.centres()
    rows, columns = np.nonzero(walls())
    row, column = GEOMETRY.cells(north, east)
    inside = (row >= 0) & (row < GEOMETRY.rows) & (column >= 0) & (column < GEOMETRY.columns)
    r = np.clip(np.floor(row), 0, GEOMETRY.rows - 1).astype(int)
    c = np.clip(np.floor(column), 0, GEOMETRY.columns - 1).astype(int)
    away = np.hypot(
        middle_north[r][:, None] - middle_north[rows], middle_east[c][:, None] - middle_east[columns]
    ).min(axis=1)
    doubt = (np.abs(row - np.round(row)) < 1e-4) | (np.abs(column - np.round(column)) < 1e-4)
    return np.where(inside & (away < farthest), away, math.inf), doubt


@pytest.mark.parametrize("outliers", [0.0, 0.2])
@pytest.mark.parametrize("width", [0.0, 0.3])
def test_log_likelihood(outliers: float, width: float) -> None:
    sensor = Scan(GEOMETRY, walls(), 0.3, outliers, 40.0, trust=0.5, lever=(0.4, -0.2), farthest=1.5)
    cloud = particles()
    measurement = ScanMeasurement.of(sectors(width))
    assert sensor.refusal(measurement) is None
    constant = sensor.weigh(cloud, 0, COUNT, measurement)
    north, east, heading = cloud.columns.astype(np.float64)
    expected = np.zeros(COUNT)
    doubtful = np.zeros(COUNT, bool)
    seen = sectors(width)
    for bearing, distance in zip(seen.bearings[seen.hits], seen.ranges[seen.hits], strict=True):
        forward, right = distance * math.cos(bearing) + 0.4, distance * math.sin(bearing) - 0.2
        away, doubt = brute_distance(
            north + forward * np.cos(heading) - right * np.sin(heading),
            east + forward * np.sin(heading) + right * np.cos(heading),
            1.5,
        )
        sigma = math.hypot(0.3, distance * width / math.sqrt(12.0))
        with np.errstate(divide="ignore"):
            expected += 0.5 * np.log((1.0 - outliers) * stats.norm.pdf(away, 0.0, sigma) + outliers / 40.0)
        doubtful |= doubt
    got = cloud.log_weights.astype(np.float64) + constant
    sure = ~doubtful & np.isfinite(expected)
    assert doubtful.mean() < 0.02
    np.testing.assert_allclose(got[sure], expected[sure], atol=2e-5, rtol=1e-4)
    assert (got[~doubtful & np.isneginf(expected)] < -1e9).all()
    assert (cloud.log_weights <= 2e-6).all()
    if outliers:
        assert np.isfinite(expected).all()


@pytest.mark.interpreted
def test_only_the_block_is_weighed_whatever_its_bounds() -> None:
    sensor, measurement = Scan(GEOMETRY, walls(), 0.3), ScanMeasurement.of(sectors())
    whole, parts = particles(), particles()
    sensor.weigh(whole, 0, COUNT, measurement)
    for first, last in ((0, 1), (1, 2 * COUNT // 3), (2 * COUNT // 3, COUNT - 7)):
        sensor.weigh(parts, first, last, measurement)
    np.testing.assert_allclose(parts.log_weights[:-7], whole.log_weights[:-7], rtol=1e-6, atol=1e-6)
    assert not parts.log_weights[-7:].any()


@pytest.mark.interpreted
def test_beyond_the_map_only_an_outlier_is_left() -> None:
    """Far away in every direction, and NaN: the bound of the outlier part, for every hit."""
    sensor, measurement = Scan(GEOMETRY, walls(), 0.3, 0.1, 40.0), ScanMeasurement.of(sectors())
    cloud = particles(6)
    cloud.columns[0] = (1e6, -1e6, 0.0, 0.0, np.nan, 3e38)
    cloud.columns[1] = (9.0, 9.0, 1e6, -1e6, 9.0, -3e38)
    constant = sensor.weigh(cloud, 0, 6, measurement)
    np.testing.assert_allclose(cloud.log_weights + constant, 4 * math.log(0.1 / 40.0), rtol=1e-5)


def test_the_field_is_the_distance_of_every_cell() -> None:
    field = distance_field(GEOMETRY, walls(), 1.0)
    north, east = np.meshgrid(*GEOMETRY.centres(), indexing="ij")
    away, _ = brute_distance(north.ravel(), east.ravel(), 1.0)
    inner = field[1:-1, 1:-1].ravel()
    np.testing.assert_allclose(inner[away < 1.0], away[away < 1.0], rtol=1e-6)
    assert (inner[np.isinf(away)] > 1e8).all()
    assert (np.r_[field[0], field[-1], field[:, 0], field[:, -1]] > 1e8).all()


def test_the_innovation_is_how_far_the_hits_lie_from_obstacles() -> None:
    sensor = Scan(GEOMETRY, walls(), 0.3, lever=(0.5, 0.0))
    centre = {"north": 0.125, "east": 9.125, "heading": math.pi / 2}
    hit_at_wall = ScanMeasurement.of(RangeSectors.of([math.pi / 2], [2.9], 9.0))
    assert sensor.innovation(centre, hit_at_wall) == 0.0
    two = ScanMeasurement.of(RangeSectors.of([math.pi / 2, -math.pi / 2], [2.9, 1.0], 9.0))
    assert sensor.innovation(centre, two) == pytest.approx(
        distance_field(GEOMETRY, walls(), 10.0)[17, 19] / math.sqrt(2.0)
    )


def test_a_scan_finds_the_robot_in_the_filter() -> None:
    """Among particles around the truth, scans of 36 rays pull the mean to 0.15 m (few, uncompiled: 0.5); fixed seed."""
    grid = OccupancyGrid.from_probability(0.25, -3.0, 5.0, walls())
    sensor = Scan(GEOMETRY, walls(), 0.2, trust=0.3)
    rng = np.random.default_rng(2)
    belief = ParticleFilter(Unicycle(0.1, 0.02, 1e-4, 1e-4), capacity=MANY, seed=1)
    start = {name: np.zeros(MANY) for name in belief.names} | {
        "north": rng.normal(-1.5, 0.7, MANY),
        "east": rng.normal(7.0, 0.7, MANY),
        "heading": rng.normal(0.3, 0.2, MANY),
    }
    belief.initialize(start)
    bearings = np.linspace(-math.pi, math.pi, 36, endpoint=False)
    ranges = grid.expected_ranges([-1.2, 6.5, 0.2], bearings, 6.0) + 0.1
    evidence = belief.weigh(sensor, ScanMeasurement.of(RangeSectors.of(bearings, ranges, 6.0)))
    mean = belief.moments().mean
    assert evidence.accepted
    assert math.hypot(mean[0] + 1.2, mean[1] - 6.5) < (0.5 if INTERPRETED else 0.15)
    assert abs(mean[2] - 0.2) < (0.2 if INTERPRETED else 0.05)


def test_every_third_sector() -> None:
    some = ScanMeasurement.of(sectors(), every=3)
    assert len(some) == 6
    assert math.hypot(some[3], some[4]) == pytest.approx(0.7)
    with pytest.raises(ValueError, match="every"):
        ScanMeasurement.of(sectors(), every=0)


@pytest.mark.parametrize(
    ("measurement", "what"),
    [((), "at least one hit"), ((1.0, 2.0), "3 numbers"), ((1.0, 2.0, -0.1), "uncertainty")],
)
def test_refusals(measurement: tuple[float, ...], what: str) -> None:
    assert what in (Scan(GEOMETRY, walls(), 0.3).refusal(ScanMeasurement(measurement)) or "")


@pytest.mark.parametrize(
    ("make", "what"),
    [
        (lambda: Scan(GEOMETRY, walls(), 0.0), "sigma"),
        (lambda: Scan(GEOMETRY, walls(), 0.3, trust=0.0), "trust"),
        (lambda: Scan(GEOMETRY, walls(), 0.3, lever=(math.nan, 0.0)), "lever"),
        (lambda: Scan(GEOMETRY, walls(), 0.3, farthest=0.0), "farthest"),
        (lambda: Scan(GEOMETRY, walls()[1:], 0.3), "shape"),
        (lambda: Scan(GEOMETRY, ~np.ones(GEOMETRY.shape, bool), 0.3), "no occupied cell"),
    ],
)
def test_what_makes_no_sense_is_refused(make: Callable[[], object], what: str) -> None:
    with pytest.raises(ValueError, match=what):
        make()


def test_without_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "scipy.ndimage", None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'beliefd\[maps\]'"):
        Scan(GEOMETRY, walls(), 0.3)
