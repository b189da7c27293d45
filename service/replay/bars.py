"""The progress bar of a replay: one over all seeds, with how much faster than real time they run."""

from __future__ import annotations

import time

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from service.replay.run import Plan, Run
from service.replay.seeds import replay_seeds

COLUMNS = (
    TextColumn("{task.description}"),
    BarColumn(20),
    TextColumn("{task.percentage:3.0f} %"),
    TextColumn("{task.fields[done]}"),
    TextColumn("{task.fields[speed]}"),
    TimeElapsedColumn(),
    TimeRemainingColumn(),
)


class Advance:
    """How far every seed has come, in words and numbers for one bar.

    Parameters
    ----------
    seeds : int
        How many there are.
    """

    def __init__(self, seeds: int) -> None:
        self._seeds = seeds
        self._shares: dict[int, float] = {}
        self._seconds: dict[int, float] = {}
        self._began = time.perf_counter()

    def note(self, seed: int, share: float, seconds: float) -> None:
        """Note that ``seed`` has done ``share`` of its log, ``seconds`` of it."""
        self._shares[seed] = share
        self._seconds[seed] = seconds

    @property
    def completed(self) -> float:
        """Seeds done, with the parts of those that run."""
        return sum(self._shares.values())

    @property
    def done(self) -> str:
        """How many seeds are through."""
        if self._seeds == 1:
            return ""
        through = sum(share >= 1.0 for share in self._shares.values())
        return f"{through} of {self._seeds} seeds"

    @property
    def speed(self) -> str:
        """Seconds of log replayed in each second that passed, over all processes."""
        return speed_in_words(sum(self._seconds.values()) / max(1e-9, time.perf_counter() - self._began))


def speed_in_words(factor: float) -> str:
    """Return a real-time factor as it is shown everywhere."""
    return f"x{factor:.0f} real time"


def run_with_bars(plan: Plan, seeds: list[int], console: Console) -> list[Run]:
    """Run ``plan`` for ``seeds``, with one bar over all of them."""
    advance = Advance(len(seeds))
    with Progress(*COLUMNS, console=console, transient=True) as progress:
        name = ", ".join(path.name for path in plan.logs)
        task = progress.add_task(name, total=float(len(seeds)), done=advance.done, speed="")

        def report(seed: int, share: float, seconds: float) -> None:
            advance.note(seed, share, seconds)
            progress.update(task, completed=advance.completed, done=advance.done, speed=advance.speed)

        return replay_seeds(plan, seeds, report)
