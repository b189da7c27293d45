"""A quantity as a total over time: distance rolled, angle turned, and how much of the time nothing is known of it.

Any interval is a difference of two interpolated totals; where the total is not known (a gap in the data, a counter that
restarted) the seconds without knowledge are totalled beside it.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from typing import NamedTuple

from drivers.sample import SECOND

GAP = SECOND // 2
"""A rate is taken to hold for this long; what lies beyond is unknown."""

SPEED_WINDOW = SECOND // 10
"""Over which a speed is the mean."""

FASTEST = 1e4
FASTEST_TURN = 1e3
"""m/s and rad/s. What is faster, or not finite, is no motion but a counter that jumped or a broken number: it would
stay in the totals for ever."""


class Motion(NamedTuple):
    """What a control says of an interval: the total, and for how many seconds of it nothing is known.

    ``since`` is for how many seconds nothing had been known when the interval began.
    """

    total: float
    unknown: float
    since: float = math.inf


class Track:
    """A total over time, as a piecewise linear function; bounded in memory.

    Times are nanoseconds on the one clock; they must not run backwards (:meth:`extend` refuses).
    """

    def __init__(self) -> None:
        self._times: list[int] = []
        self._totals: list[float] = []
        self._unknown: list[float] = []
        self._held_rate: tuple[float, int] | None = None

    @property
    def latest(self) -> int | None:
        """Time of the last entry, or ``None``."""
        return self._times[-1] if self._times else None

    @property
    def earliest(self) -> int | None:
        """Time of the first entry still kept, or ``None``."""
        return self._times[0] if self._times else None

    def extend(self, time: int, increment: float, unknown: float = 0.0) -> bool:
        """Append the point that lies ``increment`` further at ``time``; ``False`` if ``time`` is not newer."""
        if not self._times:
            self._times.append(time)
            self._totals.append(0.0)
            self._unknown.append(0.0)
            return True
        if time <= self._times[-1]:
            return False
        self._times.append(time)
        self._totals.append(self._totals[-1] + increment)
        self._unknown.append(self._unknown[-1] + unknown)
        self._held_rate = None
        return True

    def forget(self, before: int) -> None:
        """Drop the entries older than ``before``, keeping one to interpolate from."""
        keep = bisect_right(self._times, before) - 1
        if keep > 64:
            del self._times[:keep], self._totals[:keep], self._unknown[:keep]
            self._held_rate = None

    def between(self, start: int, end: int) -> Motion:
        """Return the motion from ``start`` to ``end`` (nanoseconds), interpolated; beyond the last point, held."""
        total_start, unknown_start = self._at(start)
        total_end, unknown_end = self._at(end)
        if unknown_end <= unknown_start:
            return Motion(total_end - total_start, unknown_end - unknown_start)
        last = bisect_right(self._times, start) - 1
        since = math.inf if last < 0 else unknown_start - self._unknown[last]
        return Motion(total_end - total_start, unknown_end - unknown_start, since)

    def totals(self, times: Sequence[int]) -> list[float]:
        """Return the total at each of ``times``, all from one beginning."""
        known, totals = self._times, self._totals
        if not known:
            return [0.0] * len(times)
        first, last = known[0], known[-1]
        found: list[float] = []
        for time in times:  # as _at has it, without the seconds that nothing is known of
            if time >= last:
                rate, longest = self._held_rate or self._hold()
                found.append(totals[-1] + rate * min(time - last, longest))
            elif time <= first:
                found.append(totals[0])
            else:
                after = bisect_right(known, time)
                begin, total = known[after - 1], totals[after - 1]
                share = (time - begin) / (known[after] - begin)
                found.append(total + share * (totals[after] - total))
        return found

    def rate(self, time: int) -> float:
        """Return the mean rate over :data:`SPEED_WINDOW` about ``time``, per second."""
        half = SPEED_WINDOW // 2
        return self.between(time - half, time + half).total / (SPEED_WINDOW / SECOND)

    def _at(self, time: int) -> tuple[float, float]:
        times, totals, unknown = self._times, self._totals, self._unknown
        if not times:
            return 0.0, time / SECOND
        if time >= times[-1]:
            rate, longest = self._held_rate or self._hold()
            beyond = time - times[-1]
            held = min(beyond, longest)
            return totals[-1] + rate * held, unknown[-1] + (beyond - held) / SECOND
        if time <= times[0]:
            return totals[0], unknown[0] - (times[0] - time) / SECOND
        after = bisect_right(times, time)
        before = after - 1
        share = (time - times[before]) / (times[after] - times[before])
        total, gap = totals[before], unknown[before]
        return total + share * (totals[after] - total), gap + share * (unknown[after] - gap)

    def _hold(self) -> tuple[float, int]:
        """Note the rate of the last tenth of a second and for how long it holds beyond: ``GAP``, if it is known."""
        last = self._times[-1]
        first = max(0, bisect_left(self._times, last - SECOND // 10) - 1)
        span = last - self._times[first]
        known = span > 0 and span <= SECOND
        self._held_rate = ((self._totals[-1] - self._totals[first]) / span, GAP) if known else (0.0, 0)
        return self._held_rate


class RateTrack(Track):
    """A track fed with rates: each holds, trapezoidally, until the next; a gap is unknown beyond ``GAP``."""

    def __init__(self) -> None:
        super().__init__()
        self._rate = 0.0

    def append(self, time: int, rate: float) -> bool:
        """Append ``rate`` (per second) measured at ``time``."""
        latest = self.latest
        elapsed = 0 if latest is None else time - latest
        if latest is not None and elapsed == 0:
            done = True  # the same instant again (a message with two motors): the later value knows more
        elif elapsed > GAP:
            done = self.extend(time, self._rate * GAP / SECOND, (elapsed - GAP) / SECOND)
        else:
            done = self.extend(time, 0.5 * (self._rate + rate) * elapsed / SECOND)
        if done:
            self._rate = rate
        return done

    def _hold(self) -> tuple[float, int]:
        """Note the rate that holds; the first one there is tells it by itself."""
        if len(self._times) > 1:
            return super()._hold()
        self._held_rate = (self._rate / SECOND, GAP)
        return self._held_rate


class TotalTrack(Track):
    """A track fed with a counter that may start anew: a new epoch, and whatever it missed is unknown.

    Attributes
    ----------
    jumps : int
        How often the counter moved farther than anything can; that stretch is unknown, too.
    """

    def __init__(self) -> None:
        super().__init__()
        self.jumps = 0
        self._last: tuple[object, tuple[float, ...]] | None = None

    def append(self, time: int, distance: tuple[float, ...], epoch: object) -> bool:
        """Append the wheels' totals at ``time``; the vehicle's is their mean.

        ``epoch`` is whatever tells one counter from another; between two of them the distance is unknown.
        """
        elapsed = 0.0 if self.latest is None else (time - self.latest) / SECOND
        step = self._step(distance, epoch)
        if step is not None and elapsed > 0.0 and not abs(step) <= FASTEST * elapsed:
            self.jumps += 1
            step = None
        done = self.extend(time, 0.0, elapsed) if step is None else self.extend(time, step)
        if done:
            self._last = (epoch, distance)
        return done

    def _step(self, distance: tuple[float, ...], epoch: object) -> float | None:
        """Return how far the wheels' mean moved since the last totals; ``None`` if these are of another counter."""
        if self._last is None or self._last[0] != epoch or len(self._last[1]) != len(distance):
            return None
        return sum(now - before for now, before in zip(distance, self._last[1], strict=True)) / len(distance)
