"""The hypotheses of a particle set: its modes, followed over time (density extraction, section 4.3.4).

Every particle has a label, the hypothesis that it belongs to. Particles move and are weighed as always and the labels
stay with them; who resamples lays the labels out with the copies
(:meth:`~filters.particle.ParticleFilter.resample_by_label`). So a hypothesis is the same one as long as any of its
particles lives, whatever its weight. A few times a second :meth:`Hypotheses.look` asks what has changed:

- a hypothesis whose own particles have several modes (:mod:`filters.modes`) is divided, if it has them twice in a row;
- two that have no valley between them any more, three times in a row, become one;
- one that the evidence has left without weight is dropped. What is left of its particles are *strays*: they are part
  of the belief, and of no hypothesis;
- strays that are worth it again are a hypothesis, with a new name.

A valley must be deeper to divide than to keep apart, so the count does not flicker.

The leader is the one that is spoken for. It stays so until another has four times its weight, for of two that are as
likely as each other the first should not change with every few measurements.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from filters.belief import STILL, Displacement
from filters.kernels import labelled as kernels
from filters.kernels.compile import Float32Array, Int32Array
from filters.labelled_moments import Hypothesis, LabelledMoments
from filters.modes import Depth, Modes

Array = NDArray[np.float64]

FOUND = 0.02
"""Least share of the belief's weight that a new hypothesis has."""
DROPPED = 1e-4
"""Share below which a hypothesis is dropped, if it stays there."""
GONE = 1e-6
"""Share below which strays are no more than the tail of the only hypothesis there is."""

DIVIDES = 2
"""Looks in a row that must find several modes."""
JOINS = 3
"""Looks in a row that must find none between two hypotheses."""
FADES = 10
"""Looks in a row that must find a hypothesis without weight."""

APART = Depth(ratio=0.25, significance=4.0, least=FOUND)
TOGETHER = Depth(ratio=0.7, significance=2.0, least=FOUND)
NEAR = 3.0
"""Bhattacharyya distance of two hypotheses as Gaussians above which no one need look for a valley between them."""

LEADS = 4.0
"""How many times the leader's weight another must have to lead."""
EVEN_PART = 0.5
"""Share of the particles of which every living hypothesis is given an equal part, at least."""


class Slot(NamedTuple):
    """A hypothesis and how many looks in a row found it divided, and faded."""

    name: int
    divided: int = 0
    faded: int = 0


class Hypotheses:
    """The labels of a particle set, and who they stand for.

    Parameters
    ----------
    capacity : int
        The largest number of particles there can be.
    dimension : int
        How many columns a particle has; the first three are north, east and heading.
    resolution : float
        Metres; places nearer to each other than about twice this are one.
    most : int
        Most hypotheses at one time.
    sample : int
        Most particles that one look takes in.

    Attributes
    ----------
    labels : (capacity,) int32
        Of each particle: below ``most`` that of a hypothesis, ``most`` of a stray.
    leader : int
        The name of the leading hypothesis. Names count from 1 and are never given twice.

    Raises
    ------
    ValueError
        A parameter that is not positive, or fewer than three columns.
    """

    def __init__(
        self, capacity: int, dimension: int, *, resolution: float = 1.0, most: int = 8, sample: int = 1024
    ) -> None:
        if capacity < 1 or dimension < 3:
            raise ValueError(
                f"hypotheses: a capacity and at least three columns are needed, got {capacity} and {dimension}"
            )
        self._most = most
        self._modes = Modes(resolution, sample=sample, most=most)
        self._moments = LabelledMoments(dimension, most + 1)
        self._sums = np.zeros(most + 1)
        self._factors: Float32Array = np.zeros(most + 1, np.float32)
        self._named = 0
        self._turn = 0
        self._slots: dict[int, Slot] = {}
        self._close: dict[tuple[int, int], int] = {}
        self._strays = False
        self.labels: Int32Array = np.zeros(capacity, np.int32)
        self.leader = 0
        self.restart()

    @property
    def count(self) -> int:
        """How many hypotheses there are."""
        return len(self._slots)

    @property
    def divided(self) -> bool:
        """Whether not all particles are of one hypothesis; if they are, the labels need not be looked at."""
        return len(self._slots) > 1 or self._strays

    @property
    def names(self) -> dict[int, int]:
        """The name of each label's hypothesis."""
        return {label: slot.name for label, slot in self._slots.items()}

    def restart(self) -> None:
        """Forget all hypotheses: the particles were drawn anew, and are one."""
        self._slots = {0: self._new()}
        self._close.clear()
        self._strays = False
        self.leader = self._slots[0].name
        self.labels[:] = 0

    def look(self, columns: Float32Array, weights: Float32Array, count: int) -> None:
        """Find out what has changed; to be called a few times a second.

        Parameters
        ----------
        columns : (dimension, >= count) float32
            North, east, heading first.
        weights : (>= count,) float32
            Not negative, up to a common factor, with a positive sum.
        count : int
        """
        if self.divided:
            shares = self._shares(weights, count)
            self._fade(shares, count)
            self._adopt(shares, count)
            self._join(columns, weights, count, shares)
        self._divide(columns, weights, count)
        if self.divided:
            self._elect(self._shares(weights, count))

    def quotas(self, weights: Float32Array, count: int, drawn: int) -> NDArray[np.int64]:
        """Say how many of ``drawn`` particles each label should have: (most + 1,), which sum to ``drawn``.

        As many as its weight is worth, but no living hypothesis fewer than its part of :data:`EVEN_PART`: how two
        compare is known as badly as the worse sampled of them. Who draws them weighs them by their label's weight over
        its quota, so that the belief stays what it is.
        """
        shares = self._shares(weights, count)
        living = [label for label in self._slots if shares[label] > 0.0]
        least = EVEN_PART / max(1, len(living))
        wanted = shares.copy()
        wanted[living] = np.maximum(wanted[living], least)
        wanted *= drawn / wanted.sum()
        quotas = np.floor(wanted).astype(np.int64)
        rest = np.argsort(-(wanted - quotas), kind="stable")[: drawn - int(quotas.sum())]
        quotas[rest] += 1
        return quotas

    def worths(self, weights: Float32Array, count: int) -> dict[int, float]:
        """Return how many particles are effective of each hypothesis's (equation 4.36's measure), by label."""
        labels, given = self.labels[:count], weights[:count].astype(np.float64)
        sums = np.bincount(labels, given, self._most + 1)
        squares = np.bincount(labels, given * given, self._most + 1)
        return {
            label: float(sums[label] ** 2 / squares[label]) for label in self._slots if squares[label] > 0.0
        }

    def moments(
        self,
        columns: Float32Array,
        weights: Float32Array,
        count: int,
        displacement: Displacement = STILL,
    ) -> list[Hypothesis]:
        """Return the hypotheses, the leader first and the others by weight, of the particles displaced.

        Their weights sum to one less what the strays have.
        """
        found = self._moments.of(columns, weights, self.labels, count, displacement, self.names)
        return sorted(found.values(), key=lambda each: (each.name != self.leader, -each.weight, each.name))

    # --- the parts of a look --------------------------------------------------------------------------------------

    def _shares(self, weights: Float32Array, count: int) -> Array:
        kernels.masses.direct(weights, self.labels, count, self._sums)
        return self._sums / self._sums.sum()

    def _fade(self, shares: Array, count: int) -> None:
        """Drop what has been without weight for long enough, and strays that nothing is left of."""
        heaviest = max(self._slots, key=lambda label: float(shares[label]))
        for label, slot in list(self._slots.items()):
            faded = 0 if label == heaviest or shares[label] >= DROPPED else slot.faded + 1
            if faded >= FADES or (shares[label] <= 0.0 and label != heaviest):
                self._rename(label, self._most, count)
                del self._slots[label]
                shares[self._most] += shares[label]
                shares[label] = 0.0
            else:
                self._slots[label] = slot._replace(faded=faded)
        self._strays = bool((self.labels[:count] == self._most).any())
        if len(self._slots) == 1 and self._strays and shares[self._most] < GONE:
            self._rename(self._most, heaviest, count)
            self._strays = False

    def _adopt(self, shares: Array, count: int) -> None:
        """Make a hypothesis of strays that have weight again."""
        if shares[self._most] < FOUND:
            return
        label = self._free()
        if label is None:
            return
        self._rename(self._most, label, count)
        self._slots[label] = self._new()
        self._strays = False
        shares[label], shares[self._most] = shares[self._most], 0.0

    def _join(self, columns: Float32Array, weights: Float32Array, count: int, shares: Array) -> None:
        """Make one of two between which there is no valley."""
        found = self._moments.of(columns, weights, self.labels, count, STILL, self.names)
        labels = sorted(found)
        still: dict[tuple[int, int], int] = {}
        for place, one in enumerate(labels):
            for other in labels[place + 1 :]:
                if found[one].distance(found[other]) > NEAR:
                    continue
                if not self._parted(columns, weights, count, (one, other), shares):
                    still[one, other] = self._close.get((one, other), 0) + 1
        self._close = still
        for (one, other), looks in still.items():
            if looks >= JOINS:
                self._marry(one, other, count)
                break

    def _parted(
        self, columns: Float32Array, weights: Float32Array, count: int, pair: tuple[int, int], shares: Array
    ) -> bool:
        self._factors[:] = 0.0
        for label in pair:  # as if they were equally likely: a valley beside a small one is as deep
            self._factors[label] = 1.0 / shares[label]
        return self._modes.look(columns, weights, self.labels, count, self._factors, TOGETHER) > 1

    def _marry(self, one: int, other: int, count: int) -> None:
        """Give the particles of two one label: the leader's, or that of the older."""
        first, second = self._slots[one], self._slots[other]
        kept, gone = (one, other) if first.name < second.name else (other, one)
        if self._slots[gone].name == self.leader:
            kept, gone = gone, kept
        self._rename(gone, kept, count)
        del self._slots[gone]
        self._close.clear()

    def _divide(self, columns: Float32Array, weights: Float32Array, count: int) -> None:
        """Ask one hypothesis, another one each time, whether its particles have several modes."""
        labels = sorted(self._slots)
        self._turn = (self._turn + 1) % len(labels)
        label = labels[self._turn]
        share = 1.0 if len(labels) == 1 else float(self._shares(weights, count)[label])
        least = FOUND / max(share, FOUND)
        if least >= 0.5:
            return
        self._factors[:] = 0.0
        self._factors[label] = 1.0
        depth = APART._replace(least=least)
        number = self._modes.look(columns, weights, self.labels, count, self._factors, depth)
        slot = self._slots[label]
        divided = slot.divided + 1 if number > 1 else 0
        self._slots[label] = slot._replace(divided=divided)
        if divided >= DIVIDES:
            self._part(columns, count, label, number)

    def _part(self, columns: Float32Array, count: int, label: int, number: int) -> None:
        """Give each mode a label; the heaviest keeps the one there was."""
        order = np.argsort(-self._modes.masses[:number], kind="stable")
        labels = np.full(number, label, np.int32)
        self._slots[label] = self._slots[label]._replace(divided=0)
        for mode in order[1:]:
            free = self._free()
            if free is None:
                break
            labels[mode] = free
            self._slots[free] = self._new()
            self._moments.inherit(label, free)
        self._modes.relabel(columns, self.labels, count, label, labels)

    def _elect(self, shares: Array) -> None:
        """Change the leader if there is reason to."""
        heaviest = max(self._slots, key=lambda label: (float(shares[label]), -self._slots[label].name))
        leading = [label for label, slot in self._slots.items() if slot.name == self.leader]
        if not leading or shares[heaviest] > LEADS * shares[leading[0]]:
            self.leader = self._slots[heaviest].name

    def _new(self) -> Slot:
        self._named += 1
        return Slot(self._named)

    def _free(self) -> int | None:
        return next((label for label in range(self._most) if label not in self._slots), None)

    def _rename(self, old: int, new: int, count: int) -> None:
        labels = self.labels[:count]
        labels[labels == old] = new
