"""Threads that are lent: every part once, errors where they were called for, and no thread for one."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.sensing import Range, RangeMeasurement
from service import crew as module
from service.crew import Threads, hired


@pytest.mark.parametrize("threads", [1, 2, 4])
def test_every_part_is_done_once_on_a_thread_of_its_own(threads: int) -> None:
    crew = Threads(threads)
    for _ in range(200):
        seen: list[tuple[int, int]] = []
        crew.run(lambda part, seen=seen: seen.append((part, threading.get_ident())))
        assert sorted(part for part, _ in seen) == list(range(threads))
        assert len({who for _, who in seen}) == threads
    crew.close()


@pytest.mark.parametrize("failing", [0, 1])
def test_what_a_part_raises_is_raised_to_the_caller(failing: int) -> None:
    crew = Threads(2)

    def task(part: int) -> None:
        if part == failing:
            raise KeyError(part)

    for _ in range(2):
        with pytest.raises(KeyError):
            crew.run(task)
    crew.run(lambda part: None)
    crew.close()


def test_a_crew_has_somebody() -> None:
    with pytest.raises(ValueError, match="at least one"):
        Threads(0)


def test_threads_change_no_byte() -> None:
    said: list[bytes] = []
    crew = Threads(2)
    for helpers in (None, crew):
        belief = ParticleFilter(Unicycle(0.5, 0.2, 1e-3, 1e-3), capacity=40_000, seed=1, crew=helpers)
        belief.initialize({name: np.linspace(-1.0, 1.0, 40_000) for name in belief.names})
        for _ in range(20):
            belief.predict(UnicycleControl(0.1, 0.1), 0.1)
            belief.weigh(Range(0.4), RangeMeasurement(5.0, 3.0, 4.0))
            moments = belief.moments()
            belief.resample()
        said.append(moments.mean.tobytes() + belief.columns.tobytes())
    crew.close()
    assert said[0] == said[1]


def test_nobody_is_hired_for_one_thread() -> None:
    before = threading.active_count()
    assert hired(1, 1_000_000) is None
    assert threading.active_count() == before


def test_a_crew_is_hired_only_where_it_pays(monkeypatch: pytest.MonkeyPatch) -> None:
    def cost(count: int, crew: Threads | None) -> float:
        return count * 1e-8 if crew is None else 4e-4 + 0.5e-8 * count

    monkeypatch.setattr(module, "_cost", cost)
    crew = hired(2, 1_000_000)
    assert crew is not None
    assert crew.fewest == 100_000
    crew.close()
    assert hired(2, 60_000) is None
