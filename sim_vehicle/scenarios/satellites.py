"""What the scenarios with an autopilot's satellite receiver share: the receiver, and what is said about it."""

from __future__ import annotations

from sim_vehicle.scenario import SensorFacts
from sim_vehicle.sensors import Cadence, GnssSettings

DELAY = 0.09
"""Seconds by which a fix is older than its stamp."""


def receiver() -> GnssSettings:
    """Return a receiver of 0.34 m at 5 fixes a second, honest and undisturbed."""
    return GnssSettings(Cadence(5.0, phase=0.03, latency=0.02, jitter=0.005), delay=DELAY)


def facts(link: str = "autopilot") -> tuple[SensorFacts, SensorFacts]:
    """Return its two sensors: how accurate they are is left to the readings' own claims."""
    return (
        SensorFacts("position", link, sigma=None, outliers=0.02, delay_ms=1e3 * DELAY),
        SensorFacts("velocity", link, sigma=None, outliers=0.02, delay_ms=1e3 * DELAY),
    )
