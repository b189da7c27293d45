"""Whether a recorded run came out the same again: every estimate beside the one that was published, byte for byte."""

from __future__ import annotations

from typing import NamedTuple

import msgspec

from service.estimate import Estimate


class Again(NamedTuple):
    """How a recorded run came out again.

    Attributes
    ----------
    published : int
        Estimates in the recording.
    same : int
        How many of them are the same again, byte for byte.
    """

    published: int
    same: int

    @property
    def words(self) -> str:
        """What it says, in a line."""
        if self.same == self.published:
            return f"as published: all {self.published} estimates, byte for byte"
        return f"as published, byte for byte: {self.same} of {self.published} estimates"


class Comparing:
    """Counts."""

    def __init__(self) -> None:
        self._published = 0
        self._same = 0
        self._encoder = msgspec.json.Encoder()

    def add(self, estimate: Estimate, published: bytes) -> None:
        """Compare one estimate with what was published in its tick, if that is known."""
        if published:
            self._published += 1
            self._same += self._encoder.encode(estimate) == published

    def result(self) -> Again | None:
        """Return the counts; ``None`` where there was nothing to compare with."""
        return Again(self._published, self._same) if self._published else None
