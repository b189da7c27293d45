"""What a run's summary needs, collected tick by tick: of the particle filter, and of the shadow beside it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from drivers.sample import SECOND
from service.estimate import Estimate, HealthState, Hypotheses
from service.estimator.shadow import Shadow
from service.mixture import Mixture
from service.score import UNSCORED, Comparison, Score, Track, Truth, compare, figures

SHADOW_INTERVAL = SECOND // 10
"""Nanoseconds between two points of the shadow's track."""


@dataclass
class Path2D:
    """A track under construction: one row a tick that had a position, with its hypotheses where it had several."""

    time: list[float] = field(default_factory=list[float])
    north: list[float] = field(default_factory=list[float])
    east: list[float] = field(default_factory=list[float])
    covariance: list[tuple[float, float, float]] = field(default_factory=list[tuple[float, float, float]])
    mixtures: dict[int, Mixture] = field(default_factory=dict[int, Mixture])

    def add(
        self,
        time: float,
        north: float,
        east: float,
        covariance: tuple[float, float, float],
        mixture: Mixture | None = None,
    ) -> None:
        """Append one tick; ``covariance``: nn, ne, ee; ``mixture``: its hypotheses, if there are several."""
        if mixture is not None:
            self.mixtures[len(self.time)] = mixture
        self.time.append(time)
        self.north.append(north)
        self.east.append(east)
        self.covariance.append(covariance)

    def track(self) -> Track:
        """Return what was added, as arrays."""
        return Track(
            np.asarray(self.time, np.float64),
            np.asarray(self.north, np.float64),
            np.asarray(self.east, np.float64),
            np.asarray(self.covariance, np.float64).reshape(-1, 3),
            self.mixtures,
        )

    def compared(self, truth: Truth | None) -> Comparison | None:
        """Compare with ``truth``, if there is one and there was a position."""
        return None if truth is None or not self.time else compare(self.track(), truth)

    def score(self, truth: Truth | None) -> Score:
        """Return the figures of that."""
        comparison = self.compared(truth)
        return UNSCORED if comparison is None else figures(comparison)


@dataclass
class Tally:
    """The estimates of a run, counted; ``tracked`` is the Unix time of the first whose health is tracking."""

    path: Path2D = field(default_factory=Path2D)
    health: Counter[HealthState] = field(default_factory=Counter[HealthState])
    particles: int = 0
    first: Estimate | None = None
    last: Estimate | None = None
    tracked: float | None = None
    ticks: int = 0

    def add(self, estimate: Estimate, places: Hypotheses | None = None) -> None:
        """Count one tick, with the places that were published beside it where there are several."""
        self.last = estimate
        self.first = self.first or estimate
        if self.tracked is None and estimate.health is HealthState.TRACKING:
            self.tracked = estimate.time
        self.ticks += 1
        self.health[estimate.health] += 1
        self.particles += estimate.particles
        north, east, _ = estimate.position
        nn, ne, _, ee, _, _ = estimate.position_covariance
        if north is not None and east is not None and None not in (nn, ne, ee):
            mixture = None if places is None else mixture_of(places)
            self.path.add(estimate.time, north, east, (nn or 0.0, ne or 0.0, ee or 0.0), mixture)

    @property
    def tracked_after(self) -> float | None:
        """Seconds from the first estimate to the first whose health is tracking; ``None`` if none is."""
        return None if self.tracked is None or self.first is None else self.tracked - self.first.time


def mixture_of(places: Hypotheses) -> Mixture | None:
    """Return the density of published hypotheses; ``None`` for fewer than two.

    What the belief holds elsewhere has a share and no place, so it has no density either.
    """
    found = places.hypotheses
    if len(found) < 2:
        return None
    covariances = [one.position_covariance for one in found]
    return Mixture(
        np.array([one.weight for one in found], np.float64),
        np.array([[one.position[0] or 0.0, one.position[1] or 0.0] for one in found], np.float64),
        np.array([[c[0] or 0.0, c[1] or 0.0, c[3] or 0.0] for c in covariances], np.float64),
    )


@dataclass(frozen=True)
class ShadowRun:
    """What the shadow Kalman filter gave beside a run; :meth:`row` is its object in ``--json``.

    Attributes
    ----------
    ticks : int
        At how many times, ten a second, it had a position: it begins once the heading is known.
    accepted, gated, unsupported : dict[str, int]
        Measurements by sensor: weighed in; kept out by the gate; of a model that it has no derivative of.
    failure : str
        Why it stopped before the end, if it did.
    """

    score: Score
    ticks: int
    accepted: dict[str, int]
    gated: dict[str, int]
    unsupported: dict[str, int]
    failure: str

    def row(self) -> dict[str, object]:
        """Return the figures as ``--json`` prints them."""
        return {
            **self.score.rounded(),
            "ticks": self.ticks,
            "accepted": self.accepted,
            "gated": self.gated,
            "unsupported": self.unsupported,
            "failure": self.failure,
        }


class ShadowTally:
    """The shadow's poses of a run, with what became of its measurements.

    It is asked where it is :data:`SHADOW_INTERVAL` apart: a track is measured as well by ten points a second, and
    carrying the belief to every tick would cost the replay more than the filter itself.
    """

    def __init__(self, shadow: Shadow) -> None:
        self.path = Path2D()
        self._shadow = shadow
        self._asked: int | None = None

    def add(self, now: int, time: float) -> None:
        """Ask the shadow where it is at ``now`` (nanoseconds; ``time``: the same as Unix seconds), if it is time."""
        if self._asked is not None and now - self._asked < SHADOW_INTERVAL:
            return
        self._asked = now
        pose = self._shadow.at(now)
        if pose is not None:
            nn, ne, ee = (float(pose.covariance[i, j]) for i, j in ((0, 0), (0, 1), (1, 1)))
            self.path.add(time, pose.mean("north"), pose.mean("east"), (nn, ne, ee))

    def run(self, truth: Truth | None) -> ShadowRun:
        """Return the figures."""
        shadow = self._shadow
        return ShadowRun(
            self.path.score(truth),
            len(self.path.time),
            dict(sorted(shadow.accepted.items())),
            dict(sorted(shadow.gated.items())),
            dict(sorted(shadow.unsupported.items())),
            shadow.failure,
        )
