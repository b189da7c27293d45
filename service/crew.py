"""Threads that are lent to the filter: it divides the work and starts none itself.

They sleep on locks between tasks. The kernels let go of the interpreter's lock, so tasks run side by side; what runs
in Python between two kernels is short. A crew changes no result (:mod:`filters.crew`), so whether it is worth having
is a question of time alone, and :func:`hired` measures it.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from statistics import median

import numpy as np

from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.sensing import Range, RangeMeasurement

Task = Callable[[int], None]

COUNTS = (25_000, 50_000, 100_000, 200_000, 500_000, 1_000_000)
"""Particles at which a crew is tried."""

WORTH = 0.9
"""Share of the time alone that a step with the crew may take for it to be worth calling."""

STEPS = 9


class Threads:
    """A crew of threads of this process, the caller's among them; see :class:`filters.crew.Crew`.

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
        self._errors: list[BaseException] = []
        self._go = [_taken() for _ in range(threads - 1)]
        self._done = [_taken() for _ in range(threads - 1)]
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
        for go in self._go:
            go.release()
        try:
            task(0)
        finally:
            for done in self._done:
                done.acquire()
        if self._errors:
            error = self._errors[0]
            self._errors.clear()
            raise error

    def close(self) -> None:
        """End the threads."""
        self._task = None
        for go in self._go:
            go.release()

    def _work(self, part: int) -> None:
        while True:
            self._go[part - 1].acquire()
            task = self._task
            if task is None:
                return
            try:
                task(part)
            except BaseException as error:  # noqa: BLE001  it is raised where the crew was called
                self._errors.append(error)
            finally:
                self._done[part - 1].release()


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


def _taken() -> threading.Lock:
    """A lock as a gate: who acquires it waits until another has released it. Half as dear as a semaphore."""
    lock = threading.Lock()
    lock.acquire()
    return lock
