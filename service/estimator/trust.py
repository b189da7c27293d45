"""Trust: which sensors tell the truth, whatever accuracy they claim.

A binary Bayes filter in log odds (Table 4.2) for every group of sensors that would lie together: a receiver's position
and velocity, one beacon, one compass. The evidence is what the group's :class:`~service.estimator.witnesses.Witnesses`,
who do not listen to it, make of its measurements: how much less likely the innovation is than none at all, given how
wrong witnesses and group usually are (:class:`filters.error_level.ErrorLevel`). A liar's measurement lies anywhere, so
an innovation :data:`DOUBT` nats less likely than none speaks neither for nor against.

The log odds are kept within :data:`LIMIT`, what one second says within :data:`WORST` and :data:`BEST`: a liar is found
out two to three seconds after its first great lie, one wrong reading flags nobody, and trust is earned back in 10 to
13 s. A group that has never agreed with its witness is not judged: then it may be the belief that is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from drivers.sample import SECOND, Sample
from filters.belief import Evidence
from filters.binary import BinaryBayesFilter
from filters.error_level import ErrorLevel, Opinion, Testimony
from filters.kalman import Matrix
from filters.motion.learned import SlowState
from filters.motion.unicycle import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.regularization import root
from filters.sensing import Heading, Position, Range, Velocity
from filters.sensing.speed import WheelSpeed
from service.config import Configuration
from service.estimator.dispute import Dispute
from service.estimator.gaussian import gaussian_of, is_one_place
from service.estimator.groups import USUAL, Group, Judged, group_of
from service.estimator.measuring import Measurement
from service.estimator.vehicle import Vehicle
from service.estimator.witnesses import SPAN, Witnesses

MOST_GROUPS, MOST_SENSORS = 16, 32
"""Groups and sensors beyond so many are not judged."""

LIMIT = 6.0
"""Log odds: one in 400 that a trusted sensor lies."""

FLAGGED, EARNED = -5.0, 1.0
"""Log odds below which a group is no longer trusted, and above which it is trusted again."""

CALM = 3.0
"""Log odds from which nobody is under suspicion, and a group has shown that it agrees."""

BEST = 0.58
WORST: dict[type, float] = {Position: -8.0, Velocity: -3.0, Range: -2.0, Heading: -2.0, WheelSpeed: -2.0}
"""Log odds that a second of readings adds at most, for a sensor and against it: BEST / (BEST - WORST) is the share of
wild readings that one lives with for ever. Among ranges they are many, among positions few."""

DOUBT, DOUBT_OF_A_LIAR = 8.0, 5.0
"""Nats: of an innovation that speaks neither way, 4 standard deviations; 3.2 for a group that has been caught."""

TOGETHER = 10.4
"""Nats for a receiver's position and velocity together. Of four dimensions honest readings are as rarely beyond that as
of two beyond 8, and the position must be off by 3 standard deviations. Reflections move a position by metres and leave
the velocity; one who leads both away tells on himself by both."""

YOUNGEST = 5 * SECOND
"""Nanoseconds between two beginnings of witnesses at least, when the belief is young."""

MARGIN = 4.0
"""Nats by which a witness may be contradicted more than another group's and still accuse."""

RECENT = 10 * SECOND
"""Who was not heard for so long has no say, nanoseconds."""

ENOUGH = 3
"""Ranges, or one position, that must be there beside a range to judge it: with fewer there are mirror images."""

WILD_SHARE = 0.4
"""A witness that takes more of what the others measure for wild has lost its way, and accuses nobody."""

POISONED = 9.2
"""Squared distance of the belief from the witness, in the witness's own measure, above which it was led away (99 %)."""

LEAST_CAUTION = 0.25
"""A witness is not taken to be better than twice what it says, in standard deviations, before it disputes a fix."""

STRAYED = 0.2
"""Radians that nobody measured, from which on a witness has lost his way: where he is then is no ellipse any more."""

PLACED = 5.0
"""Metres: a belief with less spread than this is one place, and makes a witness."""

TURNED = 16.0
"""Squared difference of two headings, in the witness's own measure, that no way explains."""

_HEADING = 2


class Trust:
    """Who is believed; a :class:`~service.estimator.companion.Companion` that is also asked before each measurement.

    Parameters
    ----------
    motion : Unicycle
        How the vehicle moves.
    slow : sequence of RandomWalk or Learned
        Slow states beside it.
    belief : ParticleFilter
        Witnesses begin as it is.
    control : callable
        What was rolled and turned between two times.
    seed : int
        Of the particles that are drawn where a group has led the belief away.
    """

    def __init__(
        self,
        motion: Unicycle,
        slow: Sequence[SlowState],
        belief: ParticleFilter[Any],
        control: Callable[[int, int], UnicycleControl],
        seed: int,
    ) -> None:
        self.dispute = Dispute()
        self.divided = False
        self._turned = 0.0
        self._strayed = -(2**62)
        self._undo: tuple[Matrix, Matrix] | None = None
        self._seed = seed
        self._taken_back = 0
        self._motion = motion
        self._belief = belief
        self._control = control
        self._witnesses = Witnesses(motion, slow, MOST_GROUPS)
        self._odds = BinaryBayesFilter(0.5, (MOST_SENSORS,), LIMIT)
        self._groups: dict[str, Group] = {}
        self._by_name: dict[str, Group] = {}
        self._sensors = 0
        self._time = self._since = self._due = 0

    def log_odds(self, name: str) -> float | None:
        """Return the log odds of the sensor ``name``; ``None`` while it is not judged."""
        group = self._by_name.get(name)
        sensor = None if group is None else group.sensors.get(name)
        return float(self._odds.log_odds[sensor.place]) if sensor is not None and sensor.agreed else None

    # --- a companion of the belief --------------------------------------------------------------------------------

    def started(self, time: int) -> None:
        """Dismiss the witnesses: they are of another belief."""
        self._time = self._since = self._due = time
        self._witnesses.clear()

    @property
    def decides(self) -> bool:
        """Whether it is one alone that disagrees, which once agreed and has a witness.

        It is when nobody else says where the vehicle is, or when its witness takes its readings for wild and not those
        of the others. No search is to follow it then: it may be a lie, and that is decided here. A vehicle that was
        carried away has all witnesses wrong, so a search is held back for as long as it takes them to notice: ten
        readings of the others.
        """
        placed = [group for group in self._groups.values() if group.absolute and self._recent(group)]
        return any(
            group.agreed
            and self._witnesses.judging(group.place) is not None
            and (len(placed) == 1 or self._alone(group))
            for group in placed
        )

    @property
    def suspects(self) -> bool:
        """Whether somebody who says where the vehicle is has been caught, or may soon be."""
        odds = self._odds.log_odds
        sensors = [sensor for group in self._groups.values() for sensor in group.sensors.values()]
        return any(sensor.absolute and sensor.agreed and odds[sensor.place] < CALM for sensor in sensors)

    def refutes(self, headings: Matrix) -> bool:
        """Say whether it :attr:`decides`, and by its witness the vehicle cannot head as a search found.

        Fixes of a while ago, or that stand still, fit another way than the one that was driven, turned about.

        Parameters
        ----------
        headings : (n,)
            Radians, equally likely.
        """
        found = math.atan2(float(np.sin(headings).mean()), float(np.cos(headings).mean()))
        return self.decides and any(
            self._cannot_head(found, group)
            for group in self._groups.values()
            if group.absolute and group.agreed and self._accuses(group)
        )

    def _cannot_head(self, heading: float, group: Group) -> bool:
        member = self._witnesses.judging(group.place)
        if member is None:
            return False
        mean, covariance = self._witnesses.gaussian(member)
        away = math.remainder(heading - float(mean[_HEADING]), math.tau)
        return away * away > TURNED * float(covariance[_HEADING, _HEADING])

    def _dispute(self, group: Group, sensor: Judged, eldest: Testimony, weight: float) -> None:
        """Note where the belief is away from what an older witness of a receiver says, if he has not lost his way.

        One that has never agreed with the belief disputes nothing: what it says is for the search to explain.
        """
        moments = self._belief.moments()
        self.dispute.variance = 0.5 * float(moments.variance[0] + moments.variance[1])
        member = self._witnesses.judging(group.place)
        if member is None or self._witnesses.began(member) <= self._strayed or not self._accuses(group):
            return
        mean, covariance = self._witnesses.gaussian(member)
        spread = max(LEAST_CAUTION, sensor.level.caution) * covariance[:2, :2]
        away = moments.mean[:2] - mean[:2]
        self.dispute.hear(away, spread)
        if self.dispute.forsaken(away, eldest.residual, spread + np.diag(eldest.noise), weight):
            self._undo = mean, covariance
            self.dispute.settle()

    def _alone(self, group: Group) -> bool:
        """Say whether a group contradicts what all others say, and they do not contradict each other."""
        strange = max(sensor.strange for sensor in group.sensors.values() if sensor.absolute)
        return not group.flagged and strange > WILD_SHARE and self._accuses(group)

    def _recent(self, group: Group) -> bool:
        return any(self._time - (sensor.heard or 0) < RECENT for sensor in group.sensors.values())

    @contextmanager
    def unmoved(self) -> Generator[None]:
        """Keep the witnesses of those who once agreed with the belief, while a search replaces it.

        What the search went by may be a lie; should it be, the witnesses still know.
        """
        live, since = self._witnesses.bank.live.copy(), self._since
        yield
        self._since = since
        for group in self._groups.values():
            if not group.agreed:
                self._witnesses.dismiss(live, group.place)
        self._witnesses.bank.live[:] = live

    def moved(self, start: int, end: int) -> None:
        """Move the witnesses, and have new ones begin when it is time."""
        self._time = end
        control = self._control(start, end)
        self._witnesses.move(control, (end - start) / SECOND)
        self.dispute.wait((end - start) / SECOND)
        self._turned = self._turned + control.turn_sigma**2 if control.turn_sigma > 0.0 else 0.0
        if self._turned > STRAYED**2:
            self._strayed = end
        if end < self._due:
            return
        following = [(self._following(group), group) for group in self._groups.values() if not group.flagged]
        due = [group for time, group in following if time <= end]
        if not due:
            self._due = min((time for time, _ in following), default=end + YOUNGEST)
        elif self._all_calm():
            self._begin(due)

    def _following(self, group: Group) -> int:
        """Return when the group's next witness is to begin, nanoseconds."""
        began = self._witnesses.newest(group.place)
        if began is None:
            return self._time
        return min(began + SPAN // 2, max(began + YOUNGEST, 2 * began - self._since))

    def _all_calm(self) -> bool:
        """Say whether nobody of those who are trusted is under suspicion."""
        trusted = (group for group in self._groups.values() if not group.flagged)
        return all(self._calm(sensor) for group in trusted for sensor in group.sensors.values())

    def _calm(self, sensor: Judged) -> bool:
        return sensor.flagged or not sensor.agreed or self._odds.log_odds[sensor.place] >= CALM

    def weighed(self, time: int, measured: Measurement, evidence: Evidence, outlier: bool) -> None:
        """Let the witnesses of all other groups hear what was weighed."""
        group = self._by_name.get(measured.name)
        if group is not None:
            self._witnesses.hear(group.place, measured)

    # --- a judge --------------------------------------------------------------------------------------------------

    def admits(self, time: int, sample: Sample, measured: Measurement) -> bool:
        """Judge a measurement by its group's witness, and say whether its sensor is believed."""
        group = self._group(measured, sample)
        if group is None:
            return True
        sensor = group.sensors[measured.name]
        weight = sensor.weight(time)
        said = self._witnesses.testify(group.place, measured, sensor.level)
        if not said:
            self._begin([group])
        else:
            opinion = _gravest(group, said)
            sensor.compare(opinion, weight)
            self._judge(group, sensor, opinion, next(iter(said.values())).testimony, weight)
            group.lie.hear(time, opinion.testimony, weight, sensor.absolute)
            if sensor.absolute and sensor.agreed and not sensor.ranging and not sensor.flagged:
                self._dispute(group, sensor, next(iter(said.values())).testimony, weight)
        return group.believes(sensor)

    def believes(self, sample: Sample, measured: Measurement) -> bool:
        """Say whether a measurement's sensor is believed, without judging it."""
        group = self._group(measured, sample)
        return group is None or group.believes(group.sensors[measured.name])

    def take_back(self) -> dict[str, Matrix] | None:
        """Return particles for the belief to begin anew from, if a group that was just flagged has led it away."""
        if self._undo is None:
            return None
        (mean, covariance), self._undo = self._undo, None
        for name, variance in self._motion.conditional_variances.items():
            row = self._belief.names.index(name)
            covariance[row, row] -= variance  # the model has that much beside the particles' own values
        self._taken_back += 1
        random = np.random.Generator(np.random.Philox(key=(self._seed, self._taken_back)))
        drawn = mean[:, None] + root(covariance) @ random.standard_normal((mean.size, self._belief.count))
        names = self._belief.names[: mean.size]  # receivers' errors come last, and stay
        return dict(zip(names, drawn, strict=True))

    def _group(self, measured: Measurement, sample: Sample) -> Group | None:
        name = group_of(measured.name, sample)
        group = self._groups.get(name)
        if type(measured.model) not in USUAL or (group is None and len(self._groups) >= MOST_GROUPS):
            return None
        if group is None:
            group = self._groups[name] = Group(len(self._groups))
            self._due = self._time
        if measured.name not in group.sensors:
            if self._sensors >= MOST_SENSORS:
                return None
            kind = type(measured.model)
            group.sensors[measured.name] = Judged(
                self._sensors, ErrorLevel(USUAL[kind]), measured.absolute, kind is Range, WORST[kind]
            )
            self._sensors += 1
            self._by_name[measured.name] = group
        return group

    def _judge(
        self, group: Group, sensor: Judged, opinion: Opinion, eldest: Testimony, weight: float
    ) -> None:
        doubt = DOUBT_OF_A_LIAR if sensor.flagged else DOUBT
        verdict = opinion.information(doubt) - opinion.surprise
        if not sensor.absolute:
            group.note(opinion.surprise, weight)
        elif not sensor.flagged:
            together = opinion.information(TOGETHER) - opinion.surprise
            verdict = min(verdict, together - group.support(sensor.heard or 0))
        sensor.remember(eldest, verdict > 0.0 and not sensor.flagged)
        if verdict < 0.0 and not sensor.agreed:
            self._odds.log_odds[sensor.place] = 0.0
        if verdict < 0.0 and not (sensor.agreed and self._accuses(group)):
            return
        self._odds.add(weight * min(BEST, max(sensor.worst, verdict)), sensor.place)
        odds = float(self._odds.log_odds[sensor.place])
        sensor.agreed |= odds >= CALM
        if sensor.flagged:
            sensor.flagged = odds < EARNED
            self._witnesses.keep(group.place, group.flagged)
            self._due = self._time
        elif odds <= FLAGGED:
            sensor.flagged = True
            self._witnesses.keep(group.place, group.flagged)
            self._due = self._time
            sensor.lessons.clear()
            group.lie.begin()
            if sensor.absolute:
                self.dispute.settle()
                self._look_back(group, sensor.level.caution)

    def _accuses(self, group: Group) -> bool:
        """Say whether the group's own witness is the one that explains the others best."""
        others = [
            self._witnesses.contradiction(other.place)
            for other in self._groups.values()
            if other is not group and other.agreed and not other.flagged
        ]
        if self._witnesses.wildness(group.place) > WILD_SHARE or (
            group.ranging and self._others(group) < ENOUGH
        ):
            return False
        return self._witnesses.contradiction(group.place) <= min(others, default=math.inf) + MARGIN

    def _others(self, group: Group) -> int:
        """Count the ranges that the others are worth: who stands on one is judged by where they say the vehicle is."""
        return sum(
            1 if other.ranging else ENOUGH
            for other in self._groups.values()
            if other is not group and other.absolute and not other.flagged and self._recent(other)
        )

    def _look_back(self, group: Group, caution: float) -> None:
        """Have the belief begin anew as the witness has it, if it was led away from there."""
        if group.accuser is None:
            return
        witness = mean, covariance = self._witnesses.gaussian(group.accuser)
        away = self._belief.moments().mean[:2] - mean[:2]
        spread = caution * covariance[:2, :2]
        if float(away @ np.linalg.solve(spread, away)) > POISONED:
            self._undo = witness

    def _begin(self, groups: list[Group]) -> None:
        if self.divided or not is_one_place(self._belief.moments(), PLACED):
            return
        gaussian = gaussian_of(self._belief, self._motion.conditional_variances)
        self._witnesses.begin([group.place for group in groups], self._time, *gaussian)


def _gravest(group: Group, said: dict[int, Opinion]) -> Opinion:
    """Return what the witness says who is surprised most; once the group is caught, what that one goes on to say.

    The younger one knows better where the vehicle is; the older one has the less to do with the group, and goes first
    where it speaks against it, too. That one of two is surprised by an honest sensor is at most twice as likely as of
    one.
    """
    if group.flagged and group.accuser in said:
        return said[group.accuser]
    group.accuser = eldest = next(iter(said))
    if said[eldest].surprise < said[eldest].information(DOUBT):
        group.accuser = max(said, key=lambda member: said[member].surprise)
    return said[group.accuser]


def trust_of(
    configuration: Configuration, vehicle: Vehicle, belief: ParticleFilter[Any], seed: int
) -> Trust | None:
    """Return who judges the sensors of a vehicle; ``None`` where that is switched off or nothing could be a witness.

    A witness must know the motion: of a vehicle without odometry nobody can say where it has gone without the group
    that is to be judged.
    """
    motion = vehicle.motion
    if not (configuration.honesty.trust and isinstance(motion, Unicycle)):
        return None
    return Trust(motion, vehicle.slow_states, belief, vehicle.control, seed)
