"""The figures of a report, by Bokeh; each has a title, a sentence of what to see, and a key to its colours.

Plots are as wide as the page lets them be. A drag does nothing until a tool is chosen, so that a thumb
scrolls the page. All plots over time share one axis: what is looked at closely in one is looked at in all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.report import palette
from service.report.library import empty_figure, models
from service.report.series import Column, Series, ellipses, stretches_of_health

TOOLS = "pan,box_zoom,wheel_zoom,reset,save"
HEIGHT = 260
NEES_MEAN = 2.0
NEES_BOUNDS = (0.0506, 7.378)
"""2.5 % and 97.5 % quantiles of chi-square with two degrees of freedom."""

BAND = {1: 1.96, 2: 2.448}
"""What 95 % of the normalised innovations stay below, by their dimension; of two, it is the length that is shown."""


@dataclass(frozen=True)
class Key:
    """One entry of a plot's key: what it looks like (``line``, ``dash``, ``dot``, ``area``), its colour and meaning."""

    shape: str
    colour: str
    meaning: str


@dataclass(frozen=True)
class Plot:
    """A figure for the page."""

    name: str
    title: str
    caption: str
    figure: Any
    keys: list[Key] = field(default_factory=list[Key])


PARTICLES_KEY = Key("line", palette.PARTICLES, "particle filter")
SHADOW_KEY = Key("line", palette.SHADOW, "extended Kalman filter, same samples")


class Canvas:
    """Makes figures alike, over one source of ticks and one axis of time."""

    def __init__(self, series: Series) -> None:
        self.series = series
        columns = {name: column.astype(np.float32) for name, column in series.ticks.items()}
        radius = columns["radius95"]
        columns["zero"] = np.zeros_like(radius)
        self.source = models.ColumnDataSource(columns)
        end = float(series.ticks["time"][-1])
        self.span = models.Range1d(0.0, end, bounds=(0.0, end))

    def plain(self, **options: Any) -> Any:
        """Return an empty figure in the report's looks."""
        made = empty_figure(
            tools=TOOLS,
            active_drag=None,
            active_scroll=None,
            active_tap=None,
            sizing_mode="stretch_width",
            min_width=200,
            **{"height": HEIGHT, "toolbar_location": "above"} | options,
        )
        made.toolbar.logo = None
        made.toolbar.autohide = False
        made.outline_line_color = None
        made.background_fill_color = "#FFFFFF"
        made.border_fill_color = "#FFFFFF"
        made.min_border_right = 12
        for axis in made.axis:
            axis.axis_label_text_font_size = "13px"
            axis.axis_label_text_font_style = "normal"
            axis.major_label_text_font_size = "12px"
            axis.axis_line_color = "#999999"
            axis.major_tick_line_color = "#999999"
            axis.minor_tick_line_color = None
        made.grid.grid_line_color = "#ECECEC"
        return made

    def over_time(self, label: str, **options: Any) -> Any:
        """Return an empty figure over the shared axis of time."""
        made = self.plain(x_range=self.span, x_axis_label="seconds", y_axis_label=label, **options)
        made.xaxis.ticker.desired_num_ticks = 5
        return made

    def line(self, made: Any, name: str, colour: str, **options: Any) -> Any:
        """Draw one column of the ticks over time."""
        look = {"line_width": 1.6, "line_color": colour, "line_join": "round"} | options
        return made.line("time", name, source=self.source, **look)

    def hover(self, made: Any, renderer: Any, tips: list[tuple[str, str]]) -> None:
        """Tell the values under the pointer."""
        tool = models.HoverTool(
            renderers=[renderer], tooltips=[("time", "@time{0.0} s"), *tips], mode="vline"
        )
        made.add_tools(tool)
        made.toolbar.active_inspect = tool


def level(made: Any, at: float, dash: str = "dashed") -> None:
    """Draw a horizontal line."""
    made.add_layout(
        models.Span(location=at, dimension="width", line_color=palette.BOUND, line_dash=dash, line_width=1)
    )


def track(canvas: Canvas) -> Plot:
    """Where the vehicle was taken to be, and was."""
    made = canvas.plain(
        height=420,
        x_axis_label="east, m",
        y_axis_label="north, m",
        match_aspect=True,
        name="track",
        min_border_left=72,
    )
    made.xaxis.ticker.desired_num_ticks = 5
    keys: list[Key] = []
    region = ellipses(canvas.series.ticks)
    made.ellipse(
        region.east,
        region.north,
        width=region.minor,
        height=region.major,
        angle=-region.direction,
        fill_color=palette.REGION,
        fill_alpha=0.22,
        line_color=palette.REGION,
        line_alpha=0.8,
    )
    if canvas.series.truth is not None:
        north, east = canvas.series.truth.astype(np.float32)
        made.line(east, north, line_color=palette.TRUTH, line_width=2.2, line_dash="dashed")
        keys.append(Key("dash", palette.TRUTH, "truth"))
    made.line("shadow_east", "shadow_north", source=canvas.source, line_color=palette.SHADOW, line_width=1.2)
    own = made.line("east", "north", source=canvas.source, line_color=palette.PARTICLES, line_width=1.6)
    tips = [("time", "@time{0.0} s"), ("north", "@north{0.00} m"), ("east", "@east{0.00} m")]
    made.add_tools(models.HoverTool(renderers=[own], tooltips=[*tips, ("95 % within", "@radius95{0.00} m")]))
    began = np.isfinite(canvas.series.ticks["shadow_north"]).any()
    keys += [PARTICLES_KEY, *([SHADOW_KEY] if began else [])]
    keys.append(Key("area", palette.REGION, "95 % regions, evenly spaced in time"))
    return Plot(
        "track", "Track", "North is up. The regions should hold the truth 95 % of the time.", made, keys
    )


def error(canvas: Canvas) -> Plot:
    """How far off it was, beside how far off it claimed to be at most."""
    ticks = canvas.series.ticks
    made = canvas.over_time("error, m", name="error")
    made.varea("time", "zero", "radius95", source=canvas.source, fill_color=palette.REGION, fill_alpha=0.25)
    canvas.line(made, "shadow_error", palette.SHADOW, line_width=1.2)
    own = canvas.line(made, "error", palette.PARTICLES)
    tips = [("error", "@error{0.00} m"), ("95 % within", "@radius95{0.00} m")]
    canvas.hover(made, own, [*tips, ("Kalman's error", "@shadow_error{0.00} m")])
    made.y_range = models.Range1d(0.0, _top(ticks["radius95"], ticks["error"], ticks["shadow_error"]))
    area = Key("area", palette.REGION, "radius that should hold 95 %")
    return Plot(
        "error",
        "Error",
        "Horizontal distance from the truth. The line should leave the shaded radius one time in twenty.",
        made,
        [PARTICLES_KEY, SHADOW_KEY, area],
    )


def radius(canvas: Canvas) -> Plot:
    """How far off it claimed to be at most, where there is no truth to compare with."""
    made = canvas.over_time("radius, m", name="radius")
    own = canvas.line(made, "radius95", palette.PARTICLES)
    canvas.hover(made, own, [("95 % within", "@radius95{0.00} m")])
    made.y_range = models.Range1d(0.0, _top(canvas.series.ticks["radius95"]))
    keys = [Key("line", palette.PARTICLES, "radius that should hold 95 %")]
    return Plot("radius", "95 % radius", "There is no truth to compare with.", made, keys)


def nees(canvas: Canvas) -> Plot:
    """Whether the claim was right: the error normalised by the covariance."""
    made = canvas.over_time("NEES", y_axis_type="log", name="nees")
    low, high = NEES_BOUNDS
    made.add_layout(models.BoxAnnotation(bottom=low, top=high, fill_color=palette.REGION, fill_alpha=0.15))
    level(made, NEES_MEAN)
    canvas.line(made, "shadow_nees", palette.SHADOW, line_width=1.0, line_alpha=0.7)
    own = canvas.line(made, "nees", palette.PARTICLES, line_width=1.6)
    canvas.hover(made, own, [("NEES", "@nees{0.00}"), ("Kalman's", "@shadow_nees{0.00}")])
    ticks = canvas.series.ticks
    made.y_range = models.Range1d(0.005, max(30.0, 1.2 * _top(ticks["nees"])))
    keys = [
        PARTICLES_KEY,
        SHADOW_KEY,
        Key("area", palette.REGION, f"95 % of all ticks, {low:.2f} to {high:.2f}"),
        Key("dash", palette.BOUND, "its mean, 2"),
    ]
    caption = (
        "Squared error over what was claimed (2 degrees of freedom). Above: overconfident. Below: too wide."
    )
    return Plot("nees", "Normalised error squared", caption, made, keys)


def innovations(canvas: Canvas) -> list[Plot]:
    """What each sensor's readings said of the belief: one plot a kind of sensor."""
    kinds: dict[str, list[str]] = {}
    for name in canvas.series.innovations:
        kinds.setdefault(name.split("/")[0], []).append(name)
    return [_innovations_of(canvas, kind, names) for kind, names in kinds.items()]


def _innovations_of(canvas: Canvas, kind: str, names: list[str]) -> Plot:
    made = canvas.over_time("sigmas", name=f"innovations-{kind}")
    dimensions = max(canvas.series.innovations[name].dimensions for name in names)
    band = BAND.get(dimensions, BAND[1])
    bottom = 0.0 if dimensions > 1 else -band
    made.add_layout(models.BoxAnnotation(bottom=bottom, top=band, fill_color=palette.REGION, fill_alpha=0.15))
    keys: list[Key] = []
    outliers = 0
    for index, name in enumerate(names):
        colour = palette.SERIES[index % len(palette.SERIES)]
        readings = canvas.series.innovations[name]
        size = np.clip(readings.value / readings.sigma, -OFF_SCALE, OFF_SCALE).astype(np.float32)
        time, refused = readings.time.astype(np.float32), readings.outlier
        shown = name.partition("/")[2]
        _dots(made, time[~refused], size[~refused], colour)
        made.scatter(time[refused], size[refused], marker="x", size=6, line_color=palette.OUTLIER)
        outliers += int(refused.sum())
        keys.append(Key("dot", colour, shown))
    if outliers:
        keys.append(Key("cross", palette.OUTLIER, "taken for outliers"))
    keys.append(Key("area", palette.REGION, "95 % of them belong here"))
    length = " (length of the vector)" if dimensions > 1 else ""
    caption = f"Measured less expected, over its standard deviation{length}; beyond ±{OFF_SCALE:.0f} drawn at the edge."
    return Plot(f"innovations-{kind}", f"Innovations: {kind}", caption, made, keys)


OFF_SCALE = 8.0
"""Sigmas beyond which an innovation is drawn at the edge."""


def _dots(made: Any, time: NDArray[np.float32], size: NDArray[np.float32], colour: str) -> None:
    made.scatter(time, size, size=3.5, fill_color=colour, line_color=None, fill_alpha=0.6)


def counts(canvas: Canvas) -> Plot:
    """How many particles there were, were needed, and could be afforded."""
    made = canvas.over_time("particles", name="particles", y_axis_type="log")
    looks: tuple[tuple[str, str, str, str], ...] = (
        ("afforded", palette.BOUND, "dashed", "afforded"),
        ("demanded", palette.SHADOW, "solid", "demanded by the belief's spread (KLD bound)"),
        ("particles", palette.PARTICLES, "solid", "in use"),
    )
    for name, colour, dash, _ in looks:
        canvas.line(made, name, colour, line_dash=dash)
    canvas.hover(made, made.renderers[-1], [(name, f"@{name}{{0}}") for name, *_ in reversed(looks)])
    most = max(float(np.nanmax(canvas.series.ticks[name])) for name, *_ in looks)
    made.y_range = models.Range1d(50.0, max(100.0, 1.6 * most))
    keys = [Key("dash" if dash == "dashed" else "line", colour, words) for _, colour, dash, words in looks]
    caption = "Where fewer are in use than demanded, the tick was thinned (level 1)."
    return Plot("particles", "Particles", caption, made, keys)


def slow_states(canvas: Canvas) -> list[Plot]:
    """What was learned on the way, with its standard deviation."""
    return [_slow_state(canvas, name) for name in canvas.series.slow]


def _slow_state(canvas: Canvas, name: str) -> Plot:
    value, sigma = canvas.series.ticks[f"slow/{name}"], canvas.series.ticks[f"slow_sigma/{name}"]
    made = canvas.over_time(
        UNITS.get(name.partition("/")[0], name.replace("_", " ")), name=f"slow-{name}", height=220
    )
    lower, upper = value - 2.0 * sigma, value + 2.0 * sigma
    canvas.source.data[f"lower/{name}"] = lower.astype(np.float32)
    canvas.source.data[f"upper/{name}"] = upper.astype(np.float32)
    made.varea(
        "time",
        f"lower/{name}",
        f"upper/{name}",
        source=canvas.source,
        fill_color=palette.REGION,
        fill_alpha=0.3,
    )
    own = canvas.line(made, f"slow/{name}", palette.PARTICLES)
    canvas.hover(
        made,
        own,
        [("value", f"@{{slow/{name}}}{{0.00000}}"), ("sigma", f"@{{slow_sigma/{name}}}{{0.00000}}")],
    )
    keys = [Key("line", palette.PARTICLES, "mean"), Key("area", palette.REGION, "± 2 sigma")]
    title = name.replace("_", " ").capitalize()
    return Plot(
        f"slow-{name}", title, "Estimated with the pose; the band narrows as it is learned.", made, keys
    )


UNITS = {
    "gyro_bias": "rad/s",
    "odometry_scale": "true / counted",
    "range_scale": "read / true",
    "range_bias": "m",
}


def health(canvas: Canvas) -> Plot:
    """What the belief was worth."""
    ticks = canvas.series.ticks
    made = canvas.over_time(
        "", height=80, toolbar_location=None, y_range=models.Range1d(0.0, 1.0), name="health"
    )
    made.yaxis.visible = False
    made.grid.visible = False
    told = stretches_of_health(ticks["time"], ticks["health"])
    columns = {
        "left": [s.begin for s in told],
        "right": [s.end for s in told],
        "state": [s.state.replace("_", " ") for s in told],
        "colour": [palette.HEALTH[s.state] for s in told],
    }
    band = made.quad(
        left="left",
        right="right",
        bottom=0.0,
        top=1.0,
        fill_color="colour",
        line_color=None,
        source=models.ColumnDataSource(columns),
    )
    made.add_tools(
        models.HoverTool(
            renderers=[band],
            tooltips=[("health", "@state"), ("from", "@left{0.0} s"), ("to", "@right{0.0} s")],
        )
    )
    present = dict.fromkeys(s.state for s in told)
    keys = [Key("area", palette.HEALTH[state], state.replace("_", " ")) for state in present]
    return Plot("health", "Health", "What the daemon would have said the belief is worth.", made, keys)


def _top(*columns: Column) -> float:
    """Return a top for an axis: above all but the wildest half per cent of each column."""
    tops = [float(np.nanquantile(c, 0.995)) for c in columns if np.isfinite(c).any()]
    return 1.25 * max(tops, default=1.0) or 1.0


def plots(series: Series) -> list[Plot]:
    """Return every figure of the page, in its order."""
    canvas = Canvas(series)
    against_truth: list[Callable[[Canvas], Plot]] = [error, nees] if series.truth is not None else [radius]
    made = [track(canvas), health(canvas)]
    made += [draw(canvas) for draw in against_truth]
    made += innovations(canvas)
    made.append(counts(canvas))
    return made + slow_states(canvas)
