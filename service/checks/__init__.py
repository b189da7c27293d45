"""What is asked of a simulated drive beyond its errors: named checks, one list for each scenario that has any."""

from __future__ import annotations

from collections.abc import Callable

from service.checks import ambiguity, trouble
from service.checks.check import Check
from service.checks.events import Event, read_events
from service.checks.story import Flag, Story, Teller

__all__ = ["Check", "Event", "Flag", "Story", "Teller", "judge", "read_events"]

_QUESTIONS: dict[str, Callable[[Story], list[Check]]] = {
    "beacons": trouble.beacons,
    "jam": trouble.jam,
    "kidnap": ambiguity.kidnap,
    "late_fix": ambiguity.late_fix,
    "mirror": ambiguity.mirror,
    "multipath": trouble.multipath,
    "outage": trouble.outage,
    "slip": trouble.slip,
    "spoof": trouble.spoof,
}


def judge(scenario: str, story: Story) -> list[Check]:
    """Return the checks of a scenario on one run; none where nothing is asked of it."""
    questions = _QUESTIONS.get(scenario)
    return [] if questions is None or not len(story.time) else questions(story)
