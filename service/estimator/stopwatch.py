"""How the estimator's work is timed without the estimator reading a clock."""

from __future__ import annotations

from typing import Protocol


class Stopwatch(Protocol):
    """Charges time to stages; the loop brings one with a clock, a replay one without."""

    def lap(self, stage: str) -> None:
        """Charge the time since the last lap to ``stage``."""
        ...


class Silent:
    """A stopwatch for where nobody measures: replays, tests."""

    def lap(self, stage: str) -> None:
        """Charge nothing."""
