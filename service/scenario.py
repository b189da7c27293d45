"""``beliefd scenario``: a simulated vehicle, end to end through message bytes, over many seeds.

Every seed is another vehicle: its own biases, noise and drive. The simulator is another program and writes what a
vehicle would have sent (telemetry and CAN frames), its truth, and the configuration that fits; the estimator gets the
bytes and nothing else.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from service.checks import judge, read_events
from service.replay.command import PARTICLES
from service.replay.run import Plan, Run, replay
from service.replay.seeds import summary
from service.replay.site import setting_of
from service.replay.table import show, show_checks
from service.score import read_truth
from service.switches import switched_off, unknown_switches

SIMULATOR = (sys.executable, "-m", "sim_vehicle")


class ScenarioError(Exception):
    """The simulator could not do its part; the text holds what it said."""


@dataclass(frozen=True)
class Play:
    """How a scenario is played.

    Attributes
    ----------
    seconds : float or None
        How long; ``None``: as long as the scenario says.
    without : tuple[str, ...]
        Switches of ``[honesty]`` that are turned off.
    """

    seconds: float | None = None
    without: tuple[str, ...] = ()


AS_IT_IS = Play()


def simulate(name: str, seed: int, stem: Path, seconds: float | None = None) -> None:
    """Write the recording, truth and configuration of one simulated drive to ``stem`` with their endings.

    Raises
    ------
    ScenarioError
        There is no such scenario, or the simulator failed.
    """
    length = () if seconds is None else ("--seconds", str(seconds))
    done = subprocess.run(
        [*SIMULATOR, name, "--seed", str(seed), "--write", str(stem), *length],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise ScenarioError(
            (done.stderr or done.stdout).strip() or f"the simulator ended with {done.returncode}"
        )


def run_once(name: str, seed: int, play: Play = AS_IT_IS) -> Run:
    """Simulate ``name`` with ``seed``, replay what it sent, and ask of the run what the scenario asks."""
    with tempfile.TemporaryDirectory(prefix="beliefd-scenario-") as folder:
        stem = Path(folder) / name
        simulate(name, seed, stem, play.seconds)
        logs = tuple(
            path
            for ending in (".tlog", ".candump.log")
            if (path := stem.with_name(name + ending)).is_file() and path.stat().st_size > 0
        )
        setting = setting_of(logs, stem.with_name(name + ".toml"), stem.with_name(name + "_truth.csv"))
        truth = read_truth(setting.truth) if setting.truth else None
        configuration = switched_off(setting.configuration, play.without)
        run = replay(Plan(logs, configuration, PARTICLES, truth), seed)
        if run.story is not None and truth is not None:
            table = stem.with_name(name + "_events.csv")
            story = run.story.beside(truth, read_events(table) if table.is_file() else ())
            run = replace(run, checks=judge(name, story))
        return replace(run, seed=seed)


def run_seeds(name: str, seeds: int, console: Console, play: Play = AS_IT_IS) -> list[Run]:
    """Run ``name`` for the seeds 0 … ``seeds`` - 1 in a pool of processes, with a progress bar."""
    if seeds == 1:
        return [run_once(name, 0, play)]
    context = multiprocessing.get_context("spawn")
    workers = min(seeds, os.cpu_count() or 1)
    with (
        Progress(console=console, transient=True) as progress,
        ProcessPoolExecutor(workers, context) as pool,
    ):
        task = progress.add_task(name, total=seeds)
        futures = {pool.submit(run_once, name, seed, play): seed for seed in range(seeds)}
        runs: list[Run] = []
        for future in as_completed(futures):
            runs.append(future.result())
            progress.advance(task)
    return sorted(runs, key=lambda run: run.seed)


def list_scenarios(console: Console) -> int:
    """Print what the simulator can play; return the exit status."""
    listed = subprocess.run([*SIMULATOR], capture_output=True, text=True, check=False)
    console.print(listed.stdout.strip() or listed.stderr.strip(), highlight=False, markup=False)
    return 0 if listed.stdout.strip() else 1


def command(name: str | None, seeds: int, as_json: bool, play: Play = AS_IT_IS) -> int:
    """Run ``beliefd scenario`` and return its exit status."""
    console = Console(stderr=as_json)
    if name is None:
        return list_scenarios(Console())
    if wrong := unknown_switches(play.without):
        console.print(wrong, highlight=False, markup=False, style="red")
        return 2
    try:
        runs = run_seeds(name, seeds, console, play)
    except ScenarioError as error:
        console.print(str(error), highlight=False, markup=False, style="red")
        return 2 if "no scenario" in str(error).lower() else 1
    if as_json:
        print(json.dumps({"runs": [run.row() for run in runs], "summary": summary(runs)}))  # noqa: T201
    else:
        show(runs, console, f"scenario {name}")
        show_checks(runs, console)
    return 0
