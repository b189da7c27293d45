"""What a prediction over a time asks of that time."""

from __future__ import annotations

import math


def require_duration(where: str, duration: float) -> None:
    """Check a duration, seconds.

    Raises
    ------
    ValueError
        It is negative or not finite.
    """
    if not 0.0 <= duration < math.inf:
        raise ValueError(f"{where}: duration must be finite and not negative, got {duration} s")
