"""Figures 4.4 and 4.7, and the lecture's wheel: importance factors and resampling."""

from __future__ import annotations

import numpy as np

from filters.textbook import comb, importance, wheel
from service.textbook.exhibit import Exhibit, Table, number, vector
from service.textbook.style import BLUE, GREEN, GREY, ORANGE, PALE, RED, label, panels, rug, sheet

_STRETCHES = (BLUE, ORANGE, GREEN, GREY)


def target() -> Exhibit:
    """Figure 4.4."""
    found = importance.illustrate()
    errors = [importance.error(name) for name in importance.PROPOSALS]
    figure = sheet(8.6, 6.0)
    first, second, third, fourth = panels(figure, 2, 2)
    x = np.linspace(-1.0, 9.0, 501)
    for axis in (first, second, third):
        axis.plot(x, importance.target(x), color=RED, linewidth=1.4, label="target f")
    first.axvspan(*importance.INTERVAL, color=PALE, alpha=0.6, linewidth=0, label="interval A")
    second.plot(x, importance.proposal(x), color=BLUE, linewidth=1.4, label="proposal g")
    rug(second, found.samples, (-0.03, -0.01))
    third.vlines(found.samples, 0.0, 0.2 * found.weights / found.weights.max(), color=BLUE, linewidth=1.0)
    third.plot([], [], color=BLUE, label="weight f/g, scaled")
    titles = ("(a) the target", "(b) what can be sampled", "(c) weights make up the difference")
    for axis, title in zip((first, second, third), titles, strict=True):
        label(axis, title, "x", "density")
        axis.set_ylim(-0.04, 0.47)
        axis.set_xlim(-1.0, 9.0)
        axis.legend(loc="upper left")
    for error, colour in zip(errors, (BLUE, ORANGE), strict=True):
        mean, sigma = importance.PROPOSALS[error.proposal]
        name = f"g = N({mean:g}, {sigma:g}²)"
        fourth.loglog(error.counts, error.errors, "o", color=colour, markersize=4, label=f"{name}, weighted")
        fourth.loglog(error.counts, error.theory, color=colour, linestyle="--", linewidth=1)
        fourth.loglog(error.counts, error.unweighted, "x", color=colour, markersize=4, label="not weighted")
    label(fourth, "error of P(x in A); dashed: theory", "samples M", "root mean square")
    fourth.legend(fontsize=7)
    rows = [
        (error.proposal, f"{count:,}", *(number(float(value), 3) for value in values))
        for error in errors
        for count, *values in zip(error.counts, error.errors, error.theory, error.unweighted, strict=True)
    ]
    columns = ("proposal", "samples", "weighted (4.28)", "theory", "not weighted (4.26)")
    title = f"error of P(x in A), exactly {importance.probability():.4f}"
    return Exhibit((Table(title, columns, rows),), figure)


def teeth() -> Exhibit:
    """Figure 4.7."""
    found = comb.comb()
    figure = sheet(8.6, 2.9)
    (axis,) = panels(figure, 1, 1)
    for i, (end, weight) in enumerate(zip(found.ends, found.weights, strict=True)):
        colour = _STRETCHES[i % len(_STRETCHES)]
        axis.barh(0.0, weight, left=end - weight, height=0.5, color=colour, alpha=0.5, edgecolor="white")
        axis.text(end - 0.5 * weight, 0.0, f"{i + 1}", ha="center", va="center", fontsize=9)
        copies = int(found.copies[i])
        axis.text(end - 0.5 * weight, -0.42, f"{copies} ×", ha="center", va="center", fontsize=8, color=GREY)
    for m, tooth in enumerate(found.teeth, 1):
        axis.annotate(
            f"u{m}", (tooth, 0.22), (tooth, 0.62), ha="center", fontsize=8, arrowprops={"arrowstyle": "->"}
        )
    axis.annotate("", (0.0, 1.0), (found.offset, 1.0), arrowprops={"arrowstyle": "<->", "color": RED})
    axis.text(0.5 * found.offset, 1.08, "r", ha="center", color=RED)
    spacing = (found.teeth[2], found.teeth[3])
    axis.annotate("", (spacing[0], 1.0), (spacing[1], 1.0), arrowprops={"arrowstyle": "<->", "color": RED})
    axis.text(sum(spacing) / 2.0, 1.08, "1/M", ha="center", color=RED)
    label(
        axis,
        "the weights end to end, and where the comb's teeth fall",
        "cumulative weight",
        "from teeth to copies",
    )
    axis.set_ylim(-0.6, 1.35)
    axis.set_xlim(-0.005, 1.005)
    axis.set_yticks([-0.42, 0.0, 0.68], ["copies", "particle", "teeth u"])
    axis.grid(visible=False)
    rows = [
        (str(i + 1), number(float(weight)), number(float(weight) * found.teeth.size), str(copies))
        for i, (weight, copies) in enumerate(zip(found.weights, found.copies.tolist(), strict=True))
    ]
    title = f"M = {found.teeth.size}, r = {found.offset:g}"
    return Exhibit((Table(title, ("particle", "weight", "M × weight", "copies"), rows),), figure)


def wheels() -> Exhibit:
    """Compare the lecture's resampling wheel with multinomial draws."""
    found = [wheel.compare(name) for name in wheel.WHEELS]
    largest = np.linspace(0.25, 0.85, 25)
    colours = (GREY, ORANGE, BLUE)
    markers = ("s", "o", "x")
    figure = sheet(9.0, 4.0)
    left, right = panels(figure, 1, 2)
    for comparison, colour, marker in zip(found, colours, markers, strict=True):
        chances = comparison.expected / comparison.expected.sum()
        seen = comparison.observed / comparison.observed.sum()
        left.loglog(
            chances, seen, marker, color=colour, markersize=4, fillstyle="none", label=comparison.name
        )
        curve = wheel.sweep(comparison.name, largest, batches=15_000)
        right.semilogy(2.0 * largest, curve, color=colour, label=comparison.name)
    left.plot([1e-4, 0.2], [1e-4, 0.2], color=RED, linewidth=0.8)
    label(left, "every outcome of four draws", "probability, multinomial", "share of the draws")
    left.legend(loc="upper left")
    right.axvline(1.0, color=RED, linewidth=0.8, linestyle="--")
    label(
        right,
        "distance from multinomial",
        "twice the largest of four weights (the others equal)",
        "chi-square per degree of freedom",
    )
    right.legend(loc="upper right")
    rows = [
        (
            comparison.name,
            vector(comparison.copies.tolist(), 3),
            vector(comparison.variance_ratio.tolist(), 3),
            f"{comparison.chi_square:.1f}",
            str(comparison.degrees),
            number(comparison.probability, 2) if comparison.probability > 1e-12 else "< 1e-12",
        )
        for comparison in found
    ]
    columns = (
        "draw",
        "copies, mean",
        "their variance / multinomial",
        "chi-square",
        "degrees",
        "probability of more",
    )
    expected = vector([len(wheel.WEIGHTS) * weight for weight in wheel.WEIGHTS], 3)
    title = (
        f"{wheel.BATCHES:,} draws of four from weights {vector(wheel.WEIGHTS)}; copies expected {expected}"
    )
    return Exhibit((Table(title, columns, rows),), figure)
