"""What the belief is worth, said when it has changed."""

from __future__ import annotations

import msgspec

from service.estimate.belief import HealthState


class Health(msgspec.Struct, frozen=True, gc=False):
    """What the belief is worth: published when the state has changed or the position has jumped.

    Attributes
    ----------
    time : float
        Of the tick that found it, Unix seconds.
    state, reason : HealthState, str
        What it is now, and why.
    since : float
        When the state was entered, Unix seconds; a new reason does not change it.
    reset_counter : int
        How many jumps of the position so far, for other reasons than motion.
    """

    time: float
    state: HealthState
    reason: str
    since: float
    reset_counter: int
