"""Which measurements the witnesses look at: no sensor's more often than tells them more, and few of one tick.

The particles are weighed by every reading, for hardly anything. Who judges sensors, noise and wheels pays for each
reading as much as for ten thousand particles, and readings that follow each other within milliseconds say nothing new
of what takes seconds to show. So fast sensors are looked at now and then, and where several of them speak in one tick
they take turns; a sensor of ten readings a second and less is heard out. It goes by the times of the readings and by
what comes in one tick, so a replay looks at the same ones.
"""

from __future__ import annotations

from drivers.sample import SECOND

SPACING = 30 * SECOND // 1000
"""Nanoseconds between two readings of one sensor that are looked at, at least."""

PATIENCE = 80 * SECOND // 1000
"""Nanoseconds after which a sensor's reading is looked at however many others are."""

FEW = 2
"""Readings of a tick that are looked at sooner than that."""


class Attention:
    """Says of each measurement whether it is looked at."""

    def __init__(self) -> None:
        self._seen: dict[str, int] = {}
        self._count = 0

    def next_tick(self) -> None:
        """Hear that the measurements of another tick follow."""
        self._count = 0

    def wants(self, name: str, time: int) -> bool:
        """Say whether to look at a reading of the sensor ``name`` of ``time`` (nanoseconds); it counts as seen then."""
        since = time - self._seen.get(name, time - PATIENCE)
        if 0 <= since < (PATIENCE if self._count >= FEW else SPACING):
            return False
        self._seen[name] = time
        self._count += 1
        return True
