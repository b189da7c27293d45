"""The five densities of one cloud, as they go out."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from service.density import EXTRACTORS, extract
from service.estimate import Density
from service.publish import densities

rng = np.random.default_rng(5)
ROWS: NDArray[np.float64] = np.stack(
    [rng.normal(2.0, 1.0, 800), rng.normal(-3.0, 2.0, 800), rng.normal(0.5, 0.1, 800), rng.random(800)],
    axis=1,
)


def test_those_that_can_be_asked_for_are_those_that_are_there() -> None:
    assert tuple(EXTRACTORS) == densities.EXTRACTORS


@pytest.mark.parametrize("extractor", list(EXTRACTORS))
def test_its_moments_are_the_cloud_s(extractor: str) -> None:
    """Means within 0.2 m of numpy's weighted average; a tree's boxes are wide, and blur by as much."""
    found = extract(extractor, ROWS, 12.5)
    size = len(found.columns)
    assert found.columns == ["north", "east", "heading"][:size]
    assert (found.extractor, found.time, found.particles) == (extractor, 12.5, 800)
    expected = np.average(ROWS[:, :size], axis=0, weights=ROWS[:, 3])
    np.testing.assert_allclose(found.mean, expected, atol=0.2)
    variances = np.average((ROWS[:, :2] - expected[:2]) ** 2, axis=0, weights=ROWS[:, 3])
    np.testing.assert_allclose(np.diag(found.covariance)[:2], variances, rtol=0.5)


@pytest.mark.parametrize("extractor", ["histogram", "tree", "kernel"])
def test_its_cells_hold_all_of_it(extractor: str) -> None:
    """The mass left of a line is the cloud's to within what one row of cells holds."""
    cells = extract(extractor, ROWS, 0.0).cells
    assert cells is not None
    assert sum(cell.mass for cell in cells) == pytest.approx(1.0, abs=0.01)
    below = sum(
        cell.mass * np.clip((2.0 - cell.north[0]) / (cell.north[1] - cell.north[0]), 0.0, 1.0)
        for cell in cells
    )
    expected = ROWS[ROWS[:, 0] < 2.0, 3].sum() / ROWS[:, 3].sum()
    assert below == pytest.approx(expected, abs=0.05)


def test_a_mixture_s_weights_sum_to_one() -> None:
    found: Density = extract("kmeans", ROWS, 0.0)
    assert found.components is not None
    assert sum(each.weight for each in found.components) == pytest.approx(1.0)
