"""``outage``: each link in turn drops, repeats, reorders, delays and corrupts what it carries."""

from __future__ import annotations

from dataclasses import replace

from sim_vehicle.chance import stream
from sim_vehicle.faults import Fault, Kind, Window
from sim_vehicle.scenario import Event, Scenario
from sim_vehicle.scenarios import demo

DESCRIPTION = (
    "the demo's rover with satellites; each link for 8 s: cut, repeating, reordering, late, corrupting"
)
FIRST = 20.0
LENGTH, CALM = 8.0, 7.0
TROUBLES = (
    (Kind.DROP, 1.0),
    (Kind.REPEAT, 1.0),
    (Kind.REORDER, 1.0),
    (Kind.DELAY, 1.0),
    (Kind.CORRUPT, 0.1),
)
LINKS = ("mavlink", "can")


def draw(seed: int) -> Scenario:
    """Return the drive; the order of the troubles is drawn from the seed."""
    chance = stream(seed, "scenario outage")
    rover = demo.draw(seed)
    assert rover.bus is not None
    assert rover.bus.gnss is not None
    pairs = [(link, kind, share) for link in LINKS for kind, share in TROUBLES]
    faults: list[Fault] = []
    events: list[Event] = []
    for index, which in enumerate(chance.permutation(len(pairs))):
        link, kind, share = pairs[int(which)]
        begin = FIRST + index * (LENGTH + CALM)
        faults.append(Fault(link, kind, Window(begin, begin + LENGTH), share))
        events += [Event(begin, f"{link} {kind}"), Event(begin + LENGTH, "calm")]
    return replace(
        rover,
        name="outage",
        description=DESCRIPTION,
        seconds=FIRST + len(pairs) * (LENGTH + CALM) + 5.0,
        bus=replace(rover.bus, gnss=replace(rover.bus.gnss, outages=())),
        faults=tuple(faults),
        events=tuple(events),
    )
