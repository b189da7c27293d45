"""How the estimator's work is timed without the estimator reading a clock."""

from __future__ import annotations

from typing import Protocol

KALMAN = "kalman"
"""The stage that the deputy's work is charged to, whatever it is: its cost grows with the measurements only."""

WITNESSES = "witnesses"
"""The stage of those who go beside the particles with each measurement and each move: who watches over the sensors,
the motion and the hypotheses."""


class Stopwatch(Protocol):
    """Charges time to stages; the loop brings one with a clock, a replay one without."""

    def lap(self, stage: str) -> None:
        """Charge the time since the last lap to ``stage``."""
        ...


class Silent:
    """A stopwatch for where nobody measures: replays, tests."""

    def lap(self, stage: str) -> None:
        """Charge nothing."""
