"""Carrying the leaves of a tree: where its arrays must grow, and how finely a leaf is halved at most."""

from __future__ import annotations

import numpy as np
import pytest

from filters import tree_motion
from filters.tree_motion import carried
from filters.tree_nodes import Side, Sides

Boxes = tuple[np.ndarray, np.ndarray, np.ndarray]
ONE: Boxes = (np.array([[2.0]]), np.array([[3.0]]), np.ones(1))


def masses(sides: Sides, boxes: Boxes, sigma: float, bound: float) -> np.ndarray:
    nodes = carried(sides, boxes, lambda s: s, [sigma] * sides.dimension, bound)
    leaves = nodes.leaves
    assert nodes.mass[leaves].sum() == pytest.approx(nodes.mass[0], abs=1e-6)
    return nodes.mass[leaves]


@pytest.mark.interpreted
def test_more_nodes_than_there_was_room_for() -> None:
    """One box of a unit, cut to widths of 1/2048 m: some 4,096 nodes, where 1,028 are made room for."""
    leaves = masses(Sides([Side(0.0, 8.0, 1.0 / 2048.0)]), ONE, 0.0, 1e-4)
    inside = leaves[leaves > 0.0]
    assert inside.size == 2048
    np.testing.assert_allclose(inside, 1.0 / 2048.0, rtol=1e-9)


@pytest.mark.interpreted
def test_a_deeper_tree_than_there_was_room_for() -> None:
    """A needle in four dimensions of 2⁻⁷⁰: 280 cuts on the way down, where 256 are made room for."""
    sides = Sides([Side(0.0, 1.0, 2.0**-70)] * 4)
    corner = np.zeros((1, 4))
    leaves = masses(sides, (corner, corner + 2.0**-70, np.ones(1)), 0.0, 0.5)
    assert leaves.size == 281
    assert leaves.max() == pytest.approx(1.0, abs=1e-6)


@pytest.mark.interpreted
def test_sources_that_reach_everywhere() -> None:
    """Wide noise: each of 64 boxes reaches each of the leaves on the way down; their sum is kept all the same."""
    edges = np.linspace(0.0, 8.0, 65)[:, None]
    leaves = masses(Sides([Side(0.0, 8.0, 0.5)]), (edges[:-1], edges[1:], np.full(64, 1.0 / 64.0)), 4.0, 0.2)
    assert leaves.size == 8
    np.testing.assert_allclose(leaves, leaves[::-1], rtol=1e-9)


@pytest.mark.interpreted
@pytest.mark.parametrize("wave", [np.cos, np.sin])
def test_a_leaf_is_halved_until_the_motion_bends_it_no_more(wave: np.ufunc) -> None:
    """North goes by 8 cos(heading), or sin: the mean and variance over the whole turn are 0 and 32."""
    sides = Sides([Side(-16.0, 16.0, 0.25), Side(-np.pi, np.pi, 0.05, wraps=True)])
    box = (np.array([[-0.01, -np.pi]]), np.array([[0.01, np.pi]]), np.ones(1))
    nodes = carried(sides, box, lambda s: [s[0] + 8.0 * wave(s[1]), s[1]], [0.25, 0.01], 0.01)
    leaves = nodes.leaves
    middle = 0.5 * (nodes.low[leaves, 0] + nodes.high[leaves, 0])
    assert nodes.mass[leaves] @ middle == pytest.approx(0.0, abs=1e-6)
    assert nodes.mass[leaves] @ middle**2 == pytest.approx(32.0, rel=0.05)


def test_halving_ends_after_its_rounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without end it would take 17 rounds here; whatever it leaves whole, no probability is lost."""
    monkeypatch.setattr(tree_motion, "ROUNDS", 3)
    asked: list[int] = []

    def shear(states: list[np.ndarray]) -> list[np.ndarray]:
        asked.append(len(states[0]))
        return [states[0] + 1e5 * states[1], states[1]]

    sides = Sides([Side(-1e6, 1e6, 1.0), Side(-1.0, 1.0, 0.1)])
    box = (np.array([[-1.0, -1.0]]), np.array([[1.0, 1.0]]), np.ones(1))
    nodes = carried(sides, box, shear, [0.0, 0.0], 0.3)
    assert max(asked) == 2**3
    assert nodes.mass[0] == pytest.approx(1.0)
