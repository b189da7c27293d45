"""What the loop owes: ticks that cost more than their budget are paid for by ticks left out.

The governor thins the work until a tick fits. When not even the least does (a machine far too slow, a vehicle that
floods it), a loop under SCHED_FIFO would take a processor whole and leave nobody any, the links and the supervisor
included. So what a tick costs beyond its budget is owed, and beyond a grace the loop rests until it is paid: over
time it never takes more than the share of a processor that it was granted.
"""

from __future__ import annotations

import math

GRACE = 8.0
"""Budgets that may be owed without a rest: single ticks are dear for many reasons."""

LONGEST_REST = 0.5
"""Seconds: the supervisor takes a loop that is silent for twice as long for hung."""


class Debt:
    """Account of processor time.

    Parameters
    ----------
    budget, period : float
        Seconds of processor time granted per period, and the period in seconds.
    """

    def __init__(self, budget: float, period: float) -> None:
        self._budget = budget
        self._most = max(1, int(LONGEST_REST / period))
        self._owed = 0.0

    def charge(self, cost: float, periods: int) -> int:
        """Book one tick, and return how many ticks to leave out now.

        Parameters
        ----------
        cost : float
            Seconds of processor time that the tick took.
        periods : int
            Periods that have begun since the last tick, this one's included: each grants a budget.
        """
        self._owed = max(0.0, self._owed + cost - periods * self._budget)
        beyond = self._owed / self._budget - GRACE
        if beyond <= 0.0:
            return 0
        # what the longest rest does not pay is forgiven: a debt of minutes would be no use to anybody
        self._owed = min(self._owed, (GRACE + self._most) * self._budget)
        return min(math.ceil(beyond), self._most)
