"""How many places a particle set holds, against sets whose number of places is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from filters.hypotheses import APART
from filters.modes import Modes

COUNT = 3_000
Columns = NDArray[np.float32]


def place(
    random: np.random.Generator, count: int, middle: tuple[float, float, float], sigma: float
) -> Columns:
    rows = np.array(middle)[:, np.newaxis] + random.normal(size=(3, count)) * [[sigma], [sigma], [0.1]]
    return np.ascontiguousarray(rows.astype(np.float32))


def look(modes: Modes, columns: Columns, weights: Columns | None = None) -> int:
    count = len(columns[0])
    equal = np.ones(count, np.float32) if weights is None else weights
    return modes.look(columns, equal, np.zeros(count, np.int32), count, np.ones(1, np.float32), APART)


def test_one_gaussian_is_one_place() -> None:
    """False alarms: 1 in 150 sets at most, of any proportions and any direction."""
    alarms = 0
    for seed in range(150):
        random = np.random.default_rng(seed)
        columns = place(random, COUNT, (3.0, -2.0, 0.5), 1.0)
        columns[0] *= random.uniform(1.0, 20.0)
        angle = random.uniform(-math.pi, math.pi)
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        columns[:2] = (turn @ columns[:2]).astype(np.float32)
        alarms += look(Modes(0.5), columns) != 1
    assert alarms <= 1


@pytest.mark.parametrize("shape", ["ring", "arc", "square"])
def test_bent_and_flat_shapes_are_one_place(shape: str) -> None:
    """No valley, no second place: at most 1 of 20 sets each."""
    alarms = 0
    for seed in range(20):
        random = np.random.default_rng(seed)
        angle = random.uniform(-math.pi, math.pi if shape == "ring" else 0.5, COUNT)
        length = random.normal(30.0, 0.5, COUNT)
        rows = [length * np.cos(angle), length * np.sin(angle)]
        if shape == "square":
            rows = list(random.uniform(-20.0, 20.0, (2, COUNT)))
        heading = random.normal(0.0, 0.1, COUNT)
        alarms += look(Modes(0.5), np.stack([*rows, heading]).astype(np.float32)) != 1
    assert alarms <= 1


@pytest.mark.parametrize("share", [0.5, 0.1])
def test_two_places_are_found_with_their_shares(share: float) -> None:
    """Of a fair sub-sample of 1,024: five standard deviations of a share of 1,024 are 0.08."""
    for seed in range(20):
        random = np.random.default_rng(seed)
        second = int(share * COUNT)
        columns = np.concatenate(
            [
                place(random, COUNT - second, (0.0, 0.0, 0.0), 1.0),
                place(random, second, (9.0, 6.0, 0.0), 1.0),
            ],
            axis=1,
        )
        modes = Modes(0.5)
        assert look(modes, columns) == 2
        assert sorted(modes.masses[:2]) == pytest.approx(sorted([share, 1.0 - share]), abs=0.08)


def test_weights_count_not_particles() -> None:
    """A place whose particles have no weight is none."""
    random = np.random.default_rng(5)
    columns = np.concatenate(
        [place(random, 1_500, (0.0, 0.0, 0.0), 1.0), place(random, 1_500, (30.0, 0.0, 0.0), 1.0)], axis=1
    )
    weights = np.ones(3_000, np.float32)
    assert look(Modes(0.5), columns, weights) == 2
    weights[1_500:] = 1e-6
    assert look(Modes(0.5), columns, weights) == 1


def test_headings_are_asked_where_the_position_is_one() -> None:
    """Forward or backward at one place: two; the seam of the circle is none."""
    random = np.random.default_rng(6)
    for first in (0.0, math.pi - 0.05, -2.0):
        columns = np.concatenate(
            [
                place(random, 1_500, (0.0, 0.0, first), 1.0),
                place(random, 1_500, (0.0, 0.0, first + math.pi), 1.0),
            ],
            axis=1,
        )
        columns[2] = np.remainder(columns[2] + math.pi, 2.0 * math.pi) - math.pi
        modes = Modes(0.5)
        assert look(modes, columns) == 2
        labels = np.zeros(3_000, np.int32)
        modes.relabel(columns, labels, 3_000, 0, np.array([1, 2], np.int32))
        assert _agree(labels, 1_500) >= 0.99


def test_places_nearer_than_the_resolution_are_one() -> None:
    random = np.random.default_rng(7)
    columns = np.concatenate(
        [place(random, 1_500, (0.0, 0.0, 0.0), 0.05), place(random, 1_500, (0.5, 0.0, 0.0), 0.05)], axis=1
    )
    assert look(Modes(0.05), columns) == 2
    assert look(Modes(5.0), columns) == 1


def test_each_particle_gets_the_label_of_its_own_place() -> None:
    """Against where each was drawn: the places lie 12 deviations apart."""
    random = np.random.default_rng(8)
    columns = np.concatenate(
        [place(random, 2_000, (100.0, 50.0, 1.0), 1.0), place(random, 1_000, (112.0, 50.0, 1.0), 1.0)], axis=1
    )
    modes = Modes(0.5)
    assert look(modes, columns) == 2
    labels = np.zeros(3_000, np.int32)
    modes.relabel(columns, labels, 3_000, 0, np.array([4, 5], np.int32))
    assert set(labels.tolist()) == {4, 5}
    assert _agree(labels, 2_000) >= 0.99


def test_only_labels_that_are_asked_count() -> None:
    random = np.random.default_rng(9)
    columns = np.concatenate(
        [place(random, 1_500, (0.0, 0.0, 0.0), 1.0), place(random, 1_500, (30.0, 0.0, 0.0), 1.0)], axis=1
    )
    labels = np.repeat(np.array([0, 1], np.int32), 1_500)
    weights = np.ones(3_000, np.float32)
    modes = Modes(0.5)
    assert modes.look(columns, weights, labels, 3_000, np.ones(2, np.float32), APART) == 2
    only_one = np.array([0.0, 1.0], np.float32)
    assert modes.look(columns, weights, labels, 3_000, only_one, APART) == 1
    assert modes.look(columns, weights, labels, 3_000, np.zeros(2, np.float32), APART) == 1


@pytest.mark.parametrize(("resolution", "sample", "most"), [(0.0, 1, 1), (1.0, 0, 1), (1.0, 1, 0)])
def test_refuses_parameters_that_are_not_positive(resolution: float, sample: int, most: int) -> None:
    with pytest.raises(ValueError, match="must be positive"):
        Modes(resolution, sample=sample, most=most)


def _agree(labels: NDArray[np.int32], first: int) -> float:
    """Return the share of particles on their own side, whichever name it got."""
    mine = labels[:first] == np.bincount(labels[:first]).argmax()
    other = labels[first:] == np.bincount(labels[first:]).argmax()
    return float((mine.sum() + other.sum()) / labels.size)
