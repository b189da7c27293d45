"""Where the vehicle is: the estimate of every tick."""

from __future__ import annotations

from enum import StrEnum

import msgspec

Triple = tuple[float | None, float | None, float | None]
Triangle = tuple[float | None, float | None, float | None, float | None, float | None, float | None]


class HealthState(StrEnum):
    """What the belief is worth; each state is defined in docs/operating.md."""

    WAITING = "waiting"
    CONVERGING = "converging"
    TRACKING = "tracking"
    AMBIGUOUS = "ambiguous"
    DEAD_RECKONING = "dead_reckoning"
    LOST = "lost"
    STARVED = "starved"


class MotionMode(StrEnum):
    """How a vehicle moves: it stands, it moves as its wheels say, or its wheels slip."""

    STILL = "still"
    MOVING = "moving"
    SLIPPING = "slipping"


class Estimate(msgspec.Struct, frozen=True, gc=False):
    """The belief at one tick, predicted to the tick's own time.

    Attributes
    ----------
    sequence : int
        Counts ticks from the start of the loop; a gap means that values were dropped on the way, never
        reordered.
    time : float
        Unix time of validity, seconds.
    monotonic_ns : int
        The same on the host's monotonic clock, nanoseconds.
    health, reason : HealthState, str
        What the belief is worth, and why.
    level : int
        Degradation of this tick: 0 full, 1 fewer particles than demanded, 2 measurements thinned, 3
        extraction beyond the Gaussian skipped, 4 the shadow Kalman filter speaks, 5 prediction only.
    position, velocity : Triple
        North, east, down; m and m/s. ``null`` where unknown (all of it while ``waiting``). Of several hypotheses the
        leading one's, never a mean between them; ``hypotheses`` has them all.
    heading : float or None
        Radians clockwise from true north, in (-pi, pi].
    position_covariance, velocity_covariance : Triangle
        Upper triangle nn, ne, nd, ee, ed, dd; m² and (m/s)². Honest for the whole belief: the mean square of its
        differences from ``position``, other hypotheses included.
    heading_variance : float or None
        rad²; circular, so at most (pi²)/3 for a heading that could be any.
    latitude, longitude, altitude : float or None
        WGS 84 degrees and metres above mean sea level; ``null`` without an origin.
    radius95 : float or None
        Radius of the circle about ``position`` that holds the truth with 95 %, metres, horizontal: 95 % of the
        whole belief, other hypotheses included.
    hypotheses : int
        How many distinct places the belief holds; 0 while ``waiting``. Each has a weight of its own in the value of
        ``hypotheses``.
    particles, demanded, afforded : int
        In use (none at level 4); needed by the belief's spread (KLD bound); affordable inside the budget.
    effective_sample_size : float or None
        Equation 4.36's inverse: 1 / sum of squared weights; none at level 4.
    reset_counter : int
        Steps once when the position jumps for another reason than motion: the belief began anew elsewhere, or another
        hypothesis leads.
    biases : dict[str, tuple[float, float]]
        Slow states: name to value and sigma.
    level_reason : str
        What this tick gave up, and for what; empty at level 0.
    mode : MotionMode or None
        How the vehicle moves; ``null`` where that is not estimated.
    """

    sequence: int
    time: float
    monotonic_ns: int
    health: HealthState
    reason: str
    level: int
    position: Triple
    velocity: Triple
    heading: float | None
    position_covariance: Triangle
    velocity_covariance: Triangle
    heading_variance: float | None
    latitude: float | None
    longitude: float | None
    altitude: float | None
    radius95: float | None
    hypotheses: int
    particles: int
    demanded: int
    afforded: int
    effective_sample_size: float | None
    reset_counter: int
    biases: dict[str, tuple[float, float]]
    level_reason: str = ""
    mode: MotionMode | None = None
