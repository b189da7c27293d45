"""Which of too many measurements are taken: some of every kind, evenly spaced, the newest among them."""

from __future__ import annotations

from collections.abc import Sequence


def spaced(names: Sequence[str], most: int) -> list[int]:
    """Return the places of ``most`` of the measurements with these names, ordered by kind.

    Every kind (a sensor, a beacon) gets one before any gets a second; of a kind's own, evenly spaced ones are taken,
    the last always: what repeats says least, and what is fresh says most.

    Parameters
    ----------
    names : sequence of str
        Of each measurement, oldest first.
    most : int
        How many, at least 1; all of them if there are no more.
    """
    places: dict[str, list[int]] = {}
    for place in range(len(names) - 1, -1, -1):  # the kind heard last comes first
        places.setdefault(names[place], []).append(place)
    taken: list[int] = []
    for own, share in zip(places.values(), _shares([len(own) for own in places.values()], most), strict=True):
        taken += [own[index * len(own) // share] for index in range(share)]
    return taken


def _shares(available: Sequence[int], most: int) -> list[int]:
    """Deal ``most`` out in turn, to nobody more than there is."""
    shares = [0] * len(available)
    left = min(most, sum(available))
    while left:
        for kind, there in enumerate(available):
            if left and shares[kind] < there:
                shares[kind] += 1
                left -= 1
    return shares
