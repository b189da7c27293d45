"""Who does the work on a particle set's blocks: one thread, or several that the caller lends.

A filter starts no thread. It divides its particles into blocks that do not depend on who works on them, takes its
random numbers from counters, and adds the blocks' sums in order; so a crew makes it faster and changes no bit.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from filters.kernels.resampling import block_sizes

ALIGNMENT = 256
"""Particles: a division elsewhere could put one into a loop's remainder that was in its vector part."""


class Crew(Protocol):
    """The named requirement of a crew of threads.

    Attributes
    ----------
    threads : int
        How many work, the caller's among them.
    fewest : int
        Particles below which its coming and going costs more than it helps: the filter works alone then.
    """

    @property
    def threads(self) -> int:
        """How many work, the caller's among them."""
        ...

    @property
    def fewest(self) -> int:
        """Particles from which it is worth calling."""
        ...

    def run(self, task: Callable[[int], None]) -> None:
        """Call ``task`` with every number below ``threads``, each on a thread of its own; return when all are done.

        Raises
        ------
        Exception
            What a task raised.
        """
        ...


class Blocks:
    """The division of a particle set into blocks.

    Parameters
    ----------
    largest : int
        Most particles of a block.
    crew : Crew, optional
        Who works on them; without one the caller's thread does all.

    Attributes
    ----------
    bounds : (number + 1,) int64
        Block b lies from ``bounds[b]`` to ``bounds[b + 1]``.
    pairs : list of (int, int)
        The same as plain numbers.
    pieces : list of (n, 2) int64
        First and last of the blocks and parts of blocks that each thread moves, as many particles as any other; of all
        blocks where one thread does all.
    """

    def __init__(self, largest: int, crew: Crew | None = None) -> None:
        self._largest = largest
        self._crew = crew
        self.bounds: NDArray[np.int64] = np.zeros(1, np.int64)
        self.pairs: list[tuple[int, int]] = []
        self.pieces: list[NDArray[np.int64]] = []
        self.shared = False

    def most(self, capacity: int) -> int:
        """How many blocks there can be of that many particles."""
        return len(block_sizes(capacity, self._largest))

    def divide(self, count: int) -> None:
        """Divide ``count`` particles."""
        ends = np.cumsum([0, *block_sizes(count, self._largest)])
        self.bounds = ends.astype(np.int64)
        self.pairs = list(zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True))
        self.shared = self._crew is not None and count >= max(
            self._crew.fewest, self._crew.threads * ALIGNMENT
        )
        self.pieces = self._divided(count) if self.shared else [np.array(self.pairs)]

    def _divided(self, count: int) -> list[NDArray[np.int64]]:
        """Divide the blocks among the threads, cutting them at multiples of the alignment from their beginnings."""
        threads = self.threads
        pieces: list[list[tuple[int, int]]] = [[] for _ in range(threads)]
        for first, last in self.pairs:
            cuts = [first]
            for part in range(1, threads):
                wanted = count * part // threads - first
                cuts.append(min(max(first + wanted // ALIGNMENT * ALIGNMENT, cuts[-1]), last))
            for part, (start, end) in enumerate(pairwise([*cuts, last])):
                if start < end:
                    pieces[part].append((start, end))
        return [np.array(piece, np.int64).reshape(-1, 2) for piece in pieces]

    def share_pieces(self, task: Callable[[int], None]) -> None:
        """Call ``task(part)`` for every thread, which works on its :attr:`pieces`."""
        assert self._crew is not None
        self._crew.run(task)

    @property
    def number(self) -> int:
        """How many there are."""
        return len(self.pairs)

    @property
    def threads(self) -> int:
        """How many threads there are to share the work."""
        return 1 if self._crew is None else self._crew.threads

    def share(self, task: Callable[[int, int, int], None]) -> None:
        """Call ``task(part, first_block, last_block)`` for contiguous parts of the blocks."""
        self.split(self.number, 1, task)

    def split(self, size: int, grain: int, task: Callable[[int, int, int], None]) -> None:
        """Call ``task(part, first, last)`` for contiguous parts of 0 to ``size``, divided at multiples of ``grain``."""
        if self._crew is None or not self.shared:
            task(0, 0, size)
            return
        threads = self._crew.threads
        ends = [size * part // threads // grain * grain for part in range(threads)] + [size]
        self._crew.run(lambda part: task(part, ends[part], ends[part + 1]))
