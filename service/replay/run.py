"""One replay: logs through the estimator, faster than real time, with what came out of it.

The clock of a replay is the log's own receive clock. A tick sees exactly what had been received by then, so the
estimates are the ones that the daemon would have published, had it been there with this many particles affordable.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

import msgspec

from drivers.logs import LogReader
from drivers.sample import SECOND, LinkReport
from service.checks import Check, Story, Teller
from service.config import Configuration
from service.decisions import Decided
from service.estimate import Estimate
from service.estimator import Estimator
from service.estimator.shadow import Shadow
from service.replay.blanking import Blank, Seeing
from service.replay.comparing import Again, Comparing
from service.replay.outage import Outage, outages_of
from service.replay.recorded import RecordedRun, recorded_ticks
from service.replay.rows import EstimateFile
from service.replay.sources import LogError, merged, open_log
from service.replay.tally import ShadowRun, ShadowTally, Tally
from service.replay.ticks import Tick, ticks_decided, ticks_of
from service.replay.trace import Trace, Tracer
from service.score import UNSCORED, Score, Truth, figures, levels

Progress = Callable[[float, float], None]
"""Called with the share of the log that is done, and how many seconds of it that was."""


@dataclass(frozen=True)
class Plan:
    """What to replay and how.

    Attributes
    ----------
    logs : tuple[Path, ...]
        Merged by receive time.
    particles : int
        How many particles every tick affords; a replay has no deadline, so this stands for the machine.
    out : Path or None
        Folder for ``estimates_seedN.csv``.
    traced : int or None
        The seed whose run is written down tick by tick, for a report.
    decisions : tuple[Decided, ...] or None
        What every tick of a recorded run was allowed; the replay then has its ticks and counts, not ``particles``.
    blanks : tuple[Blank, ...]
        Sensors that are taken away for a time.
    recorded : RecordedRun or None
        The recorded run that the log holds, to be done again tick by tick; neither ``particles`` nor ``decisions`` play
        a part then.
    """

    logs: tuple[Path, ...]
    configuration: Configuration
    particles: int
    truth: Truth | None = None
    out: Path | None = None
    traced: int | None = None
    decisions: tuple[Decided, ...] | None = None
    blanks: tuple[Blank, ...] = ()
    recorded: RecordedRun | None = None


@dataclass
class Run:
    """What one seed gave; :meth:`row` is its object in ``--json``.

    Attributes
    ----------
    shadow : ShadowRun
        What the extended Kalman filter made of the same samples.
    blanked : int
        Samples that the plan took away.
    tracked_after : float or None
        Seconds until the health was tracking for the first time.
    outages, shadow_outages : list[Outage]
        What became of the belief while they were, and of the Kalman filter's.
    again : Again or None
        How many of the estimates that a recorded run published came out the same, byte for byte.
    trace : Trace or None
        The run tick by tick, where the plan asked for it.
    levels : list[int]
        Ticks by the content of the smallest published region that holds the truth, in 100 equal bins of 0 … 1.
    story : Story or None
        What was published tick by tick, for whoever has questions to it.
    checks : list[Check]
        The questions that a scenario asks, with their answers.
    """

    seed: int
    score: Score
    particles_mean: float
    late_samples: int
    dropped: int
    health: dict[str, float]
    seconds: float
    real_time_factor: float
    ticks: int
    biases: dict[str, tuple[float, float]]
    sensors: dict[str, tuple[int, dict[str, int]]]
    links: list[LinkReport]
    shadow: ShadowRun
    tracked_after: float | None = None
    last_reason: str = ""
    blanked: int = 0
    outages: list[Outage] = field(default_factory=list[Outage])
    shadow_outages: list[Outage] = field(default_factory=list[Outage])
    again: Again | None = None
    trace: Trace | None = None
    levels: list[int] = field(default_factory=list[int])
    story: Story | None = None
    checks: list[Check] = field(default_factory=list[Check])

    def row(self) -> dict[str, object]:
        """Return the figures as ``--json`` prints them."""
        return {
            "seed": self.seed,
            **self.score.rounded(),
            "particles_mean": round(self.particles_mean, 1),
            "late_samples": self.late_samples,
            "dropped": self.dropped,
            "blanked": self.blanked,
            "outages": [outage.rounded() for outage in self.outages],
            "shadow_outages": [outage.rounded() for outage in self.shadow_outages],
            **({} if self.again is None else {"again": self.again._asdict()}),
            "health": self.health,
            "tracked_after_s": None if self.tracked_after is None else round(self.tracked_after, 3),
            "seconds": round(self.seconds, 3),
            "real_time_factor": round(self.real_time_factor, 1),
            "ticks": self.ticks,
            "biases": {name: [round(v, 6), round(s, 6)] for name, (v, s) in self.biases.items()},
            "sensors": {
                name: {"accepted": accepted, "refused": refused}
                for name, (accepted, refused) in self.sensors.items()
            },
            "shadow": self.shadow.row(),
            "links": [msgspec.to_builtins(report) for report in self.links],
            "levels": self.levels,
            **({} if self.story is None else self.story.row()),
            "checks": [check._asdict() for check in self.checks],
        }


class Source:
    """Where the ticks of a replay come from: the readers of its logs, and what the plan makes of them.

    Parameters
    ----------
    plan : Plan
        What to replay.

    Attributes
    ----------
    readers : list[LogReader]
        One for each log.
    seen : Seeing
        What the plan takes away.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self.readers = [open_log(path, plan.configuration) for path in plan.logs]
        self.seen = Seeing(plan.blanks)
        self._recorded = None if plan.recorded is None else recorded_ticks(plan.recorded, self.readers[0])

    def ticks(self) -> Iterator[Tick]:
        """Read the logs from their start.

        Raises
        ------
        LogError
            They hold no sample at all.
        """
        plan = self._plan
        if self._recorded is not None:
            yield from self._recorded.ticks(self.seen)
            return
        samples = filter(self.seen, merged(self.readers))
        first = next(samples, None)
        if first is None:
            raise LogError(nothing_in(self.readers, plan.logs))
        samples = chain([first], samples)
        if plan.decisions is not None:
            yield from ticks_decided(samples, plan.decisions)
            return
        for now, batch in ticks_of(samples, plan.configuration.loop.rate):
            yield Tick(now, now, batch, plan.particles)

    def reports(self) -> list[LinkReport]:
        """Return what the readers counted."""
        if self._recorded is not None:
            return [self._recorded.report()]
        return [reader.report() for reader in self.readers]

    @property
    def share(self) -> float:
        """How much of the logs is read."""
        size = sum(reader.size for reader in self.readers)
        return sum(reader.position for reader in self.readers) / max(1, size)


def replay(plan: Plan, seed: int, progress: Progress = lambda share, seconds: None) -> Run:
    """Replay ``plan`` once with ``seed``.

    Raises
    ------
    LogError
        A log cannot be read, or holds no sample at all.
    RecordedRunError
        What a recorded run began with cannot be used.
    """
    source = Source(plan)
    began = time.perf_counter()
    estimator = _begun(plan, seed)
    shadow = estimator.accompany(Shadow)
    beside = ShadowTally(shadow)
    tracer = estimator.accompany(lambda vehicle, belief: Tracer()) if plan.traced == seed else None
    ticks = source.ticks()
    first = next(ticks, None)
    if first is None:
        raise LogError(nothing_in(source.readers, plan.logs))
    tally, teller, again = Tally(), Teller(), Comparing()
    with ExitStack() as stack:
        file = None
        if plan.out is not None:
            file = stack.enter_context(EstimateFile(plan.out / f"estimates_seed{seed}.csv"))
        now = first.now
        for tick in chain([first], ticks):
            now = tick.now
            estimate = _done(estimator, tick)
            again.add(estimate, tick.published)
            several = estimate.hypotheses > 1
            tally.add(estimate, estimator.hypotheses(estimate.time) if several else None)
            teller.add(estimate)
            if teller.due(estimate.time):
                teller.ask(estimate.time, estimator.sensors(now))
            beside.add(now, estimate.time)
            if tracer is not None:
                tracer.add(estimate, shadow.at(now))
            if file is not None:
                file.write(estimate, tick.unix)
            if tally.ticks % 256 == 0:
                progress(source.share, tally.ticks / plan.configuration.loop.rate)
    seconds = time.perf_counter() - began
    progress(1.0, tally.ticks / plan.configuration.loop.rate)
    run = _run(seed, plan, estimator, tally, beside, source.reports(), seconds, now)
    run.blanked = source.seen.hidden
    begin = source.seen.begin / SECOND
    run.outages = outages_of(tally.path.track(), plan.truth, plan.blanks, begin)
    run.shadow_outages = outages_of(beside.path.track(), plan.truth, plan.blanks, begin)
    run.again = again.result()
    run.story = teller.story()
    run.trace = None if tracer is None else tracer.trace()
    return run


def _begun(plan: Plan, seed: int) -> Estimator:
    """Return the estimator before its first tick; one of a recorded run goes on from where that one did."""
    estimator = Estimator(plan.configuration, seed=seed)
    kept = None if plan.recorded is None else plan.recorded.kept(plan.configuration)
    if kept is not None:
        estimator.resume(kept)
    return estimator


def _done(estimator: Estimator, tick: Tick) -> Estimate:
    """Do one tick."""
    estimator.ingest(tick.samples)
    for start in tick.orders:
        estimator.reinitialize(start)
    return estimator.tick(tick.now, tick.unix, tick.afforded, tick.course)


def _run(
    seed: int,
    plan: Plan,
    estimator: Estimator,
    tally: Tally,
    beside: ShadowTally,
    reports: list[LinkReport],
    seconds: float,
    now: int,
) -> Run:
    drops, compared = estimator.drops, tally.path.compared(plan.truth)
    late = drops.pop("late", 0) + estimator.caught_up
    last = tally.last
    return Run(
        seed=seed,
        score=UNSCORED if compared is None else figures(compared),
        levels=[] if compared is None else levels(compared),
        particles_mean=tally.particles / max(1, tally.ticks),
        late_samples=late,
        dropped=sum(drops.values()),
        health={state.value: round(n / tally.ticks, 4) for state, n in sorted(tally.health.items())},
        seconds=seconds,
        real_time_factor=tally.ticks / plan.configuration.loop.rate / max(seconds, 1e-9),
        ticks=tally.ticks,
        biases=dict(last.biases) if last else {},
        sensors={s.name: (s.accepted, s.refused) for s in estimator.sensors(now)},
        links=reports,
        shadow=beside.run(plan.truth),
        tracked_after=tally.tracked_after,
        last_reason=last.reason if last else "",
    )


def nothing_in(readers: list[LogReader], logs: tuple[Path, ...]) -> str:
    """Return why no sample came out of ``logs``, from what their readers counted."""
    said: list[str] = []
    for path, reader in zip(logs, readers, strict=True):
        report = reader.report()
        said.append(
            f"{path}: no usable sample in it ({report.messages} messages read, {report.ignored} not wanted"
            + (f"; refused: {counts(report.malformed)}" if report.malformed else "")
            + (f"; not usable: {counts(report.unusable)}" if report.unusable else "")
            + ")"
        )
    return "; ".join(said)


def counts(of: dict[str, int]) -> str:
    """Return counts by kind in words: ``4 GPS_RAW_INT.fix_type, 2 RPM.rpm1``."""
    return ", ".join(f"{count} {kind}" for kind, count in of.items())
