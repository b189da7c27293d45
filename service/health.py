"""What the belief is worth, as one word and a reason.

The states are defined once, here and in the table of ``docs/operating.md``. None of them is read off normalised
weights: those always look the same, however wrong the belief is. What counts is whether absolute measurements arrive,
whether they agree with what was expected (the unnormalised evidence), and how wide the published region is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from drivers.sample import SECOND
from filters.outlier_run import OutlierRun
from service.estimate import HealthState

CONVERGED_RADIUS = 10.0
"""Metres of ``radius95`` below which a belief that had no place yet has one."""

LOST_RADIUS = 4 * CONVERGED_RADIUS
"""Metres of ``radius95`` above which a belief that had a place has it no longer, while measurements do arrive."""

SILENCE = 3 * SECOND
"""Without an absolute measurement for this long, the belief lives on odometry alone."""

DISAGREEMENT = 0.8
"""Share of surprising measurements above which the belief is taken to be wrong, not the sensors."""

AGREEMENT = 0.5
"""Share below which a lost belief is believed again: between the two it stays what it was."""

MEMORY = 3.0
"""Seconds over which that share is averaged, once there are as many."""

OUTLIERS = 0.05
"""Share of outliers of a sensor that states none."""

DOUBT = 0.02
"""Probability of a run of outliers, with the belief right, below which it is no accident: the belief is wrong."""

LEAST_READINGS = 10
"""Fewer measurements than this prove nothing, neither for the belief nor against it."""


@dataclass(frozen=True, slots=True)
class Facts:
    """What health is judged by, at one tick.

    Attributes
    ----------
    missing : list[str]
        What has never been heard, in the user's words; the belief waits for it when it is not ``started``.
    radius95 : float or None
        Metres.
    afforded, minimum : int
        Particles that the budget allows, and the fewest that make a filter.
    delay : int
        Nanoseconds by which the belief lies behind ``now``: how old even the newest measurement is.
    searching : str
        What is done to find a place for a belief that has none, in the user's words; empty when it has one.
    ambiguity : str
        Which places the belief holds, in the user's words, if more than one counts; else empty.
    elsewhere : str
        That another place explains the measurements better, in the user's words, if it does; else empty.
    """

    now: int
    started: bool
    missing: list[str]
    radius95: float | None
    afforded: int
    minimum: int
    delay: int = 0
    searching: str = ""
    ambiguity: str = ""
    elsewhere: str = ""


@dataclass(slots=True)
class HealthMonitor:
    """Follows the belief's fortunes from tick to tick.

    Attributes
    ----------
    state, reason : HealthState, str
        The verdict of the last :meth:`judge`.
    """

    state: HealthState = HealthState.WAITING
    reason: str = "starting"
    _surprise: float = 0.0
    _readings: int = 0
    _last_reading: int | None = None
    _last_kind: str = ""
    _placed: bool = field(default=False)
    _disputed: bool = field(default=False)
    _run: OutlierRun = field(default_factory=OutlierRun)

    def measured(
        self, now: int, kind: str, surprise: float, worth: float = 1.0, outliers: float = OUTLIERS
    ) -> None:
        """Note one absolute measurement: ``surprise`` is the probability, 0…1, that it is the outlier part's.

        One that tells what those before it told is ``worth`` the less, 0…1: an outlier seen ten times is one.
        ``outliers`` is which share of its sensor's readings is said to be.
        """
        self._readings += 1
        elapsed = 0.0 if self._last_reading is None else max(0.0, (now - self._last_reading) / SECOND)
        share = worth * min(1.0, max(1.0 / self._readings, elapsed / MEMORY + 0.02))
        self._surprise += share * (surprise - self._surprise)
        self._run.observe(surprise, outliers, worth)
        self._last_reading = now
        self._last_kind = kind

    def restart(self) -> None:
        """Forget the past: the belief was started anew."""
        self._surprise = 0.0
        self._readings = 0
        self._last_reading = None
        self._placed = False
        self._disputed = False
        self._run = OutlierRun()

    def heard(self, now: int) -> None:
        """Note that an absolute measurement was used, though not by the belief: by the search that placed it."""
        self._last_reading = now
        self._last_kind = self._last_kind or "heard by the search"

    def judge(self, facts: Facts) -> HealthState:
        """Return the state at this tick and keep it with its reason."""
        self.state, self.reason = self._verdict(facts)
        return self.state

    def _verdict(self, facts: Facts) -> tuple[HealthState, str]:
        if not facts.started or facts.radius95 is None:
            return HealthState.WAITING, _awaited(facts)
        radius = facts.radius95
        if facts.afforded < facts.minimum:
            return (
                HealthState.STARVED,
                f"the budget affords {facts.afforded} particles, fewer than particles_min = {facts.minimum}",
            )
        if facts.searching:
            unheard = f"; never heard: {', '.join(facts.missing)}" if facts.missing else ""
            return HealthState.CONVERGING, facts.searching + unheard
        silent = self._silence(facts)
        if silent is not None and facts.ambiguity:
            return HealthState.AMBIGUOUS, f"{facts.ambiguity}; {silent}"
        if silent is not None:
            return HealthState.DEAD_RECKONING, silent
        if self._readings < LEAST_READINGS:
            return HealthState.CONVERGING, f"{self._readings} measurements so far, too few to tell"
        disputed = self._dispute(facts)
        if disputed is not None:
            return disputed
        if facts.ambiguity:
            return HealthState.AMBIGUOUS, facts.ambiguity
        return self._by_spread(radius, facts.missing)

    def _dispute(self, facts: Facts) -> tuple[HealthState, str] | None:
        """Say what it means that most measurements disagree: a wrong belief, or nothing but outliers around it."""
        self._disputed = self._surprise > (AGREEMENT if self._disputed else DISAGREEMENT)
        if not self._disputed:
            return None
        disagree = (
            f"{self._surprise:.0%} of the measurements of the last {MEMORY:.0f} s disagree with the belief"
        )
        if facts.elsewhere:
            return HealthState.LOST, f"{disagree}; {facts.elsewhere}"
        if self.state is HealthState.LOST or self._run.log_odds >= -math.log(DOUBT):
            return HealthState.LOST, disagree
        outliers = f"{disagree}, and may all be outliers, by the share that was stated"
        if facts.ambiguity:
            return HealthState.AMBIGUOUS, f"{facts.ambiguity}; {outliers}"
        return HealthState.DEAD_RECKONING, outliers

    def _silence(self, facts: Facts) -> str | None:
        missing = f"; never heard: {', '.join(facts.missing)}" if facts.missing else ""
        if self._last_reading is None:
            return f"no absolute measurement yet{missing}"
        age = facts.now - self._last_reading
        if age > SILENCE + facts.delay:
            return (
                f"no absolute measurement for {age / SECOND:.0f} s, the last was {self._last_kind}{missing}"
            )
        return None

    def _by_spread(self, radius: float, missing: list[str]) -> tuple[HealthState, str]:
        if self._placed and radius > LOST_RADIUS:
            self._placed = False
        if not self._placed and radius > CONVERGED_RADIUS:
            return HealthState.CONVERGING, f"95 % within {radius:.1f} m, above {CONVERGED_RADIUS:.0f} m"
        self._placed = True
        agreeing = "measurements agree with the belief"
        if self._surprise > 1.0 - DISAGREEMENT:
            agreeing = f"{self._surprise:.0%} of the measurements of the last {MEMORY:.0f} s disagree with the belief"
        unheard = f"; never heard: {', '.join(missing)}" if missing else ""
        return HealthState.TRACKING, agreeing + unheard


def _awaited(facts: Facts) -> str:
    if facts.missing:
        return "no data yet: " + ", ".join(facts.missing)
    return "no data yet that the belief could start from"
