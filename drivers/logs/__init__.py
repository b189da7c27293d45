"""Log files, read as the live links are: bytes to samples, in the order in which they arrived then."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from drivers.sample import LinkReport, Sample


class LogReader(Protocol):
    """What every log file offers: its samples, what was damaged in it, how far the reading is.

    ``received`` of the samples is the log's receive clock, nanoseconds; it never decreases.
    """

    @property
    def size(self) -> int:
        """Bytes of the file."""
        ...

    @property
    def position(self) -> int:
        """Bytes read so far, for a progress bar."""
        ...

    def __iter__(self) -> Iterator[Sample]:
        """Read from the start, in order of arrival; each iteration begins anew.

        Raises
        ------
        OSError
            The file cannot be read.
        """
        ...

    def report(self) -> LinkReport:
        """Return the totals of the iteration so far, as a live link would."""
        ...

    def kinds(self) -> dict[str, int]:
        """Return how many messages of each kind were met, also of those that no one wants."""
        ...
