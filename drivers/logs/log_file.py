"""What the readers of log files share: the file, how far it is read, and how damage is counted.

A reader says how it begins (:meth:`LogFile.begin`) and what it makes of an open file (:meth:`LogFile.read`); the rest
of what :class:`drivers.logs.LogReader` promises of a file stands here once.
"""

from __future__ import annotations

import mmap
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from drivers.sample import Sample

LOST_BYTES = "lost_bytes"


class LogFile(ABC):
    """A log file; each iteration begins anew.

    Parameters
    ----------
    path : Path
        The file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.done = 0
        """Bytes read so far, as :meth:`read` notes them."""
        self.begin()

    @property
    def size(self) -> int:
        """Bytes of the file, as it lies on the disk."""
        return self.path.stat().st_size

    @property
    def position(self) -> int:
        """Bytes read so far: ``position / size`` is the progress."""
        return self.done

    def __iter__(self) -> Iterator[Sample]:
        """Read from the start, in the order of the log; damage is counted and ends nothing that can be read.

        Raises
        ------
        OSError
            The file cannot be read.
        """
        self.begin()
        self.done = 0
        with self.path.open("rb") as file:
            yield from self.read(file)

    @abstractmethod
    def begin(self) -> None:
        """Forget what an iteration before has counted."""

    @abstractmethod
    def read(self, file: BinaryIO) -> Iterator[Sample]:
        """Yield the samples of the file, open at its start."""


def mapped(file: BinaryIO) -> Iterator[mmap.mmap]:
    """Yield the content of a file in memory; nothing of an empty one, which cannot be mapped."""
    if file.seek(0, 2) == 0:
        return
    with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        yield data


def lost(faults: Counter[str], what: str, start: int, end: int) -> int:
    """Count one stretch that could not be read, and its bytes; return its end, from where the reading goes on."""
    faults[what] += 1
    faults[LOST_BYTES] += end - start
    return end
