"""Threads that are lent to the filter: it divides the work and starts none itself.

The kernels let go of the interpreter's lock, so tasks run side by side; what runs in Python between two kernels is
short. A crew changes no result (:mod:`filters.crew`), so whether it is worth having
is a question of time alone, and :func:`hired` measures it.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from functools import lru_cache
from statistics import median

import numpy as np

from filters.kernels.waiting import changed
from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.sensing import Range, RangeMeasurement

Task = Callable[[int], None]

COUNTS = (25_000, 50_000, 100_000, 200_000, 500_000, 1_000_000)
"""Particles at which a crew is tried."""

WORTH = 0.9
"""Share of the time alone that a step with the crew may take for it to be worth calling."""

STEPS = 9

PATIENCE = 100e-6
"""Seconds that a thread looks for what it waits for before it sleeps."""

LINGER = 4e-6
"""Seconds after which who has sent a number has let go of the interpreter's lock."""

_TRIAL = 100_000


class Threads:
    """A crew of threads of this process, the caller's among them; see :class:`filters.crew.Crew`.

    A step has several tasks, a few microseconds apart, and to wake a thread takes tens of them. So a thread that is
    done looks for its next task for :data:`PATIENCE` before it sleeps, and so does the caller for its crew.

    Parameters
    ----------
    threads : int
        How many work.
    fewest : int
        Particles from which a filter should call them.

    Raises
    ------
    ValueError
        Fewer than one.
    """

    def __init__(self, threads: int, fewest: int = 0) -> None:
        if threads < 1:
            raise ValueError(f"a crew has at least one thread, got {threads}")
        self.threads = threads
        self.fewest = fewest
        self._task: Task | None = None
        self._round = 0
        self._errors: list[BaseException] = []
        self._looks, self._linger = _looks_in(PATIENCE), _looks_in(LINGER)
        self._orders = [_Signal() for _ in range(threads)]
        self._reports = [_Signal() for _ in range(threads)]
        for part in range(1, threads):
            threading.Thread(target=self._work, args=(part,), name=f"crew {part}", daemon=True).start()

    def run(self, task: Task) -> None:
        """Call ``task`` with every number below ``threads``, each on a thread of its own; return when all are done.

        Raises
        ------
        BaseException
            What a task raised; of several, the first.
        """
        self._task = task
        self._round += 1
        for order in self._orders[1:]:
            order.send(self._round)
        try:
            task(0)
        finally:
            for report in self._reports[1:]:
                report.wait(self._round - 1, self._looks, self._linger)
        if self._errors:
            error = self._errors[0]
            self._errors.clear()
            raise error

    def close(self) -> None:
        """End the threads."""
        self._task = None
        self._round += 1
        for order in self._orders[1:]:
            order.send(self._round)

    def _work(self, part: int) -> None:
        order, report = self._orders[part], self._reports[part]
        done = 0
        while True:
            order.wait(done, self._looks, self._linger)
            task = self._task
            if task is None:
                return
            try:
                task(part)
            except BaseException as error:  # noqa: BLE001  it is raised where the crew was called
                self._errors.append(error)
            done += 1
            report.send(done)


class _Signal:
    """A number that one thread sends and another waits for: first by looking at it, then asleep.

    Who falls asleep leaves a token. Taking it is one step that nothing can come between, so either the sender takes it
    and wakes the sleeper, or the sleeper takes it back because the number has changed already.
    """

    def __init__(self) -> None:
        self._number = np.zeros(8, np.int64)  # a cache line of its own
        self._tokens: list[None] = []
        self._gate = threading.Lock()  # who acquires it waits until another has released it
        self._gate.acquire()

    def send(self, number: int) -> None:
        self._number[0] = number
        if self._took():
            self._gate.release()

    def wait(self, known: int, looks: int, linger: int) -> None:
        """Return when the number is not ``known`` any more."""
        if changed.direct(self._number, 0, known, looks, linger):
            return
        self._tokens.append(None)
        if self._number[0] == known or not self._took():
            self._gate.acquire()

    def _took(self) -> bool:
        if not self._tokens:
            return False
        try:
            self._tokens.pop()
        except IndexError:
            return False
        return True


def hired(threads: int, most: int) -> Threads | None:
    """Return a crew that knows from how many particles it is worth its while on this machine, or ``None``.

    A step of a filter is timed without and with it, at growing counts up to ``most``; the first at which it saves a
    tenth decides. A machine whose other processors are busy may have no such count.
    """
    if threads == 1:
        return None
    crew = Threads(threads)
    for count in COUNTS:
        if count <= most and _cost(count, crew) < WORTH * _cost(count, None):
            crew.fewest = count
            return crew
    crew.close()
    return None


def _cost(count: int, crew: Threads | None) -> float:
    """Return the median wall time of a step, seconds."""
    belief = ParticleFilter(Unicycle(0.1, 0.1, 1e-3, 1e-3), capacity=count, seed=0, crew=crew)
    belief.initialize({name: np.linspace(-0.5, 0.5, count) for name in belief.names})
    costs: list[float] = []
    for _ in range(STEPS):
        before = time.perf_counter()
        belief.predict(UnicycleControl(0.1, 0.1), 0.02)
        for place in (-20.0, 20.0):
            belief.weigh(Range(0.5), RangeMeasurement(20.0, place, 0.0))
        belief.moments()
        belief.resample()
        costs.append(time.perf_counter() - before)
    return median(costs)


@lru_cache
def _looks_in(seconds: float) -> int:
    """How often a thread can look at a number in a time."""
    number = np.zeros(8, np.int64)
    before = time.perf_counter()
    changed(number, 0, 0, _TRIAL, 0)
    return round(seconds * _TRIAL / (time.perf_counter() - before))
