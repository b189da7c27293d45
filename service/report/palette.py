"""The report's colours: the colour-blind tell them apart too (Okabe and Ito); one thing has one colour everywhere."""

from __future__ import annotations

from service.estimate import HealthState

PARTICLES = "#0072B2"
SHADOW = "#D55E00"
TRUTH = "#222222"
BOUND = "#777777"
REGION = "#56B4E9"
OUTLIER = "#B5372F"
SERIES = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#8C6D1F", "#5B5B5B")
"""For sensors of one kind, one after the other."""

HEALTH: dict[str, str] = {
    HealthState.WAITING: "#BDBDBD",
    HealthState.CONVERGING: "#F0E442",
    HealthState.TRACKING: "#009E73",
    HealthState.AMBIGUOUS: "#CC79A7",
    HealthState.DEAD_RECKONING: "#E69F00",
    HealthState.LOST: "#B5372F",
    HealthState.STARVED: "#5B3A8C",
}
