"""Where a vehicle may be of which nothing is known but distances: about its beacons, as far away as any was heard.

A log often holds the beacons' places itself. Their heights are taken from their mean, where the vehicle is taken to be:
the survey of a small network says how they differ, hardly ever how high they stand above the vehicle's origin.
"""

from __future__ import annotations

from collections.abc import Sequence

from drivers.sample import BeaconPlace
from service.config import Area, Beacon

USUAL = 0.97
"""Share of the ranges that are no longer than what is taken for the farthest: a reflection or two is longer."""


def beacons_of(places: Sequence[BeaconPlace]) -> tuple[Beacon, ...]:
    """Return the beacons that a log says the places of, their heights taken from their mean."""
    if not places:
        return ()
    middle = sum(place.down for place in places) / len(places)
    return tuple(
        Beacon(id=place.beacon, position=(place.north, place.east, place.down - middle))
        for place in sorted(places, key=lambda place: place.beacon)
    )


def area_about(beacons: Sequence[Beacon], ranges: Sequence[float]) -> Area | None:
    """Return the bounds of the beacons, widened by the longest of the usual ``ranges`` (m).

    ``None`` where no beacon has a place in metres, or nothing was heard.
    """
    places = [beacon.position for beacon in beacons if beacon.position is not None]
    if not places or not ranges:
        return None
    reach = sorted(ranges)[int(USUAL * (len(ranges) - 1))]
    norths, easts = [place[0] for place in places], [place[1] for place in places]
    return Area(
        north=(min(norths) - reach, max(norths) + reach), east=(min(easts) - reach, max(easts) + reach)
    )
