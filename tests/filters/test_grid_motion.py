"""Motion on a grid against the dense matrix of equation 4.5, and against the integrals of equation 4.9."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, stats

from filters.cells import CellIntegral, CellMean
from filters.grid import Axis, Grid, circle
from filters.grid_motion import GridMotion

Columns = Sequence[np.ndarray]
GRID = Grid([Axis(-3.0, 3.0, 7), Axis(0.0, 4.0, 6), circle(5)])
SIGMA = np.array([0.7, 0.5, 0.6])


def unicycle(states: Columns) -> list[np.ndarray]:
    north, east, heading = states
    return [north + 0.9 * np.cos(heading), east + 0.9 * np.sin(heading), heading + 0.8]


def entangled(states: Columns) -> list[np.ndarray]:
    """Every axis steers every other: no order of the axes serves."""
    north, east, heading = states
    return [north + 0.3 * east, east - 0.2 * north + np.cos(heading), heading + 0.1 * north]


def spelled_out(states: Columns) -> list[np.ndarray]:
    """The unicycle, with columns that no longer show on what they depend."""
    shape = np.broadcast_shapes(*(state.shape for state in states))
    return [np.broadcast_to(column, shape).copy() for column in unicycle(states)]


def along(axis: Axis, mean: float, sigma: float) -> tuple[np.ndarray, float]:
    """Equation 4.5 along one axis by brute force over an endless lattice: shares, and what lies beyond."""
    reach = math.ceil((abs(mean - axis.low) + axis.high - axis.low + 9.0 * sigma) / axis.width)
    lattice = np.arange(-reach, reach + axis.cells)
    density = stats.norm.pdf(axis.low + (lattice + 0.5) * axis.width, mean, sigma)
    density /= density.sum()
    shares = np.zeros(axis.cells)
    for place, share in zip(lattice, density, strict=True):
        if axis.wraps or 0 <= place < axis.cells:
            shares[place % axis.cells] += share
    return shares, 1.0 - shares.sum()


def brute_force(grid: Grid, move: object, sigma: np.ndarray, belief: np.ndarray) -> np.ndarray:
    target = np.zeros(grid.shape)
    for cell in range(grid.size):
        state = grid.states_at(np.array([cell]))
        means = [float(column[0]) for column in move(state)]
        shares = [along(axis, m, s)[0] for axis, m, s in zip(grid.axes, means, sigma, strict=True)]
        target += belief.reshape(-1)[cell] * np.einsum("i,j,k->ijk", *shares)
    return target


@pytest.mark.interpreted
@pytest.mark.parametrize("move", [unicycle, entangled, spelled_out])
def test_it_equals_the_dense_matrix(move: object) -> None:
    belief = np.random.default_rng(1).dirichlet(np.ones(GRID.size)).reshape(GRID.shape)
    target, departed = GridMotion(GRID, CellMean()).carry(belief, np.arange(GRID.size), move, SIGMA)
    exact = brute_force(GRID, move, SIGMA, belief)
    np.testing.assert_allclose(target, exact, atol=1e-12)
    assert departed == pytest.approx(1.0 - exact.sum(), abs=1e-11)
    assert departed > 0.1


@pytest.mark.interpreted
def test_axis_by_axis_is_the_same_as_cell_by_cell() -> None:
    belief = np.random.default_rng(2).dirichlet(np.ones(GRID.size)).reshape(GRID.shape)
    motion, every = GridMotion(GRID, CellMean()), np.arange(GRID.size)
    one, left = motion.carry(belief, every, unicycle, SIGMA)
    other, departed = motion.carry(belief, every, spelled_out, SIGMA)
    np.testing.assert_allclose(one, other, atol=1e-15)
    assert left == pytest.approx(departed, abs=1e-14)


@pytest.mark.parametrize("cells", [CellMean(), CellIntegral(3)])
@pytest.mark.parametrize("move", [unicycle, spelled_out])
def test_what_is_not_chosen_stays(cells: CellMean | CellIntegral, move: object) -> None:
    belief = np.random.default_rng(3).dirichlet(np.ones(GRID.size)).reshape(GRID.shape)
    chosen = np.arange(0, GRID.size, 2)
    motion = GridMotion(GRID, cells)
    target, _ = motion.carry(belief, chosen, move, SIGMA)
    moving = np.zeros(GRID.size)
    moving[chosen] = belief.reshape(-1)[chosen]
    moving = moving.reshape(GRID.shape)
    alone, _ = motion.carry(moving, np.arange(GRID.size), move, SIGMA)
    np.testing.assert_allclose(target, alone + (belief - moving), atol=1e-14)


@pytest.mark.interpreted
def test_the_integral_over_source_and_target_cell_equals_quadrature() -> None:
    """Equation 4.9 for a motion that bends, to 1e-9, by scipy's quad over the source cell."""
    axis, sigma = Axis(-2.0, 2.0, 8), 0.3
    motion = GridMotion(Grid([axis]), CellIntegral(10))
    for source in (0, 3, 6):
        belief = np.zeros(8)
        belief[source] = 1.0
        target, _ = motion.carry(
            belief, np.array([source]), lambda states: [states[0] + 0.4 * np.sin(2.0 * states[0])], [sigma]
        )
        low = axis.low + source * axis.width
        for cell in range(8):
            a, b = axis.low + cell * axis.width, axis.low + (cell + 1) * axis.width

            def reached(x: float, a: float = a, b: float = b) -> float:
                mean = x + 0.4 * math.sin(2.0 * x)
                return float(stats.norm.cdf(b, mean, sigma) - stats.norm.cdf(a, mean, sigma))

            exact = integrate.quad(reached, low, low + axis.width, epsabs=1e-12)[0] / axis.width
            assert target[cell] == pytest.approx(exact, abs=1e-9)


@pytest.mark.interpreted
def test_without_noise_a_cell_moves_as_one() -> None:
    grid = Grid([Axis(0.0, 5.0, 5), circle(4)])
    belief = np.zeros((5, 4))
    belief[1, 3] = 1.0
    target, departed = GridMotion(grid, CellMean()).carry(
        belief, np.arange(20), lambda s: [s[0] + 2.2, s[1] + math.pi / 2.0], [0.0, 0.0]
    )
    assert target[3, 0] == 1.0
    assert departed == 0.0


numbers = st.floats(-20.0, 20.0)


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(numbers, numbers, numbers),
    st.tuples(*[st.floats(0.0, 3.0)] * 3),
    st.integers(0, 2**31),
    st.sampled_from([CellMean(), CellIntegral(2)]),
)
def test_probability_is_conserved(
    steps: tuple[float, ...], sigma: tuple[float, ...], seed: int, cells: CellMean | CellIntegral
) -> None:
    """What stays and what departs sum to one, to 1e-12."""
    belief = np.random.default_rng(seed).dirichlet(np.full(GRID.size, 0.1)).reshape(GRID.shape)

    def move(states: Columns) -> list[np.ndarray]:
        return [column + step * np.cos(states[2]) for column, step in zip(states, steps, strict=True)]

    target, departed = GridMotion(GRID, cells).carry(belief, np.arange(GRID.size), move, sigma)
    assert target.min() >= 0.0
    assert 0.0 <= departed <= 1.0 + 1e-12
    assert target.sum() + departed == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("dimension", [1, 2, 3, 4])
def test_up_to_four_dimensions(dimension: int) -> None:
    """A shift by whole cells, with noise, is a product of binned Gaussians."""
    grid = Grid([Axis(0.0, 5.0, 5)] * dimension)
    belief = np.zeros(grid.shape)
    belief[(1,) * dimension] = 1.0
    motion = GridMotion(grid, CellIntegral(1))
    target, _ = motion.carry(
        belief, np.flatnonzero(belief), lambda s: [x + 1.0 for x in s], [0.4] * dimension
    )
    single = np.diff(stats.norm.cdf(np.arange(6), 2.5, 0.4))
    for cell in product(range(5), repeat=dimension):
        assert target[cell] == pytest.approx(math.prod(single[k] for k in cell), abs=1e-11)


@pytest.mark.parametrize(
    ("move", "sigma", "message"),
    [
        (unicycle, [0.1, 0.1], "sigma"),
        (unicycle, [0.1, -0.1, 0.1], "sigma"),
        (unicycle, [0.1, math.nan, 0.1], "sigma"),
        (lambda s: s[:2], SIGMA, "3 columns"),
        (lambda s: [np.full_like(x, math.nan) for x in s], SIGMA, "finite"),
        (lambda s: [np.zeros((9, 9, 9))] * 3, SIGMA, "columns of"),
        (lambda s: [np.zeros((2, 7, 6, 5))] * 3, SIGMA, "columns of"),
    ],
)
def test_a_motion_that_makes_no_sense_is_refused(move: object, sigma: object, message: str) -> None:
    belief = np.full(GRID.shape, 1.0 / GRID.size)
    with pytest.raises(ValueError, match=message):
        GridMotion(GRID, CellMean()).carry(belief, np.arange(GRID.size), move, sigma)
