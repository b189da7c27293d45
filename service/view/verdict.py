"""What the demonstration says at its end: the error against the truth, and whether the chain has worked."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
from rich.table import Table
from rich.text import Text

from service.config import Configuration
from service.estimate import Budget, Estimate, Sensors
from service.publish.topics import BUDGET, ESTIMATE, SENSORS
from service.score import UNSCORED, Score, Track, read_truth, score

SANE = 1.0
"""Metres of horizontal RMSE that a rover with odometry and four beacons must not exceed."""


class Record:
    """Everything that arrived and matters at the end."""

    def __init__(self) -> None:
        self.estimates: list[Estimate] = []
        self.budgets: list[Budget] = []
        self.sensors: Sensors | None = None

    def take(self, topic: str, payload: bytes) -> None:
        """Take one value as it came."""
        if topic == ESTIMATE.key:
            self.estimates.append(msgspec.json.decode(payload, type=Estimate))
        elif topic == BUDGET.key:
            self.budgets.append(msgspec.json.decode(payload, type=Budget))
        elif topic == SENSORS.key:
            self.sensors = msgspec.json.decode(payload, type=Sensors)


@dataclass(frozen=True)
class Verdict:
    """The figures of one run.

    Attributes
    ----------
    score : Score
        Against the truth, at the estimates' own times.
    within_radius : float or None
        Share of the estimates whose ``radius95`` holds the truth.
    estimates, lost : int
        How many arrived, and how many more the sequence says there were.
    health : dict[str, float]
        Share of the estimates in each state.
    samples, used : dict[str, int]
        By link: samples made of its bytes, and readings the estimator used.
    budget : Budget or None
        The last one.
    use : float or None
        Mean share of the budget used.
    failures : tuple[str, ...]
        What is not as it should be; nothing when all is well.
    """

    estimates: int
    score: Score
    within_radius: float | None
    lost: int
    health: dict[str, float]
    samples: dict[str, int]
    used: dict[str, int]
    budget: Budget | None
    use: float | None
    failures: tuple[str, ...]

    def table(self) -> Table:
        """Return the summary to print."""
        table = Table.grid(padding=(0, 2))
        table.add_column(style="grey62")
        table.add_column()
        table.add_row("estimates", f"{self.estimates:,} received, {self.lost} lost on the way")
        table.add_row("error", _error(self.score))
        table.add_row("coverage", _coverage(self.score, self.within_radius))
        if self.budget is not None and self.use is not None:
            table.add_row(
                "ticks",
                f"{self.budget.ticks:,} at {self.budget.rate:g} Hz, {self.budget.missed_ticks} missed, "
                f"{self.budget.overruns} over the budget",
            )
            table.add_row("budget", f"{self.use:.0%} of {self.budget.budget_ms:g} ms used")
        shares = ", ".join(f"{state.replace('_', ' ')} {share:.0%}" for state, share in self.health.items())
        table.add_row("health", shares or "none")
        for link, samples in self.samples.items():
            table.add_row(f"link {link}", f"{samples:,} samples, {self.used.get(link, 0):,} readings used")
        for failure in self.failures:
            table.add_row(Text("failed", "bold red"), Text(failure, "red"))
        return table


def judge(record: Record, configuration: Configuration, truth: Path) -> Verdict:
    """Return the figures, and what is not as it should be."""
    placed = [estimate for estimate in record.estimates if None not in estimate.position[:2]]
    measured, within = _against(placed, truth)
    links = [link.name for link in configuration.link]
    statuses = {status.name: status.samples for status in record.sensors.links} if record.sensors else {}
    used = {link: _used(record.sensors, link) for link in links}
    sequences = [estimate.sequence for estimate in record.estimates]
    counts = Counter(str(estimate.health) for estimate in record.estimates)
    return Verdict(
        estimates=len(sequences),
        score=measured,
        within_radius=within,
        lost=sequences[-1] - sequences[0] + 1 - len(sequences) if sequences else 0,
        health={state: count / len(sequences) for state, count in counts.most_common()},
        samples={link: statuses.get(link, 0) for link in links},
        used=used,
        budget=record.budgets[-1] if record.budgets else None,
        use=float(np.mean([budget.use for budget in record.budgets])) if record.budgets else None,
        failures=tuple(_failures(len(sequences), measured, statuses, links)),
    )


def _failures(received: int, measured: Score, samples: dict[str, int], links: list[str]) -> list[str]:
    failures: list[str] = []
    if not received:
        failures.append("no estimate arrived")
    failures += [f"link {link} brought no samples" for link in links if not samples.get(link)]
    if measured.rmse_m is None:
        failures.append("no estimate had a position while the truth was known")
    elif measured.rmse_m > SANE:
        failures.append(f"the error of {measured.rmse_m:.2f} m RMSE is more than {SANE:g} m")
    return failures


def _against(placed: list[Estimate], truth_file: Path) -> tuple[Score, float | None]:
    if not placed or not truth_file.exists():
        return UNSCORED, None
    truth = read_truth(truth_file)
    rows = np.array(
        [
            (
                estimate.time,
                *estimate.position[:2],
                estimate.position_covariance[0],
                estimate.position_covariance[1],
                estimate.position_covariance[3],
                estimate.radius95,
            )
            for estimate in placed
        ],
        np.float64,
    )
    time, north, east = rows[:, 0], rows[:, 1], rows[:, 2]
    true_north, true_east = truth.at(time)
    compared = np.isfinite(true_north) & np.isfinite(rows[:, 6])
    inside = np.hypot(north - true_north, east - true_east)[compared] <= rows[compared, 6]
    share = float(np.mean(inside)) if inside.size else None
    return score(Track(time, north, east, rows[:, 3:6]), truth), share


def _used(sensors: Sensors | None, link: str) -> int:
    if sensors is None:
        return 0
    return sum(sensor.accepted for sensor in sensors.sensors if link in sensor.name.split("/")[1:])


def _error(measured: Score) -> str:
    if measured.rmse_m is None or measured.p95_m is None or measured.max_m is None:
        return "unknown: nothing to compare"
    return f"{measured.rmse_m:.2f} m RMSE, {measured.p95_m:.2f} m for 95 %, {measured.max_m:.2f} m at worst"


def _coverage(measured: Score, within: float | None) -> str:
    if measured.coverage_95 is None or within is None:
        return "unknown"
    return f"{within:.0%} inside radius95, {measured.coverage_95:.0%} inside the 95 % ellipse"
