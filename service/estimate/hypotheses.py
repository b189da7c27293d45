"""The distinct places that a belief may hold."""

from __future__ import annotations

import msgspec

from service.estimate.belief import Triangle, Triple


class Hypothesis(msgspec.Struct, frozen=True, gc=False):
    """One of the distinct places that the belief holds, predicted to the same time as the estimate.

    Attributes
    ----------
    name : int
        Which one: the same hypothesis keeps its name, whatever its weight. A name is never given again.
    weight : float
        Its share of the belief, 0 to 1.
    position : Triple
        Its own mean: north, east, down; m.
    position_covariance : Triangle
        Its own, about its own mean: upper triangle nn, ne, nd, ee, ed, dd; m².
    heading, heading_variance : float or None
        Its own; radians, rad².
    """

    name: int
    weight: float
    position: Triple
    position_covariance: Triangle
    heading: float | None
    heading_variance: float | None


class Hypotheses(msgspec.Struct, frozen=True, gc=False):
    """The distinct places that the belief holds: modes of its density with a valley of little density between them.

    Attributes
    ----------
    time : float
        Of validity, Unix seconds.
    hypotheses : list[Hypothesis]
        One to eight: first the leader, whose position is that of the estimate, then by weight.
    elsewhere : float
        Share of the belief that belongs to none of them.
    """

    time: float
    hypotheses: list[Hypothesis]
    elsewhere: float = 0.0
