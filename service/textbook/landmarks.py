"""The lecture's robot among landmarks, and the 2 that its Gaussian forgets."""

from __future__ import annotations

import numpy as np

from filters.textbook import landmarks
from service.textbook.exhibit import Exhibit, Table, number
from service.textbook.style import BLUE, GREEN, GREY, ORANGE, RED, cloud, label, panels, sheet


def robot() -> Exhibit:
    """Localize by ranges only, and count how often the truth is where the belief claims it."""
    stages, found = landmarks.localize(), landmarks.coverage()
    figure = sheet(10.4, 5.6)
    shown = panels(figure, 2, 4)
    for axis, stage in zip(shown, stages, strict=False):
        north, east, _, weight = stage.cloud.astype(np.float64).T
        cloud(axis, east, north, 0.5 * np.sqrt(weight / weight.max()), BLUE)
        axis.plot(*np.array(landmarks.LANDMARKS).T[::-1], "^", color="black", markersize=5)
        axis.plot(stage.truth[1], stage.truth[0], "x", color=RED, markersize=7, markeredgewidth=1.6)
        axis.plot(stage.estimate[1], stage.estimate[0], "+", color=GREEN, markersize=8, markeredgewidth=1.6)
        label(axis, stage.name, "east, m", "north, m")
        axis.set_aspect("equal")
        axis.set_xlim(0.0, landmarks.SIDE)
        axis.set_ylim(0.0, landmarks.SIDE)
    last = shown[-1]
    last.plot([0, 1], [0, 1], color=GREY, linewidth=1, linestyle="--", label="honest")
    last.plot(found.claims, found.right, "o", color=BLUE, markersize=4, label="over 2σ²")
    last.plot(found.claims, found.forgetful, "s", color=ORANGE, markersize=4, label="over σ²")
    claims = np.linspace(0.0, 1.0, 101)
    last.plot(claims, 1.0 - np.sqrt(1.0 - claims), color=ORANGE, linewidth=1, label="1 - √(1 - p)")
    label(last, "truth in the region that claims p", "claimed probability p", "share of the runs")
    last.legend(loc="upper left", fontsize=7)
    rows = [
        tuple(number(float(value), 3) for value in values)
        for values in zip(found.claims, found.right, found.forgetful, found.theory, strict=True)
    ]
    columns = ("claimed", "over 2σ²", "over σ²", "over σ², theory")
    steps = [
        (stage.name, number(float(np.hypot(*(stage.estimate - stage.truth[:2]))), 3)) for stage in stages
    ]
    ratio = f"area of the region over σ² to that over 2σ²: {found.covariance_ratio:.3f} (theory 0.5)"
    return Exhibit(
        (
            Table("error of the mean", ("stage", "m"), steps),
            Table(f"truth inside, {found.runs} runs; {ratio}", columns, rows),
        ),
        figure,
    )
