"""The scenarios by name; each module here is one, and draws its parameters from the seed."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from sim_vehicle.scenario import Scenario
from sim_vehicle.scenarios import beacons, demo, jam, kidnap, mirror, outage, slip, spoof


class Entry(NamedTuple):
    """One line of the list, and how the scenario is drawn from a seed."""

    description: str
    draw: Callable[[int], Scenario]


_ENTRIES = {
    "beacons": Entry(beacons.DESCRIPTION, beacons.draw),
    "demo": Entry(demo.DESCRIPTION, demo.draw),
    "jam": Entry(jam.DESCRIPTION, jam.draw),
    "kidnap": Entry(kidnap.DESCRIPTION, kidnap.draw),
    "late_fix": Entry(kidnap.LATE_DESCRIPTION, kidnap.draw_late),
    "mirror": Entry(mirror.DESCRIPTION, mirror.draw),
    "multipath": Entry(spoof.MULTIPATH_DESCRIPTION, spoof.draw_multipath),
    "outage": Entry(outage.DESCRIPTION, outage.draw),
    "slip": Entry(slip.DESCRIPTION, slip.draw),
    "spoof": Entry(spoof.DESCRIPTION, spoof.draw),
}


def names() -> list[str]:
    """Return the names of all scenarios."""
    return sorted(_ENTRIES)


def description(name: str) -> str:
    """Return the one line that says what a scenario is.

    Raises
    ------
    ValueError
        There is no such scenario.
    """
    return _entry(name).description


def draw(name: str, seed: int) -> Scenario:
    """Return a scenario with its parameters drawn from the seed.

    Raises
    ------
    ValueError
        There is no such scenario, or the seed is negative.
    """
    return _entry(name).draw(seed)


def _entry(name: str) -> Entry:
    if name not in _ENTRIES:
        raise ValueError(f"there is no scenario {name!r}; there are {', '.join(names())}")
    return _ENTRIES[name]
