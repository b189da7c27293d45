"""Taking a sensor away for a time, to see how the belief fares without it: ``position:20-50``.

What is blanked never reaches the estimator. Seconds count from the first sample of the replay, on the receive clock.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import NamedTuple, get_args

from drivers.sample import SECOND, Sample
from service.config.belief import SensorKind
from service.estimator.binding import takes

_FORM = re.compile(r"(?P<what>[^\s:]+):(?P<first>\d+(?:\.\d*)?)-(?P<last>\d+(?:\.\d*)?)?")


class Blank(NamedTuple):
    """One sensor taken away for a time.

    Attributes
    ----------
    what : str
        A kind of sensor (``position``), or the name that the wire has for who says it (``GPS_RAW_INT``).
    first, last : float
        From and to when, seconds since the beginning of the replay.
    """

    what: str
    first: float
    last: float

    @classmethod
    def of(cls, text: str) -> Blank:
        """Read ``WHAT:FROM-TO``, or ``WHAT:FROM-`` to the end.

        Raises
        ------
        ValueError
            It does not say that; the text says what would be right.
        """
        found = _FORM.fullmatch(text.strip())
        if found is None:
            raise ValueError(
                f"--blank: needs WHAT:FROM-TO in seconds, such as position:20-50 or GPS_RAW_INT:20-50, got {text}"
            )
        first, last = float(found["first"]), float(found["last"] or math.inf)
        if not first < last:
            raise ValueError(f"--blank: needs a time after {first:g} s for its end, got {text}")
        return cls(found["what"], first, last)

    @property
    def words(self) -> str:
        """What it does, in the user's words."""
        until = "the end" if self.last == math.inf else f"{self.last:g} s"
        return f"blanked: {self.what} from {self.first:g} s to {until}"

    def hides(self, sample: Sample, seconds: float) -> bool:
        """Whether ``sample``, received so long after the beginning, is taken away."""
        if not self.first <= seconds < self.last:
            return False
        if self.what in get_args(SensorKind):
            return isinstance(sample.reading, takes(self.what))
        return sample.source == self.what


class Seeing:
    """What of a stream of samples is seen: all but what is hidden. It is asked in their order.

    Attributes
    ----------
    hidden : int
        How many were taken away so far.
    """

    def __init__(self, blanks: Sequence[Blank]) -> None:
        self.hidden = 0
        self._blanks = blanks
        self._begin: int | None = None

    def __call__(self, sample: Sample) -> bool:
        """Whether a sample is seen; the first one asked about is the beginning."""
        if self._begin is None:
            self._begin = sample.received
        if not self._blanks:
            return True
        seconds = (sample.received - self._begin) / SECOND
        hides = any(blank.hides(sample, seconds) for blank in self._blanks)
        self.hidden += hides
        return not hides

    @property
    def begin(self) -> int:
        """When the beginning was, nanoseconds on the receive clock; 0 before there was one."""
        return self._begin or 0
