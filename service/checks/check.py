"""One named question to a run, with its answer and the figure that it rests on."""

from __future__ import annotations

import math
from typing import NamedTuple


class Check(NamedTuple):
    """A question with its answer.

    Attributes
    ----------
    name : str
        The question, with the figure that it asks for.
    passed : bool
        The answer.
    found : float or None
        The figure of this run, in the unit of the name; ``None`` where there is none.
    """

    name: str
    passed: bool
    found: float | None


def at_most(name: str, found: float, limit: float) -> Check:
    """Ask for a figure of at most ``limit``; one that is not known does not pass."""
    return Check(name, found <= limit, known(found))


def at_least(name: str, found: float, limit: float) -> Check:
    """Ask for a figure of at least ``limit``; one that is not known does not pass."""
    return Check(name, found >= limit, known(found))


def between(name: str, found: float, low: float, high: float) -> Check:
    """Ask for a figure from ``low`` to ``high``; one that is not known does not pass."""
    return Check(name, low <= found <= high, known(found))


def known(value: float) -> float | None:
    """Return a figure, rounded, or ``None`` for one that is not finite."""
    return round(value, 4) if math.isfinite(value) else None


def figure(value: float | None) -> float:
    """Return a figure that may be missing as a number that passes nothing."""
    return math.nan if value is None else value
