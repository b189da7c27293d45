"""The occupancy grid against Table 9.2 cell by cell, and a building mapped from simulated scans."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from filters.binary import log_odds
from filters.geometry import GridGeometry
from filters.occupancy import InverseRangeModel, OccupancyGrid, Pose
from filters.sectors import RangeSectors

NAN = math.nan
MODEL = InverseRangeModel(occupied=0.8, free=0.3, thickness=0.2)


def scan(*ranges: float, width: float = 0.0, shortest: float = 0.0, longest: float = 3.0) -> RangeSectors:
    bearings = np.linspace(0.0, 2.0 * math.pi, len(ranges), endpoint=False)
    return RangeSectors.of(bearings, ranges, longest, width=width, shortest=shortest)


def test_cells_of_a_geometry() -> None:
    geometry = GridGeometry(0.5, -2.0, 10.0, 4, 6)
    row, column = geometry.cells([-2.0, -1.25], [10.0, 12.99])
    assert row.tolist() == [0.0, 1.5]
    assert np.floor(column).tolist() == [0.0, 5.0]
    north, east = geometry.centres()
    np.testing.assert_allclose(north, [-1.75, -1.25, -0.75, -0.25])
    assert (east[0], east[-1], geometry.shape) == (10.25, 12.75, (4, 6))


def test_a_ray_frees_what_it_passed_and_fills_what_it_hit() -> None:
    grid = OccupancyGrid(GridGeometry(0.1, 0.0, 0.0, 1, 30))
    grid.integrate(Pose(0.05, 0.05, math.pi / 2), scan(1.0), MODEL)
    free, hit = float(log_odds(0.3)), float(log_odds(0.8))
    expected = [free] * 9 + [hit] * 3 + [0.0] * 18  # cells of 0.90 to 1.20: the hit at 1.05, 0.1 either way
    np.testing.assert_allclose(grid.cells.log_odds[0], expected)


@pytest.mark.parametrize(("given", "free"), [(math.inf, 29), (3.01, 29), (NAN, 0), (0.3, 0)])
def test_clear_and_silent_sectors(given: float, free: int) -> None:
    """Beyond the longest range: clear up to it. Too near, or NaN: nothing is said."""
    grid = OccupancyGrid(GridGeometry(0.1, 0.0, 0.0, 1, 40))
    grid.integrate(Pose(0.05, 0.05, math.pi / 2), scan(given, shortest=0.5, longest=2.96), MODEL)
    assert int((grid.cells.log_odds < 0.0).sum()) == (30 if free else 0)
    assert not (grid.cells.log_odds > 0.0).any()


def test_a_wide_sector_equals_table_9_2_away_from_its_edges() -> None:
    """Inverse_range_sensor_model looks at each cell's middle; cells whose corners straddle an edge may differ."""
    grid = OccupancyGrid(GridGeometry(0.1, -3.0, -3.0, 60, 60))
    pose, width, distance = Pose(0.31, -0.22, 0.7), 0.5, 2.0
    bearings = np.array([-1.5, 0.4])
    grid.integrate(pose, RangeSectors.of(bearings, [distance, distance], 2.5, width=width), MODEL)
    north, east = grid.geometry.centres()
    n, e = north[:, None] - pose.north, east[None, :] - pose.east
    r = np.hypot(n, e)
    away = np.abs(
        np.remainder(np.arctan2(e, n) - pose.heading - bearings[:, None, None] + math.pi, 2 * math.pi)
    )
    within = (np.abs(away - math.pi) - 0.5 * width).min(axis=0) * r  # metres from the nearest sector's edge
    half, margin = 0.5 * MODEL.thickness, 0.1 / math.sqrt(2.0)
    seen = np.where(r < distance - half, -1, np.where(r < distance + half, 1, 0))
    seen[within > 0.0] = 0
    edges = [np.abs(within), np.abs(r - distance + half), np.abs(r - distance - half)]
    clear_cut = np.min(edges, axis=0) > margin
    got = np.sign(grid.cells.log_odds).astype(int)
    assert (got == seen)[clear_cut].all()
    assert clear_cut.sum() > 3000
    assert {(-1), 0} <= set(seen[clear_cut].tolist())
    ring = (np.abs(r - distance) < 0.03) & (within < -margin)
    assert (got[ring] == 1).all()
    assert ring.sum() > 5


def test_one_scan_is_one_measurement_of_a_cell() -> None:
    """Near the sensor hundreds of rays crowd a cell."""
    grid = OccupancyGrid(GridGeometry(0.1, -3.0, -3.0, 60, 60), limit=math.inf)
    grid.integrate(Pose(0.05, 0.05, 0.0), scan(*[2.0] * 360), MODEL)
    changed = np.unique(grid.cells.log_odds)
    np.testing.assert_allclose(changed, [log_odds(0.3), 0.0, log_odds(0.8)], atol=1e-12)


def test_scans_add_up_as_table_4_2_and_stop_at_the_limit() -> None:
    grid = OccupancyGrid(GridGeometry(0.1, 0.0, 0.0, 1, 30), prior=0.2, limit=5.0)
    start = float(log_odds(0.2))
    for count in range(1, 30):
        grid.integrate(Pose(0.05, 0.05, math.pi / 2), scan(1.0), MODEL)
        each = float(log_odds(0.8)) - start
        assert grid.cells.log_odds[0, 10] == pytest.approx(min(5.0, start + count * each))
        each = float(log_odds(0.3)) - start
        assert grid.cells.log_odds[0, 2] == pytest.approx(min(5.0, start + count * each))
        assert grid.cells.log_odds[0, 20] == pytest.approx(start)


def test_a_scan_from_elsewhere_changes_nothing() -> None:
    grid = OccupancyGrid(GridGeometry(0.1, 0.0, 0.0, 5, 5))
    grid.integrate(Pose(50.0, 50.0, 0.0), scan(1.0, 2.0, math.inf, width=0.3), MODEL)
    grid.integrate(Pose(0.2, 0.2, 0.0), scan(NAN), MODEL)
    assert not grid.cells.log_odds.any()


def room() -> OccupancyGrid:
    walls = np.zeros((60, 80))
    walls[0] = walls[-1] = 1.0
    walls[:, 0] = walls[:, -1] = 1.0
    walls[25:35, 40] = 1.0
    return OccupancyGrid.from_probability(0.1, -3.0, 0.0, walls)


def test_expected_ranges_of_a_room_in_closed_form() -> None:
    """From the middle to the walls' inner faces; a pillar's edge; and nothing within reach."""
    grid = room()
    ranges = grid.expected_ranges([0.0, 2.0, 0.0], [0.0, math.pi / 2, math.pi, -math.pi / 2], 5.0)
    np.testing.assert_allclose(ranges, [2.9, 2.0, 2.9, 1.9], atol=1e-12)
    assert grid.expected_ranges([0.0, 2.0, 0.0], [0.1], 1.0).tolist() == [math.inf]
    several = grid.expected_ranges(np.full((2, 3, 3), (1.0, 2.0, 0.5)), [0.0, 1.0], 9.0)
    assert several.shape == (2, 3, 2)
    assert np.ptp(several.reshape(6, 2), axis=0).max() == 0.0
    assert grid.expected_ranges([0.0, 2.0, 0.0], [], 5.0).shape == (0,)


def test_a_wide_sector_sees_the_nearest_thing_in_it() -> None:
    grid, pose = room(), [0.0, 2.0, 0.0]
    width = 0.4
    fine = np.linspace(-0.5 * width, 0.5 * width, 401)
    for bearing in np.linspace(-3.0, 3.0, 25):
        wide = float(grid.expected_ranges(pose, [bearing], 9.0, width=width)[0])
        assert wide == pytest.approx(grid.expected_ranges(pose, bearing + fine, 9.0).min(), abs=0.1)


def test_a_sector_as_long_as_the_earth_is_round_is_cast_all_the_same() -> None:
    ranges = room().expected_ranges([0.0, 2.0, 0.0], [0.0], 4e7, width=6.0)
    np.testing.assert_allclose(ranges, [1.9], atol=1e-3)


def test_a_known_map_as_a_belief() -> None:
    grid = OccupancyGrid.from_probability(0.1, 1.0, 2.0, [[0.0, NAN, 1.0, 0.6]], limit=4.0)
    np.testing.assert_allclose(grid.cells.log_odds, [[-4.0, 0.0, 4.0, log_odds(0.6)]])
    assert grid.blocked().tolist() == [[False, False, True, True]]
    assert grid.blocked(0.9).tolist() == [[False, False, True, False]]
    np.testing.assert_allclose(grid.occupancy[0, 3], 0.6)


def test_a_building_is_mapped_from_noisy_scans() -> None:
    """Of the cells that were seen, 97 in 100 come out as they are, and so do 95 in 100 of the wall's.

    The wall's face lies in the middle of its cells. Ranges have a sigma of 2 cm, and one in twenty is anything;
    fixed seed.
    """
    rng = np.random.default_rng(6)
    truth, model = room(), InverseRangeModel(thickness=0.06)
    grid = OccupancyGrid(truth.geometry)
    bearings = np.linspace(-math.pi, math.pi, 180, endpoint=False)
    for east in np.linspace(0.5, 7.5, 30):
        pose = Pose(1.5 * math.sin(east), east, rng.uniform(-math.pi, math.pi))
        ranges = truth.expected_ranges(pose, bearings, 6.0) + rng.normal(0.05, 0.02, bearings.size)
        liar = rng.random(bearings.size) < 0.05
        ranges[liar] = rng.uniform(0.2, 6.0, int(liar.sum()))
        grid.integrate(pose, RangeSectors.of(bearings, np.maximum(ranges, 0.0), 6.0, shortest=0.1), model)
    known = np.abs(grid.cells.log_odds) > 1.0
    assert known.mean() > 0.9
    assert (grid.blocked() == truth.blocked())[known].mean() > 0.97
    assert grid.blocked()[truth.blocked() & known].mean() > 0.95


@pytest.mark.parametrize(
    ("make", "what"),
    [
        (lambda: GridGeometry(0.0, 0.0, 0.0, 1, 1), "resolution"),
        (lambda: GridGeometry(0.1, NAN, 0.0, 1, 1), "corner"),
        (lambda: GridGeometry(0.1, 0.0, 0.0, 1, 0), "cells"),
        (lambda: GridGeometry(0.1, 0.0, 0.0, 1 << 20, 1 << 20), "cells"),
        (lambda: InverseRangeModel(occupied=0.5), "0.5 < occupied"),
        (lambda: InverseRangeModel(free=0.0), "0 < free"),
        (lambda: InverseRangeModel(thickness=-0.1), "thickness"),
        (lambda: OccupancyGrid.from_probability(0.1, 0.0, 0.0, [0.5]), "two dimensions"),
        (lambda: OccupancyGrid.from_probability(0.1, 0.0, 0.0, [[1.5]]), "probabilities"),
        (lambda: room().expected_ranges([0.0, NAN, 0.0], [0.0], 5.0), "finite"),
        (lambda: room().expected_ranges([0.0, 0.0], [0.0], 5.0), "3 numbers"),
        (lambda: RangeSectors.of([0.0], [1.0, 2.0], 5.0), "one length"),
        (lambda: RangeSectors.of([0.0], [1.0], 5.0, width=[0.1, 0.1]), "width"),
        (lambda: RangeSectors.of([NAN], [1.0], 5.0), "bearings"),
        (lambda: RangeSectors.of([0.0], [1.0], 5.0, width=7.0), "widths"),
        (lambda: RangeSectors.of([0.0], [-1.0], 5.0), "negative"),
        (lambda: RangeSectors.of([0.0], [1.0], 5.0, shortest=6.0), "shortest"),
        (lambda: RangeSectors.of([0.0], [1.0], math.inf), "longest"),
    ],
)
def test_what_makes_no_sense_is_refused(make: Callable[[], object], what: str) -> None:
    with pytest.raises(ValueError, match=what):
        make()


def test_a_pose_that_is_not_finite_harms_nothing() -> None:
    grid = room()
    before = grid.cells.log_odds.copy()
    with pytest.raises(ValueError, match="finite"):
        grid.integrate(Pose(0.0, NAN, 0.0), scan(1.0), MODEL)
    np.testing.assert_array_equal(grid.cells.log_odds, before)
