"""One replay: logs through the estimator, faster than real time, with what came out of it.

The clock of a replay is the log's own receive clock. A tick sees exactly what had been received by then, so the
estimates are the ones that the daemon would have published, had it been there with this many particles affordable.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

import msgspec

from drivers.logs import LogReader
from drivers.sample import LinkReport, Sample
from service.checks import Check, Story, Teller
from service.config import Configuration
from service.decisions import Decided
from service.estimator import Course, Estimator
from service.estimator.shadow import Shadow
from service.replay.blanking import Blank, Blanked
from service.replay.rows import EstimateFile
from service.replay.sources import LogError, merged, open_log
from service.replay.tally import ShadowRun, ShadowTally, Tally
from service.replay.trace import Trace, Tracer
from service.score import UNSCORED, Score, Truth, figures, levels

SECOND = 1_000_000_000
SILENCE_LIMIT = 600 * SECOND
"""A log with a hole longer than this was spliced; ticks are not made up through it."""

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
    """

    logs: tuple[Path, ...]
    configuration: Configuration
    particles: int
    truth: Truth | None = None
    out: Path | None = None
    traced: int | None = None
    decisions: tuple[Decided, ...] | None = None
    blanks: tuple[Blank, ...] = ()


@dataclass
class Run:
    """What one seed gave; :meth:`row` is its object in ``--json``.

    Attributes
    ----------
    shadow : ShadowRun
        What the extended Kalman filter made of the same samples.
    blanked : int
        Samples that the plan took away.
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
    last_reason: str = ""
    blanked: int = 0
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
            "health": self.health,
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


def ticks_of(samples: Iterator[Sample], rate: float) -> Iterator[tuple[int, list[Sample]]]:
    """Cut a stream of samples into ticks: each with its time and what was received since the one before."""
    first = next(samples, None)
    if first is None:
        return
    start, index, batch = first.received, 0, [first]
    deadline = start
    for sample in samples:
        while sample.received > deadline:
            yield deadline, batch
            batch = []
            index += 1
            deadline = start + round(index * SECOND / rate)
            if sample.received - deadline > SILENCE_LIMIT:
                start, index, deadline = sample.received, 0, sample.received
        batch.append(sample)
    yield deadline, batch


def ticks_decided(
    samples: Iterator[Sample], decisions: Sequence[Decided]
) -> Iterator[tuple[int, list[Sample], int, Course]]:
    """Cut a stream of samples into the ticks of a recorded run, by its Unix clock: time, samples, count, course."""
    waiting = next(samples, None)
    for decision in decisions:
        batch: list[Sample] = []
        while waiting is not None and waiting.received <= decision.unix:
            batch.append(waiting)
            waiting = next(samples, None)
        yield decision.unix, batch, decision.afforded, decision.course()


def _ticks(samples: Iterator[Sample], plan: Plan) -> Iterator[tuple[int, list[Sample], int, Course | None]]:
    if plan.decisions is not None:
        yield from ticks_decided(samples, plan.decisions)
        return
    for now, batch in ticks_of(samples, plan.configuration.loop.rate):
        yield now, batch, plan.particles, None


def replay(plan: Plan, seed: int, progress: Progress = lambda share, seconds: None) -> Run:
    """Replay ``plan`` once with ``seed``.

    Raises
    ------
    LogError
        A log cannot be read, or holds no sample at all.
    """
    readers = [open_log(path, plan.configuration) for path in plan.logs]
    began = time.perf_counter()
    estimator = Estimator(plan.configuration, seed=seed)
    shadow = estimator.accompany(Shadow)
    beside = ShadowTally(shadow)
    tracer = estimator.accompany(lambda vehicle, belief: Tracer()) if plan.traced == seed else None
    seen = Blanked(merged(readers), plan.blanks)
    samples = iter(seen)
    first = next(samples, None)
    if first is None:
        raise LogError(nothing_in(readers, plan.logs))
    tally, teller = Tally(), Teller()
    with ExitStack() as stack:
        file = None
        if plan.out is not None:
            file = stack.enter_context(EstimateFile(plan.out / f"estimates_seed{seed}.csv"))
        now = first.received
        for now, batch, afforded, course in _ticks(chain([first], samples), plan):
            estimator.ingest(batch)
            estimate = estimator.tick(now, now, afforded, course)
            several = estimate.hypotheses > 1
            tally.add(estimate, estimator.hypotheses(estimate.time) if several else None)
            teller.add(estimate)
            if teller.due(estimate.time):
                teller.ask(estimate.time, estimator.sensors(now))
            beside.add(now, estimate.time)
            if tracer is not None:
                tracer.add(estimate, shadow.at(now))
            if file is not None:
                file.write(estimate, now)
            if tally.ticks % 256 == 0:
                progress(_share(readers), tally.ticks / plan.configuration.loop.rate)
    seconds = time.perf_counter() - began
    progress(1.0, tally.ticks / plan.configuration.loop.rate)
    run = _run(seed, plan, estimator, tally, beside, readers, seconds, now)
    run.blanked = seen.hidden
    run.story = teller.story()
    run.trace = None if tracer is None else tracer.trace()
    return run


def _run(
    seed: int,
    plan: Plan,
    estimator: Estimator,
    tally: Tally,
    beside: ShadowTally,
    readers: list[LogReader],
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
        links=[reader.report() for reader in readers],
        shadow=beside.run(plan.truth),
        last_reason=last.reason if last else "",
    )


def _share(readers: list[LogReader]) -> float:
    size = sum(reader.size for reader in readers)
    return sum(reader.position for reader in readers) / max(1, size)


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
