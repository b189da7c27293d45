"""The belief's own work: moved along by the controls, corrected by the measurements that the horizon has passed.

It keeps the particles at the time of the last measurement, or within a stride of the horizon. Companions are told of
every step.
"""

from __future__ import annotations

from typing import Any, cast

from drivers.sample import SECOND
from filters.particle import ParticleFilter
from filters.sensing.altitude import Altitude
from service.estimator.attention import Attention
from service.estimator.binding import CONTROL, Measurement, Place, Refusal
from service.estimator.caution import Caution
from service.estimator.companion import Companion
from service.estimator.course import Course, Level
from service.estimator.deputy import Deputy
from service.estimator.height import Height
from service.estimator.intake import Intake, Passed, Waiting
from service.estimator.latecomers import Latecomers
from service.estimator.latency import Latency
from service.estimator.population import Population
from service.estimator.receivers import Receivers
from service.estimator.records import SensorRecord
from service.estimator.search import Search
from service.estimator.stopwatch import KALMAN, WITNESSES, Stopwatch
from service.estimator.thinning import spaced
from service.estimator.trust import Trust
from service.estimator.vehicle import Vehicle
from service.health import HealthMonitor

STRIDE = SECOND // 10
"""The belief is moved at each measurement, and at least this often: a chord of 0.1 s is still a good arc."""

TOGETHER = SECOND // 1000
"""Measurements within a millisecond are weighed at one time."""

FEW = 8
"""Up to a few measurements per tick are weighed each at its own time; more of them share four times."""

OUTLIER = 0.5
"""Probability of being the outlier part's from which a measurement counts as refused: it moved next to nothing."""


class Fusion:
    """Moves and weighs a belief.

    Parameters
    ----------
    vehicle : Vehicle
        How it moves, and its height.
    belief : ParticleFilter
        What is moved and weighed.
    population : Population
        Who resamples it.
    intake : Intake
        Where each measurement's fate is recorded.
    health : HealthMonitor
        Told of every absolute measurement.
    stopwatch : Stopwatch
        Charged with motion and sensing.

    Attributes
    ----------
    time : int or None
        The belief's time, nanoseconds; ``None`` before it began.
    companions : list[Companion]
        Who is told of every step.
    watchers : list[Companion]
        Those of them who are told of no more measurements than tell them more.
    deputy : Deputy or None
        Moved and weighed in the particles' place while it speaks.
    search : Search or None
        Takes the measurements instead of the belief while that has no place.
    trust : Trust or None
        Asked before each measurement whether its sensor is believed; a companion, too.
    caution : Caution or None
        Says what a sensor's readings are worth; a companion, too.
    latency : Latency or None
        Takes off fixes what their stated latency is off by; a companion, too.
    receivers : Receivers or None
        Takes what lasts of a receiver's errors for a state; a companion, too.
    latecomers : Latecomers or None
        Who weighs the belief by measurements that come after the horizon has passed them.
    taken_back : int
        How often the belief began anew because a sensor had led it away.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        belief: ParticleFilter[Any],
        population: Population,
        intake: Intake,
        health: HealthMonitor,
        stopwatch: Stopwatch,
    ) -> None:
        self.time: int | None = None
        self.companions: list[Companion] = []
        self.watchers: list[Companion] = []
        self.deputy: Deputy | None = None
        self.search: Search | None = None
        self.trust: Trust | None = None
        self.caution: Caution | None = None
        self.latency: Latency | None = None
        self.receivers: Receivers | None = None
        self.taken_back = 0
        self.latecomers: Latecomers | None = None
        self._vehicle = vehicle
        self._belief = belief
        self._population = population
        self._intake = intake
        self._health = health
        self._stopwatch = stopwatch
        self._attention = Attention()

    @property
    def _acting(self) -> Any:
        """Who is moved and weighed: the particles, or who stands in for them."""
        return self.deputy if self._deputised else self._belief

    @property
    def _deputised(self) -> bool:
        return self.deputy is not None and self.deputy.speaking

    def _charge(self, stage: str) -> None:
        self._stopwatch.lap(KALMAN if self._deputised else stage)

    def begin(self, time: int) -> None:
        """Begin, or begin anew, at ``time``: the particles were drawn for it."""
        self.time = time
        for companion in self.companions:
            companion.started(time)
        self._population.begun(time)
        self._health.restart()

    def fuse(self, passed: Passed, afforded: int, course: Course) -> None:
        """Take the measurements of one tick in order, as far as the course goes."""
        assert self.time is not None
        fused = False
        course.offered = len(passed)
        self._attention.next_tick()
        passed = self._thinned(passed, course)
        together = TOGETHER if len(passed) <= FEW else max(TOGETHER, (passed[-1][0] - passed[0][0]) // 4)
        for index, (time, waiting) in enumerate(passed):
            if not course.goes_on():
                self._intake.leave_out(passed[index:], "cut")
                break
            if fused and time - self.time > together:
                self._resample_if_worn(afforded)
                fused = False
            if not fused:
                self.advance(time)
            self._weigh(time, waiting)
            fused = True
        if fused:
            self._resample_if_worn(afforded)

    def _resample_if_worn(self, afforded: int) -> None:
        if not self._deputised:
            self._population.resample_if_worn(afforded)

    def catch_up(self, afforded: int, course: Course) -> None:
        """Take measurements that came too late to be taken in order, as many as the tick has time for."""
        if self.latecomers is None or self.time is None or course.level >= Level.THINNED:
            return
        due = self.latecomers.due()
        for time, waiting in due:
            self._weigh_late(self.latecomers, time, waiting)
            self._stopwatch.lap("sensing")
            self._population.resample_if_worn(afforded)
        self.latecomers.keep(self.time)

    def _weigh_late(self, latecomers: Latecomers, time: int, waiting: Waiting) -> None:
        assert self.time is not None
        measured = self._for_particles(time, waiting)
        if measured is None:
            return
        record = self._intake.records.of(measured.name)
        if self.trust is not None and (self.trust.log_odds(measured.name) or 0.0) < 0.0:
            record.refused["distrusted"] += 1
            return
        evidence = latecomers.weigh(time, self.time, measured)
        if evidence is None or not evidence.accepted:
            record.refused["late" if evidence is None else "invalid"] += 1
        else:
            record.judge(measured.surprise(evidence.log_mean) > OUTLIER)

    def keep_up(self, horizon: int) -> None:
        """Move the belief to ``horizon`` where no measurement has brought it near."""
        assert self.time is not None
        if horizon - self.time >= STRIDE:
            self.advance(horizon)

    def advance(self, time: int) -> None:
        """Predict the belief to ``time`` in strides (line 4 of Table 4.3)."""
        assert self.time is not None
        stride = max(STRIDE, (time - self.time) // 50)
        while time > self.time:
            step = min(time, self.time + stride)
            self._vehicle.predict(self._acting, self.time, step)
            self._charge("motion")
            for companion in self.companions:
                companion.moved(self.time, step)
            self._charge(WITNESSES)
            self.time = step

    def _thinned(self, passed: Passed, course: Course) -> Passed:
        """Take as many measurements as the course has room for, and refuse the rest."""
        if course.only_predicts:
            self._intake.leave_out(passed, "prediction only")
            return []
        if len(passed) <= course.most:
            return passed
        taken = set(spaced([waiting.sensor.name(waiting.sample) for _, waiting in passed], course.most))
        self._intake.leave_out([item for index, item in enumerate(passed) if index not in taken], "thinned")
        return [passed[index] for index in sorted(taken)]

    def _weigh(self, time: int, waiting: Waiting) -> None:
        """Weigh the particles by one measurement (line 5 of Table 4.3) and note what it said of the belief."""
        measured = self._for_particles(time, waiting)
        if measured is None:
            return
        record = self._intake.records.of(measured.name)
        attended = self._attention.wants(measured.name, time)
        believed = self._believed(time, waiting, measured, attended)
        self._charge(WITNESSES)
        if not believed:
            record.refused["distrusted"] += 1
            if self.receivers is not None:
                self.receivers.distrusted(measured)
            return
        self._vehicle.level(self._acting, waiting.sample.reading, self._intake.frame, measured.repeats)
        self._take_evidence(time, measured, record, attended)

    def _for_particles(self, time: int, waiting: Waiting) -> Measurement | None:
        """Return what the particles are to be weighed by; what corrects the height beside them has done so here."""
        measured = self._measured(time, waiting)
        height = None if measured is None else self._vehicle.height_for(measured.model)
        if measured is None or height is None:
            return measured
        self._weigh_height(height, time, measured, self._intake.records.of(measured.name))
        return None

    def _measured(self, time: int, waiting: Waiting) -> Measurement | None:
        """Return what was read in its model's terms; ``None``, and the reason counted, where that cannot be."""
        vehicle = self._vehicle
        place = Place(time, self._intake.frame, vehicle.down, vehicle.controls, vehicle.motion)
        measured = waiting.sensor.measure(waiting.sample, place)
        if not isinstance(measured, Refusal):
            return measured
        record = self._intake.records.of(measured.name)
        if measured.reason == CONTROL:
            record.accepted += 1
            record.last = time
        else:
            record.refused[measured.reason] += 1
        return None

    def _weigh_height(self, height: Height, time: int, measured: Measurement, record: SensorRecord) -> None:
        """Correct the height, where it is beside the particles, by an altitude of ``time`` or before."""
        assert self.time is not None
        age = max(0.0, (self.time - time) / SECOND)
        evidence = height.weigh(cast(Altitude, measured.model), measured.value, measured.log_outlier, age)
        if evidence is None or not evidence.accepted:
            record.refused["no_height" if evidence is None else "invalid"] += 1
            return
        record.innovation = evidence.innovation
        record.last = time
        record.judge(measured.surprise(evidence.log_mean) > OUTLIER)
        self._charge("sensing")

    def _believed(self, time: int, waiting: Waiting, measured: Measurement, attended: bool) -> bool:
        """Ask whether the sensor is trusted; what one that was just found out did to the belief is taken back."""
        if self.trust is None or (self.search is not None and self.search.blind):
            return True
        if not attended:
            return self.trust.believes(waiting.sample, measured)
        believed = self.trust.admits(time, waiting.sample, measured)
        particles = self.trust.take_back()
        if particles is not None:
            self._belief.inject(particles)
            self.taken_back += 1
            for companion in self.companions:
                if companion is not self.trust:
                    companion.started(time)
        return believed

    def _worth(self, time: int, measured: Measurement) -> Measurement:
        """Return a measurement as the belief is to be weighed by it."""
        if self.latency is not None:
            measured = self.latency.punctual(measured)
        if self.receivers is not None and self.receivers.knows(measured) and not self._deputised:
            worth = self.receivers.split(measured)
        else:
            worth = measured if self.caution is None else self.caution.sized(measured)
        return worth if self.trust is None else self.trust.dispute.sized(time, worth)

    def _take_evidence(self, time: int, measured: Measurement, record: SensorRecord, attended: bool) -> None:
        if self.search is not None and self.search.blind:
            self.search.heard(time, measured)
            record.accepted += 1
            record.last = time
            return
        worth = self._worth(time, measured)
        evidence = self._acting.weigh(worth.model, worth.value)
        if not evidence.accepted:
            record.refused["invalid"] += 1
            return
        self._charge("sensing")
        surprise = measured.surprise(evidence.log_mean)
        for companion in self.companions:
            if attended or companion not in self.watchers:
                companion.weighed(time, measured, evidence, surprise > OUTLIER)
        self._charge(WITNESSES)
        record.innovation = evidence.innovation
        record.last = time
        record.judge(surprise > OUTLIER)
        if measured.absolute:
            self._health.measured(time, measured.name, surprise, measured.share, measured.outliers)
