"""Exercise 3: what few particles make of a measurement, exactly and by trial."""

from __future__ import annotations

import numpy as np

from filters.textbook import bias
from service.textbook.exhibit import Exhibit, Table, number
from service.textbook.style import BLUE, GREY, ORANGE, RED, label, panels, sheet

_OPEN = 0.5
_SENSED = (0.6, 0.2)
"""p(the sensor says open | open), and that if closed: the door of chapter 2."""
_COUNTS = tuple(range(1, 11))
_RUNS = 4_000


def few() -> Exhibit:
    """Exercise 3: a door that is open or closed, a sensor that says open."""
    prior = np.array([_OPEN, 1.0 - _OPEN])
    step = [bias.Step(np.eye(2), np.array(_SENSED))]
    bayes = float(bias.posterior(prior, step)[0])
    exact = np.array([bias.expected(prior, step, count)[0] for count in _COUNTS])
    tried = np.array([bias.simulated(prior, step, count, _RUNS, seed=count)[0] for count in _COUNTS])
    error = 2.0 * np.sqrt(exact * (1.0 - exact) / _RUNS)
    figure = sheet(8.2, 3.4)
    left, right = panels(figure, 1, 2)
    left.axhline(bayes, color=RED, linewidth=1.2, label=f"Bayes: {bayes:g}")
    left.axhline(_OPEN, color=GREY, linewidth=1.0, linestyle="--", label=f"before z: {_OPEN:g}")
    left.plot(_COUNTS, exact, "o", color=BLUE, markersize=5, label="exact, by enumeration")
    left.errorbar(
        _COUNTS, tried, error, fmt=".", color=ORANGE, capsize=2, label=f"{_RUNS:,} runs, ± 2 standard errors"
    )
    label(left, "what the particles hold after z", "particles M", "probability that the door is open")
    left.set_ylim(0.3, 0.8)
    left.legend(loc="lower right")
    right.loglog(_COUNTS, bayes - exact, "o-", color=BLUE, markersize=5, label="bias")
    reference = (bayes - exact[-1]) * _COUNTS[-1] / np.array(_COUNTS)
    right.loglog(_COUNTS, reference, color=GREY, linestyle="--", label="falls as 1/M")
    label(right, "bias", "particles M", "Bayes less the particles' mean share")
    right.legend()
    rows = [
        (str(count), number(float(share)), number(float(seen)), number(float(share) - bayes))
        for count, share, seen in zip(_COUNTS, exact, tried, strict=True)
    ]
    columns = ("particles", "exact mean share", f"in {_RUNS:,} runs", "bias")
    return Exhibit((Table(f"share of particles at an open door; Bayes: {bayes:g}", columns, rows),), figure)
