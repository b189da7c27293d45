"""What the loop spent and what it gave up."""

from __future__ import annotations

import msgspec


class StageCost(msgspec.Struct, frozen=True, gc=False):
    """Milliseconds that one stage took per tick, since the last value.

    Attributes
    ----------
    median, p99, worst : float
        Half of the ticks took no more than the median, 99 of 100 no more than ``p99``, none more than the
        worst.
    """

    median: float
    p99: float
    worst: float


class Distribution(msgspec.Struct, frozen=True, gc=False):
    """A time in every tick of the whole run, in bins of equal ratio, ten to the octave; milliseconds.

    Attributes
    ----------
    ticks : int
        How many values there are.
    median, p99, p999, p9999, worst : float
        Half of the values, 99 %, 99.9 % and 99.99 % are no more than this; the upper edge of a bin, so at most
        7 % too high. ``worst`` is exact.
    bins : list[tuple[float, int]]
        Upper edge and count of each bin that holds anything.
    """

    ticks: int
    median: float
    p99: float
    p999: float
    p9999: float
    worst: float
    bins: list[tuple[float, int]]


class Budget(msgspec.Struct, frozen=True, gc=False):
    """Once a second: what the loop spent and what it gave up.

    Attributes
    ----------
    time : float
        Unix seconds.
    budget_ms, rate : float
        What the configuration grants per tick, and ticks per second.
    stages : dict[str, StageCost]
        ``ingest``, ``motion``, ``sensing``, ``witnesses`` (trust, motion mode, hypotheses), ``resampling``, ``kalman``,
        ``search``, ``extraction``, ``publishing``, ``cloud``, ``other`` and ``tick`` (all of it).
    use : float
        Share of the budget used, median over the ticks.
    demanded, afforded, particles, level : int
        As in :class:`Estimate`, of the last tick.
    ticks, missed_ticks, overruns : int
        Since the start: ticks done, ticks that never ran because an earlier one was late, ticks over the
        budget.
    lateness : StageCost
        Milliseconds from the deadline of a tick to its start.
    queues : dict[str, int]
        Datagrams waiting on each link's queue at the last tick.
    drops : dict[str, int]
        Since the start: what was dropped, by what (``link autopilot``, ``publisher``, ``late``, ``future``
        …).
    rested_ticks : int
        Since the start: ticks left out on purpose, to pay for ticks far over the budget.
    cut_ticks : int
        Since the start: ticks whose weighing was ended because the rest of it would have overrun.
    levels : dict[str, int]
        Since the start: ticks at each level.
    level_reason : str
        As in :class:`Estimate`, of the last tick.
    run_lateness, run_duration : Distribution or None
        From deadline to start, and from start to end, of every tick since the start; wall time.
    page_faults : int
        Minor and major page faults of the loop's process over the last second; none once it has settled.
    """

    time: float
    budget_ms: float
    rate: float
    stages: dict[str, StageCost]
    use: float
    demanded: int
    afforded: int
    particles: int
    level: int
    ticks: int
    missed_ticks: int
    overruns: int
    lateness: StageCost
    queues: dict[str, int]
    drops: dict[str, int]
    rested_ticks: int = 0
    cut_ticks: int = 0
    levels: dict[str, int] = {}
    level_reason: str = ""
    run_lateness: Distribution | None = None
    run_duration: Distribution | None = None
    page_faults: int = 0
