"""A replay's ticks: what each is given, whoever says so.

The log's own clock cuts a stream of samples into the ticks that a daemon would have had; a decision log says when a
daemon had them, and what it could afford; and the recording of a run has them whole (:mod:`service.replay.recorded`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from drivers.sample import SECOND, Sample
from service.config import Start
from service.decisions import Decided
from service.estimator import Course

SILENCE_LIMIT = 600 * SECOND
"""A log with a hole longer than this was spliced; ticks are not made up through it."""


class Tick(NamedTuple):
    """What one tick is given.

    Attributes
    ----------
    now, unix : int
        Its time on the clock of the samples and as Unix time, nanoseconds: the same but for a recorded run's.
    samples : list[Sample]
        What was received since the one before.
    afforded : int
        Particles.
    course : Course or None
        How far it may go beside that, where that was recorded.
    orders : Sequence[Start]
        What a user told the belief before it.
    published : bytes
        The estimate that a recorded run published in it; empty where that is not known.
    """

    now: int
    unix: int
    samples: list[Sample]
    afforded: int
    course: Course | None = None
    orders: Sequence[Start] = ()
    published: bytes = b""


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


def ticks_decided(samples: Iterator[Sample], decisions: Sequence[Decided]) -> Iterator[Tick]:
    """Cut a stream of samples into the ticks of a decision log, by its Unix clock."""
    waiting = next(samples, None)
    for decision in decisions:
        batch: list[Sample] = []
        while waiting is not None and waiting.received <= decision.unix:
            batch.append(waiting)
            waiting = next(samples, None)
        yield Tick(decision.unix, decision.unix, batch, decision.afforded, decision.course())
