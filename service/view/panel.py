"""The live view: everything known of one vehicle on one screen, from 80 by 24 characters up."""

from __future__ import annotations

import math

from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.layout import Layout
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from service.estimate import Budget, Estimate, HealthState, LinkStatus, SensorStatus
from service.view.known import Known
from service.view.plot import Canvas, Point, arrow, frame

HEALTH_STYLES = {
    HealthState.WAITING: "bold white on grey35",
    HealthState.CONVERGING: "bold black on yellow",
    HealthState.TRACKING: "bold black on green",
    HealthState.AMBIGUOUS: "bold black on yellow",
    HealthState.DEAD_RECKONING: "bold black on yellow",
    HealthState.LOST: "bold white on red",
    HealthState.STARVED: "bold white on red",
}
LEVELS = (
    "full",
    "fewer particles than demanded",
    "measurements thinned",
    "extraction cut",
    "shadow Kalman filter speaks",
    "prediction only",
)
UNKNOWN = "–"

_STALE = 1.0
_POSE_WIDTH = 38
_BUDGET_WIDTH = 38
_BUDGET_ROWS = 13
_BAR = 16
_WIDE = 56
_WIDE_COLUMNS, _NARROW_COLUMNS = 6, 4


class Screen:
    """What is known of a vehicle, drawn for the size of the console it is printed on.

    Parameters
    ----------
    known : Known
        What to draw; drawing shows its state of that moment.
    note : str
        One line at the top right: what is going on around it.
    """

    def __init__(self, known: Known, note: str = "") -> None:
        self.known = known
        self.note = note

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the whole screen (rich's protocol)."""
        height = options.height or console.height
        width = options.max_width
        layout = Layout()
        layout.split_column(
            Layout(_header(self.known, self.note), size=1),
            Layout(name="place"),
            Layout(name="work", size=_BUDGET_ROWS if height >= 24 else max(3, height // 2)),
        )
        rows = height - 1 - _BUDGET_ROWS - 2
        layout["place"].split_row(
            Layout(_frame(_pose(self.known.estimate), "belief"), size=_POSE_WIDTH),
            Layout(_frame(_map(self.known, width - _POSE_WIDTH - 4, max(3, rows)), _map_title(self.known))),
        )
        layout["work"].split_row(
            Layout(_frame(_work(self.known.budget), "budget"), size=_BUDGET_WIDTH),
            Layout(_frame(_sources(self.known, width - _BUDGET_WIDTH - 4), "links and sensors")),
        )
        yield from console.render(layout, options.update(height=height))


def metres(value: float | None) -> str:
    """Return metres with two decimals, or a dash."""
    return UNKNOWN if value is None else f"{round(value, 2) + 0.0:.2f}"  # no minus before a zero


def _frame(content: RenderableType, title: str) -> Panel:
    return Panel(content, title=title, title_align="left", border_style="grey50", padding=(0, 1))


def _header(known: Known, note: str) -> Table:
    table = Table.grid(expand=True, padding=(0, 1))
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True, ratio=1, overflow="ellipsis")
    table.add_column(no_wrap=True, justify="right")
    table.add_row(
        Text(f" {known.vehicle}", "bold"), _health(known), _reason(known), Text(f"{note} ", "grey62")
    )
    return table


def _health(known: Known) -> Text:
    silence = known.silence()
    if known.estimate is None or silence is None:
        return Text(" nothing yet ", "bold white on grey35")
    if silence > _STALE:
        return Text(f" silent for {silence:.0f} s ", "bold white on red")
    state = known.estimate.health
    return Text(f" {state.replace('_', ' ')} ", HEALTH_STYLES[state])


def _reason(known: Known) -> Text:
    return Text(known.estimate.reason if known.estimate is not None else "")


def _pose(estimate: Estimate | None) -> RenderableType:
    table = Table.grid(padding=(0, 1))
    table.add_column(style="grey62", no_wrap=True, overflow="ellipsis", min_width=10, max_width=10)
    table.add_column(justify="right", no_wrap=True, min_width=9)
    table.add_column(no_wrap=True, overflow="ellipsis")
    if estimate is None:
        return Text("no estimate has arrived", "grey62")
    for name, position, velocity in zip(
        ("north", "east", "down"), estimate.position, estimate.velocity, strict=True
    ):
        table.add_row(name, f"{metres(position)} m", f"{metres(velocity)} m/s")
    table.add_row("heading", _degrees(estimate.heading), _spread(estimate.heading_variance))
    table.add_row("radius95", f"{metres(estimate.radius95)} m")
    table.add_row("hypotheses", str(estimate.hypotheses), f"{estimate.reset_counter} jumps")
    if estimate.latitude is not None and estimate.longitude is not None:
        table.add_row("lat lon", f"{estimate.latitude:.6f}", f"{estimate.longitude:.6f}")
    for name, (value, sigma) in estimate.biases.items():
        table.add_row(name.replace("_", " "), f"{value:.4f}", f"± {sigma:.4f}")
    return table


def _degrees(heading: float | None) -> str:
    return UNKNOWN if heading is None else f"{math.degrees(heading) % 360.0:.1f}°"


def _spread(variance: float | None) -> str:
    return "" if variance is None else f"± {math.degrees(math.sqrt(variance)):.1f}°"


def _map_title(known: Known) -> str:
    return "map   ◆ beacon" + ("   + truth" if known.truth is not None else "")


def _map(known: Known, columns: int, rows: int) -> Text:
    here = known.position
    landmarks: list[Point] = [*known.beacons.values(), *known.track]
    if here is not None:
        landmarks.append(here)
    if known.truth is not None:
        landmarks.append(known.truth)
    if not landmarks:
        return Text("no position yet", "grey62")
    canvas = Canvas(frame(landmarks, max(columns, 10), rows))
    if here is not None and known.estimate is not None and known.estimate.radius95 is not None:
        canvas.circle(here, known.estimate.radius95, "yellow")
    canvas.dots(known.track, "cyan")
    for beacon in known.beacons.values():
        canvas.sign(beacon, "◆", "magenta")
    if known.truth is not None:
        canvas.sign(known.truth, "+", "bold green")
    if here is not None and known.estimate is not None:
        canvas.sign(here, arrow(known.estimate.heading), "bold white")
    return canvas.text()


def _work(budget: Budget | None) -> RenderableType:
    if budget is None:
        return Text("no budget has arrived", "grey62")
    table = Table.grid(padding=(0, 1))
    table.add_column(no_wrap=True)
    table.add_row(
        Text.assemble(
            (f"{budget.particles:,}", "bold"),
            f" particles of {budget.demanded:,} ",
            ("demanded", "grey62"),
        )
    )
    table.add_row(Text.assemble(f"{budget.afforded:,} ", ("afforded", "grey62")))
    table.add_row(_bar(budget))
    table.add_row(Text(f"level {budget.level}: {LEVELS[min(budget.level, len(LEVELS) - 1)]}"))
    table.add_row(_stages(budget))
    return table


def _bar(budget: Budget) -> Text:
    full = min(_BAR, round(_BAR * max(0.0, budget.use)))
    style = "green" if budget.use <= 1.0 else "red"
    return Text.assemble(
        ("█" * full, style), ("░" * (_BAR - full), "grey50"), f" {budget.use:.0%} of {budget.budget_ms:g} ms"
    )


def _stages(budget: Budget) -> Table:
    table = Table.grid(padding=(0, 1))
    table.add_column(style="grey62", no_wrap=True, min_width=11)
    for _ in range(3):
        table.add_column(justify="right", no_wrap=True, min_width=6)
    table.add_row("ms", Text("median", "grey62"), Text("99 %", "grey62"), Text("worst", "grey62"))
    for name in sorted(budget.stages, key=lambda stage: -budget.stages[stage].median)[:5]:
        cost = budget.stages[name]
        table.add_row(name, f"{cost.median:.2f}", f"{cost.p99:.2f}", f"{cost.worst:.2f}")
    lateness = budget.lateness
    table.add_row("late by", f"{lateness.median:.2f}", f"{lateness.p99:.2f}", f"{lateness.worst:.2f}")
    return table


def _sources(known: Known, width: int) -> RenderableType:
    if known.sensors is None:
        return Text("nothing about links and sensors has arrived", "grey62")
    table = Table.grid(padding=(0, 1))
    columns = _WIDE_COLUMNS if width >= _WIDE else _NARROW_COLUMNS
    table.add_column(no_wrap=True, overflow="ellipsis", max_width=max(8, width - 7 * (columns - 1)))
    for _ in range(columns - 1):
        table.add_column(justify="right", no_wrap=True)
    headings = ("link", "1/s", "state", "bad", "empty", "lost")
    table.add_row(*(Text(heading, "grey62") for heading in headings[:columns]))
    for link in known.sensors.links:
        table.add_row(*_link(known, link)[:columns])
    headings = ("sensor", "Hz", "innov.", "age s", "used", "refused")
    table.add_row(*(Text(heading, "grey62") for heading in headings[:columns]))
    for sensor in known.sensors.sensors:
        table.add_row(*_sensor(sensor)[:columns])
    return table


def _link(known: Known, link: LinkStatus) -> tuple[Text, str, Text, str, str, str]:
    """Return one row; what is honestly empty (no fix, out of range) is in a column apart from what is bad."""
    style = "green" if link.state == "up" else "red" if link.state == "retrying" else "yellow"
    rate = known.message_rate(link)
    name = Text.assemble((link.name, "bold"), " ", (link.reason, "grey62"))
    refused = sum(link.malformed.values()) + link.dropped
    return (
        name,
        UNKNOWN if rate is None else f"{rate:.0f}",
        Text(link.state, style),
        str(refused),
        str(sum(link.unusable.values())),
        "–" if link.lost is None else str(link.lost),
    )


def _sensor(sensor: SensorStatus) -> tuple[Text, str, str, Text, str, str]:
    old = sensor.age is None or sensor.age > _STALE
    return (
        Text(sensor.name, "grey50" if old else ""),
        f"{sensor.rate:.1f}",
        UNKNOWN if sensor.innovation is None else f"{sensor.innovation:+.2f}",
        Text(UNKNOWN if sensor.age is None else f"{sensor.age:.1f}", "yellow" if old else ""),
        str(sensor.accepted),
        str(sum(sensor.refused.values())),
    )
