"""Up to when nothing can be missing any more: what every sender has said, as far as each sends in order.

A horizon waits for the slowest of a link's measurements, each time. Where controls bridge the way from the horizon to
now that costs little; where there are none it is way that nobody knows. But there is nothing to wait for before the
newest reading of the sender who is behind: with one sender, a reading is as good as it gets when it arrives. A wait
of a moment stays as it is: the ranges of one round are better weighed together.
"""

from __future__ import annotations

from drivers.sample import SECOND

PATIENCE = 2 * SECOND
"""Beyond the horizon's own wait: who has said nothing for so long is not waited for."""

MOMENT = SECOND // 10
"""A wait no longer than this is kept."""


class Complete:
    """The newest reading of each sender."""

    def __init__(self) -> None:
        self._newest: dict[str, int] = {}

    def heard(self, sender: str, time: int) -> None:
        """Note a reading of ``time``, nanoseconds."""
        self._newest[sender] = max(time, self._newest.get(sender, time))

    def until(self, now: int, horizon: int) -> int:
        """Return up to when all has come by ``now``; at least ``horizon``, for what is older is not waited for."""
        if now - horizon <= MOMENT:
            return horizon
        awaited = [time for time in self._newest.values() if time >= horizon - PATIENCE]
        return max(horizon, min(awaited, default=horizon))
