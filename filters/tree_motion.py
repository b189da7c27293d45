"""How the leaves of a density tree are carried by a motion: as boxes, stretched and blurred."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from filters.grid import Array
from filters.grid_motion import Move
from filters.kernels import density_tree as kernels
from filters.tree_nodes import Sides, TreeNodes

ROUNDS = 12
"""How often a leaf may be halved before it is carried."""


def carried(
    sides: Sides, boxes: tuple[Array, Array, Array], move: Move, sigma: ArrayLike, bound: float
) -> TreeNodes:
    """Grow the tree of boxes carried by a motion with Gaussian noise.

    Parameters
    ----------
    boxes : lower corners, upper corners, masses
        (n, dimension), (n, dimension) and (n,).

    Returns
    -------
    TreeNodes
        The root's mass is what remains inside; the leaves' sum to it, but for rounding.

    Raises
    ------
    ValueError
        A sigma negative or not finite, or a motion that gives another shape or a number that is not finite.
    """
    sigmas = np.array(sigma, np.float64, ndmin=1)
    if sigmas.shape != (sides.dimension,) or not np.isfinite(sigmas).all() or (sigmas < 0.0).any():
        raise ValueError(
            f"tree motion: sigma must be {sides.dimension} finite numbers, not negative, got {sigmas.tolist()}"
        )
    low, high, mass = boxes
    alive = mass > 0.0
    means, halves, masses = _parts(sides, low[alive], high[alive], mass[alive], move, sigmas)
    periods = np.where(sides.wraps, sides.periods, 0.0)
    means = sides.folded(means)
    capacity, arena, stack = 4 * masses.size + 1024, 64 * masses.size + 1024, 256
    while True:
        nodes = TreeNodes(
            np.empty((capacity, sides.dimension)),
            np.empty((capacity, sides.dimension)),
            np.full(capacity, -1, np.int64),
            np.zeros(capacity, np.int64),
            np.zeros(capacity),
        )
        nodes.low[0], nodes.high[0] = sides.low, sides.high
        count = kernels.grow(
            masses,
            means,
            halves,
            sigmas,
            periods,
            sides.finest,
            sides.coarsest,
            bound,
            *nodes,
            np.empty((stack, 3), np.int64),
            np.empty(arena, np.int64),
            np.empty((arena, sides.dimension)),
            np.empty((arena, sides.dimension)),
            np.empty(arena),
        )
        if count > 0:
            low, high, axis, child, mass = nodes
            return TreeNodes(low[:count], high[:count], axis[:count], child[:count], mass[:count])
        if count == -1:
            capacity *= 2
        else:
            arena, stack = 2 * arena, 2 * stack


def _parts(
    sides: Sides, low: Array, high: Array, mass: Array, move: Move, sigmas: Array
) -> tuple[Array, Array, Array]:
    """Return moved centres, moved half widths and masses of the boxes, halved where the motion bends them.

    A box is halved along the axis over which the other coordinates are displaced most differently, as long
    as they differ by more than the noise, the finest width and a quarter of the box itself. Its two halves are
    looked at apart, and nothing wider than 0.4 turns is carried whole: a cosine is the same at both ends of one.
    """
    done: list[tuple[Array, Array, Array]] = []
    for round_ in range(ROUNDS + 1):
        centre, width = 0.5 * (low + high), high - low
        moved = _moved(sides, move, centre)
        halves, shear = np.empty_like(width), np.zeros_like(width)
        allowed = np.maximum(np.maximum(sigmas, sides.finest), 0.25 * width)
        for k in range(sides.dimension):
            step = np.zeros_like(width)
            step[:, k] = 0.5 * width[:, k]
            upper, lower = (
                _moved(sides, move, centre + step) - moved,
                moved - _moved(sides, move, centre - step),
            )
            change, bend = upper + lower, np.abs(upper) + np.abs(lower)
            halves[:, k] = 0.5 * np.abs(width[:, k] + change[:, k])
            bend[:, k] = 0.0
            shear[:, k] = (bend / allowed).max(axis=1)
            shear[width[:, k] > 0.4 * sides.periods[k], k] = np.inf
        halves = np.maximum(halves, 1e-9 * sides.finest)
        along = np.where(shear.max(axis=1) > 1.0, shear.argmax(axis=1), -1)
        if round_ == ROUNDS:
            along[:] = -1
        whole = along < 0
        done.append(((centre + moved)[whole], halves[whole], mass[whole]))
        if whole.all():
            break
        rows, along = np.flatnonzero(~whole), along[~whole]
        low, high, mass = low[rows], high[rows], 0.5 * mass[rows]
        middle = 0.5 * (low + high)[np.arange(rows.size), along]
        upper, lower = high.copy(), low.copy()
        upper[np.arange(rows.size), along] = middle
        lower[np.arange(rows.size), along] = middle
        low, high, mass = np.concatenate([low, lower]), np.concatenate([upper, high]), np.tile(mass, 2)
    means, halves, masses = (np.concatenate(column) for column in zip(*done, strict=True))
    return np.ascontiguousarray(means), np.ascontiguousarray(halves), masses


def _moved(sides: Sides, move: Move, states: Array) -> Array:
    """Return how far states are moved, (n, dimension), the shortest way round where it wraps."""
    columns = [np.asarray(column, np.float64) for column in move(list(states.T))]
    if len(columns) != sides.dimension:
        raise ValueError(f"tree motion: {sides.dimension} columns are needed, got {len(columns)}")
    if any(column.shape not in ((), (1,), (len(states),)) for column in columns):
        shapes = [column.shape for column in columns]
        raise ValueError(f"tree motion: columns of ({len(states)},) are needed, got {shapes}")
    step = np.column_stack([np.broadcast_to(column, (len(states),)) for column in columns]) - states
    if not np.isfinite(step).all():
        raise ValueError("tree motion: every state must move to a finite one, got NaN or infinity")
    for k in np.flatnonzero(sides.wraps):
        step[:, k] -= sides.periods[k] * np.round(step[:, k] / sides.periods[k])
    return step
