"""Regions on a graph against the matrix exponential, and partitions of a grid by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import linalg

from filters.grid import Axis, Grid, circle
from filters.regions import Partition, RegionGraph, TopologicalFilter

GRAPH = RegionGraph(
    ("hall", "lab", "yard"), {("hall", "lab"): 4.0, ("hall", "yard"): 10.0, ("yard", "hall"): 20.0}
)
GRID = Grid([Axis(0.0, 4.0, 4), Axis(0.0, 3.0, 3), circle(2)])
LABELS = [[0, 0, -1], [0, 0, -1], [1, -1, -1], [1, 2, 2]]


def test_time_passes_as_the_matrix_exponential_says() -> None:
    generator = np.array([[0.0, 0.25, 0.1], [0.25, 0.0, 0.0], [0.05, 0.0, 0.0]])
    np.testing.assert_array_equal(GRAPH.rates, generator)
    generator -= np.diag(generator.sum(axis=1))
    belief = TopologicalFilter(GRAPH, [1.0, 0.0, 0.0])
    belief.predict(3.0)
    np.testing.assert_allclose(belief.belief, linalg.expm(3.0 * generator)[0], atol=1e-12)
    evidence = belief.update(np.log([0.1, 0.7, 0.2]))
    weighed = linalg.expm(3.0 * generator)[0] * [0.1, 0.7, 0.2]
    np.testing.assert_allclose(belief.belief, weighed / weighed.sum(), atol=1e-12)
    assert evidence == pytest.approx(math.log(weighed.sum()))
    assert belief.most_likely == "lab"


def test_a_partition_makes_the_graph_of_regions_that_touch() -> None:
    partition = Partition(GRID, LABELS, ("a", "b", "c"))
    np.testing.assert_allclose(partition.centroids, [[1.0, 1.0], [3.0, 0.5], [3.5, 2.0]])
    rates = partition.graph(speed=2.0).rates
    assert rates[0, 1] == pytest.approx(2.0 / math.hypot(2.0, 0.5))
    assert rates[1, 2] == rates[2, 1] == pytest.approx(2.0 / math.hypot(0.5, 1.5))
    assert rates[0, 2] == 0.0


def test_an_axis_that_wraps_joins_its_ends() -> None:
    labels = [0, 1, 2, 3]
    names = ("a", "b", "c", "d")
    closed = Partition(Grid([circle(4)]), labels, names).graph(1.0).rates
    opened = Partition(Grid([Axis(0.0, 4.0, 4)]), labels, names).graph(1.0).rates
    assert closed[0, 3] > 0.0
    assert opened[0, 3] == 0.0


def test_metric_and_topological_beliefs_turn_into_each_other() -> None:
    partition = Partition(GRID, LABELS, ("a", "b", "c"))
    metric = partition.spread([0.5, 0.3, 0.2])
    assert metric.shape == GRID.shape
    assert metric[0, 0, 1] == pytest.approx(0.5 / 8.0)
    assert metric[0, 2].tolist() == [0.0, 0.0]
    np.testing.assert_allclose(partition.masses(metric), [0.5, 0.3, 0.2])


@pytest.mark.parametrize(
    ("regions", "seconds"),
    [
        ((), {}),
        (("a", "a"), {}),
        (("a", "b"), {("a", "x"): 1.0}),
        (("a", "b"), {("a", "a"): 1.0}),
        (("a", "b"), {("a", "b"): 0.0}),
        (("a", "b"), {("a", "b"): math.nan}),
    ],
)
def test_a_graph_that_makes_no_sense_is_refused(
    regions: tuple[str, ...], seconds: dict[tuple[str, str], float]
) -> None:
    with pytest.raises(ValueError, match="region graph"):
        RegionGraph(regions, seconds)


@pytest.mark.parametrize(
    "labels", [[[0, 0], [1, 2]], [0, 1, 2, 3], [0, 1, 2, -2], [0.0, 1.0, 2.0, 2.0], [0, 1, 1, 1], 0]
)
def test_labels_that_make_no_sense_are_refused(labels: object) -> None:
    with pytest.raises(ValueError, match="partition"):
        Partition(GRID, labels, ("a", "b", "c"))


def test_a_speed_or_a_count_that_makes_no_sense_is_refused() -> None:
    partition = Partition(GRID, LABELS, ("a", "b", "c"))
    with pytest.raises(ValueError, match="speed"):
        partition.graph(0.0)
    with pytest.raises(ValueError, match="3 probabilities"):
        partition.spread([1.0])
