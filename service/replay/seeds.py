"""Many seeds of one replay, side by side in processes, with their progress and their spread."""

from __future__ import annotations

import multiprocessing
import os
import statistics
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, wait
from multiprocessing.queues import SimpleQueue

from service.consistency import bounds
from service.replay.outage import Outage
from service.replay.run import Plan, Run, replay

Report = Callable[[int, float, float], None]
"""Called with a seed, the share of its log that is done, and how many seconds of the log that was."""

Step = tuple[int, float, float]
_progress: SimpleQueue[Step] | None = None


def _begin(queue: SimpleQueue[Step]) -> None:
    global _progress  # noqa: PLW0603  a pool hands its workers nothing else
    _progress = queue


def _work(plan: Plan, seed: int) -> Run:
    queue = _progress
    if queue is None:
        return replay(plan, seed)
    return replay(plan, seed, lambda share, seconds: queue.put((seed, share, seconds)))


def replay_seeds(plan: Plan, seeds: list[int], report: Report, processes: int | None = None) -> list[Run]:
    """Replay ``plan`` once per seed and return the runs in the order of the seeds.

    One seed runs here; several run in a pool of ``processes`` (default: one per processor).
    """
    if len(seeds) == 1:
        return [replay(plan, seeds[0], lambda share, seconds: report(seeds[0], share, seconds))]
    context = multiprocessing.get_context("spawn")
    queue: SimpleQueue[Step] = context.SimpleQueue()
    workers = min(len(seeds), processes or os.cpu_count() or 1)
    with ProcessPoolExecutor(workers, context, initializer=_begin, initargs=(queue,)) as pool:
        futures = {pool.submit(_work, plan, seed): seed for seed in seeds}
        pending = set(futures)
        while pending:
            done, pending = wait(pending, timeout=0.1)
            while not queue.empty():
                report(*queue.get())
            for future in done:
                future.result()
        while not queue.empty():
            report(*queue.get())
        return [future.result() for future in sorted(futures, key=lambda f: futures[f])]


SCORES = (
    "rmse_m",
    "mean_m",
    "p95_m",
    "max_m",
    "coverage_95",
    "nees_mean",
    "final_m",
    "coverage_50",
    "coverage_99",
    "log_score",
)
OUTAGE = ("error_m", "radius_m", "distance_m", "share", "coverage_95")
SUMMARISED = (*SCORES, "particles_mean", "real_time_factor", "tracked_after_s")


def summary(runs: list[Run]) -> dict[str, object]:
    """Return mean, standard deviation, least and greatest over the seeds of every figure, and the health shares.

    ``shadow`` holds the same of the extended Kalman filter, and how many innovations its gate kept out; ``checks`` the
    questions of a scenario, by name: passed by how many of how many, and the figures found; ``outages`` what became of
    each blanking, and ``shadow_outages`` the Kalman filter's; ``nees_bounds`` where the
    mean NEES of a consistent filter lies with 95 %, given how many independent ticks all runs are worth.
    """
    spread: dict[str, object] = {"seeds": len(runs)}
    spread |= _spreads([run.row() for run in runs], SUMMARISED)
    states = sorted({state for run in runs for state in run.health})
    spread["health"] = {s: round(statistics.fmean(run.health.get(s, 0.0) for run in runs), 4) for s in states}
    shadows = [run.shadow.row() | {"gated": sum(run.shadow.gated.values())} for run in runs]
    spread["shadow"] = _spreads(shadows, (*SCORES, "gated", "ticks"))
    spread["outages"] = _fared([run.outages for run in runs])
    spread["shadow_outages"] = _fared([run.shadow_outages for run in runs])
    spread["checks"] = _answers(runs)
    worth = [run.score.nees_samples for run in runs if run.score.nees_samples is not None]
    spread["nees_bounds"] = [round(bound, 4) for bound in bounds(sum(worth))] if worth else None
    return spread


def _fared(outages: list[list[Outage]]) -> list[dict[str, object]]:
    """Return the spreads of each blanking's figures over the seeds that have as many of them."""
    told = [given for given in outages if len(given) == len(outages[0])]
    return [
        {"what": given[0].what, **_spreads([one.rounded() for one in given], OUTAGE)}
        for given in zip(*told, strict=True)
    ]


def _answers(runs: list[Run]) -> dict[str, object]:
    answers: dict[str, object] = {}
    for index, check in enumerate(runs[0].checks):
        given = [run.checks[index] for run in runs]
        answers[check.name] = {
            "passed": sum(one.passed for one in given),
            "of": len(given),
            "found": [one.found for one in given],
        }
    return answers


def _spreads(rows: Sequence[Mapping[str, object]], names: tuple[str, ...]) -> dict[str, object]:
    spreads: dict[str, object] = {}
    for name in names:
        values = [float(value) for row in rows if isinstance(value := row[name], int | float)]
        if values:
            spreads[name] = {
                "mean": round(statistics.fmean(values), 4),
                "sd": round(statistics.stdev(values), 4) if len(values) > 1 else 0.0,
                "min": round(min(values), 4),
                "max": round(max(values), 4),
            }
    return spreads
