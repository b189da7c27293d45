"""The estimator: samples in, estimates out, with no clock and no process of its own.

It binds what the wire said to the models of :mod:`filters` and keeps the belief at a delayed horizon: measurements
wait in the :class:`~service.timeline.Timeline` until the horizon passes them, the particle filter takes them in order
(Table 4.3), and an output predictor carries the moments from there to now with the controls already received. The
daemon's loop and a replay drive the very same object; only where ``now`` and ``afforded`` come from differs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from drivers.plausibility import implausible
from drivers.sample import GeodeticPosition, LocalPosition, Origin, Sample
from filters.belief import Belief
from filters.crew import Crew
from filters.kld import Demand
from filters.particle import ParticleFilter
from filters.policy import EffectiveShare, Policy, Wear
from service.config import Configuration
from service.estimate import Estimate, SensorStatus
from service.estimator.binding import (
    BoundSensor,
    Measurement,
    Place,
    Refusal,
    position_of,
)
from service.estimator.companion import Companion
from service.estimator.controls import Controls
from service.estimator.course import CROWD, Cause, Course, Level
from service.estimator.output import Output
from service.estimator.records import SensorRecord, SensorRecords
from service.estimator.start import Anchor, draw
from service.estimator.stopwatch import Silent, Stopwatch
from service.estimator.thinning import spaced
from service.estimator.track import SECOND
from service.estimator.vehicle import Vehicle
from service.geodesy import Geodetic, LocalFrame
from service.health import Facts, HealthMonitor
from service.timeline import FUTURE_TOLERANCE, Timeline

STRIDE = SECOND // 10
"""The belief is moved at each measurement, and at least this often: a chord of 0.1 s is still a good arc."""

TOGETHER = SECOND // 1000
"""Measurements within a millisecond are weighed at one time."""

FEW = 8
"""Up to a few measurements per tick are weighed each at its own time; more of them share four times."""

OUTLIER = 0.5
"""Probability of being the outlier part's from which a measurement counts as refused: it moved next to nothing."""

RESAMPLING: Policy = EffectiveShare(0.5)
"""When to resample: equation 4.36's effective sample size below half of the particles there are."""

POSITION_BIN = 0.25
HEADING_BIN = 0.1
"""Sides of the bins that the KLD bound counts: metres and radians."""

KLD_ERROR = 0.01
"""Nats. The bins count the pose only; the slow states beside it want several particles in each of its bins."""

STALE = 5 * SECOND
"""How far behind the horizon a starting measurement may lie: a slow computer is late, a minute in a queue is stale."""

START_COUNT = 10_000
"""Particles of a start about a known place; one over an area takes all that can be afforded."""

DEMAND_INTERVAL = SECOND // 5
GROWTH = 1.25
"""The set grows between resamplings only if the demand is this much larger than the count."""


C = TypeVar("C", bound=Companion)


class Waiting(NamedTuple):
    """A sample on its way to the sensor that wants it."""

    sensor: BoundSensor
    sample: Sample


class Estimator:
    """A vehicle's belief, fed with samples.

    Parameters
    ----------
    configuration : Configuration
        The configuration; in a replay possibly without vehicle and links.
    stopwatch : Stopwatch
        What the stages of a tick are charged to.
    seed : int
        Of the random numbers: same samples, counts and seed, same bytes.
    crew : Crew, optional
        Threads that help with the particles; they change no byte.
    """

    def __init__(
        self,
        configuration: Configuration,
        stopwatch: Stopwatch | None = None,
        seed: int = 0,
        crew: Crew | None = None,
    ) -> None:
        self.configuration = configuration
        self.seed = seed
        self.health = HealthMonitor()
        self.reset_counter = 0
        self._stopwatch: Stopwatch = stopwatch or Silent()
        self._vehicle = Vehicle(configuration)
        self._controls: Controls = self._vehicle.controls
        self._sensors = [
            BoundSensor(s, {b.id: b for b in configuration.beacon}) for s in configuration.sensor
        ]
        self._filter = ParticleFilter(
            self._vehicle.motion,
            capacity=configuration.budget.particles_max,
            seed=seed,
            slow=self._vehicle.slow_states,
            crew=crew,
        )
        self._demand_of = Demand(
            POSITION_BIN,
            HEADING_BIN,
            error=KLD_ERROR,
            minimum=configuration.budget.particles_min,
            maximum=configuration.budget.particles_max,
        )
        self._timeline: Timeline[Waiting] = Timeline()
        self._records = SensorRecords()
        self._heard: set[str] = set()
        self._dropped: Counter[str] = Counter()
        self._frame = self._configured_frame()
        self._output = Output(self._vehicle, self._filter)
        self._belief_time: int | None = None
        self._demand = configuration.budget.particles_min
        self._demand_time = -(2**62)
        self._sequence = 0
        self._freely = Course()
        self._companions: list[Companion] = []

    def accompany(self, make: Callable[[Vehicle, Belief], C]) -> C:
        """Have a companion told of every call on the belief from now on, and return it."""
        companion = make(self._vehicle, self._filter)
        self._companions.append(companion)
        return companion

    # --- samples in ---------------------------------------------------------------------------------------------

    def ingest(self, samples: Iterable[Sample]) -> None:
        """Take samples as they arrive: controls at once, measurements into the timeline.

        Whatever they hold, nothing is raised. A driver refuses what cannot be true; should it come all the same, it
        is refused here and counted, because one number that is not finite would spoil the belief for ever.
        """
        for sample in samples:
            reading = sample.reading
            if sample.time > sample.received + FUTURE_TOLERANCE:
                self._dropped["future"] += 1
            elif isinstance(reading, Origin):
                self._hear_origin(reading)
            else:
                self._controls.take(sample)
                self._queue(sample)

    def _hear_origin(self, origin: Origin) -> None:
        if implausible(origin) is None:
            self._learn_origin(Geodetic(origin.latitude, origin.longitude, origin.altitude))
        else:
            self._dropped["implausible"] += 1

    def _queue(self, sample: Sample) -> None:
        """Have ``sample`` wait for the horizon; it is the first sensor's that wants it: twice it would count double."""
        sensor = next((sensor for sensor in self._sensors if sensor.wants(sample)), None)
        if sensor is None:
            return
        record = self._records.of(sensor.name(sample))
        record.arrivals += 1
        if implausible(sample.reading) is not None:
            self._dropped["implausible"] += 1
            record.refused["implausible"] += 1
            return
        self._heard.add(sensor.title)
        reason = self._timeline.insert(Waiting(sensor, sample), sample.time - sensor.delay, sample.received)
        if reason is not None:
            record.refused[reason] += 1

    def _configured_frame(self) -> LocalFrame | None:
        origin = self.configuration.origin
        if origin is None:
            return None
        return LocalFrame.from_degrees(origin.latitude, origin.longitude, origin.altitude)

    def _learn_origin(self, origin: Geodetic) -> None:
        if self._frame is None:
            self._frame = LocalFrame(origin)

    # --- one tick -----------------------------------------------------------------------------------------------

    def tick(self, now: int, unix: int, afforded: int, course: Course | None = None) -> Estimate:
        """Move the horizon to ``now`` less its delay and return the belief, carried to ``now``.

        A measurement that the course has no room for is dropped and counted, never kept for the next tick: that one
        has its own.

        Parameters
        ----------
        now, unix : int
            The tick's time, nanoseconds, on the monotonic and on the Unix clock.
        afforded : int
            How many particles the budget allows.
        course : Course, optional
            How far the tick may go beside that; by default all the way, but for a crowd of measurements.
        """
        if course is None:
            course = self._freely
            course.set(Level.FULL, Cause.NONE, CROWD)
        horizon = now - round(self.configuration.loop.horizon_ms * 1e6)
        passed = self._timeline.release(horizon)
        self._stopwatch.lap("ingest")
        afforded = min(afforded, self._filter.capacity)
        if self._belief_time is None:
            passed = self._try_start(horizon, self._fresh(horizon, passed), afforded)
        if self._belief_time is not None:
            self._fuse(passed, afforded, course)
            if horizon - self._belief_time >= STRIDE:
                self._advance(horizon)
            self._fit_count(afforded)
            if course.level is not Level.PREDICTION_ONLY:
                self._reckon_demand(now)
        self._controls.forget((horizon if self._belief_time is None else self._belief_time) - SECOND)
        estimate = self._speak(now, unix, afforded, course)
        self._sequence += 1
        self._stopwatch.lap("extraction")
        return estimate

    def _fuse(self, passed: list[tuple[int, Waiting]], afforded: int, course: Course) -> None:
        assert self._belief_time is not None
        fused = False
        course.offered = len(passed)
        passed = self._thinned(passed, course)
        together = TOGETHER if len(passed) <= FEW else max(TOGETHER, (passed[-1][0] - passed[0][0]) // 4)
        for index, (time, waiting) in enumerate(passed):
            if not course.goes_on():
                self._leave_out(passed[index:], "cut")
                break
            if fused and time - self._belief_time > together:
                self._resample_if_worn(afforded)
                fused = False
            if not fused:
                self._advance(time)
            self._weigh(time, waiting)
            fused = True
        if fused:
            self._resample_if_worn(afforded)

    def _thinned(self, passed: list[tuple[int, Waiting]], course: Course) -> list[tuple[int, Waiting]]:
        """Take as many measurements as the course has room for, and refuse the rest."""
        if len(passed) <= course.most:
            return passed
        if course.level is Level.PREDICTION_ONLY:
            self._leave_out(passed, "prediction only")
            return []
        taken = set(spaced([waiting.sensor.name(waiting.sample) for _, waiting in passed], course.most))
        self._leave_out([item for index, item in enumerate(passed) if index not in taken], "thinned")
        return [passed[index] for index in sorted(taken)]

    def _leave_out(self, passed: list[tuple[int, Waiting]], reason: str) -> None:
        """Count measurements for which the tick had no room, per sensor and in all."""
        for _, waiting in passed:
            self._refuse(waiting, reason)
        self._dropped[reason] += len(passed)

    def _advance(self, time: int) -> None:
        """Predict the belief to ``time`` in strides (line 4 of Table 4.3)."""
        assert self._belief_time is not None
        stride = max(STRIDE, (time - self._belief_time) // 50)
        while time > self._belief_time:
            step = min(time, self._belief_time + stride)
            self._vehicle.predict(self._filter, self._belief_time, step)
            for companion in self._companions:
                companion.moved(self._belief_time, step)
            self._belief_time = step
        self._stopwatch.lap("motion")

    def _weigh(self, time: int, waiting: Waiting) -> None:
        """Weigh the particles by one measurement (line 5 of Table 4.3) and note what it said of the belief."""
        place = Place(time, self._frame, self._vehicle.down, self._controls)
        measured = waiting.sensor.measure(waiting.sample, place)
        record = self._records.of(measured.name)
        if isinstance(measured, Refusal):
            record.refused[measured.reason] += 1
            return
        self._vehicle.level(waiting.sample.reading, self._frame, measured.repeats)
        self._take_evidence(time, measured, record)
        self._stopwatch.lap("sensing")

    def _take_evidence(self, time: int, measured: Measurement, record: SensorRecord) -> None:
        evidence = self._filter.weigh(measured.model, measured.value)
        if not evidence.accepted:
            record.refused["invalid"] += 1
            return
        surprise = measured.surprise(evidence.log_mean)
        for companion in self._companions:
            companion.weighed(time, measured, evidence, surprise > OUTLIER)
        record.innovation = evidence.innovation
        record.last = time
        if surprise > OUTLIER:
            record.refused["outlier"] += 1
        else:
            record.accepted += 1
        if measured.absolute:
            self.health.measured(time, measured.name, surprise)

    def _resample_if_worn(self, afforded: int) -> None:
        self._filter.normalize()
        if RESAMPLING.due(Wear(self._filter.count, self._filter.effective_sample_size)):
            self._filter.resample(self._target(afforded))
        self._stopwatch.lap("resampling")

    def _target(self, afforded: int) -> int:
        budget = self.configuration.budget
        return max(budget.particles_min, min(self._demand, afforded, budget.particles_max))

    def _fit_count(self, afforded: int) -> None:
        """Shrink at once when the budget shrank; grow between resamplings only when the demand grew clearly."""
        count, target = self._filter.count, self._target(afforded)
        if count > max(afforded, self.configuration.budget.particles_min) or target > GROWTH * count:
            self._filter.normalize()
            self._filter.resample(target)
            self._stopwatch.lap("resampling")

    def _reckon_demand(self, now: int) -> None:
        if now - self._demand_time >= DEMAND_INTERVAL:
            self._demand = self._demand_of.particles(self._filter)
            self._demand_time = now
            self._stopwatch.lap("resampling")

    # --- start --------------------------------------------------------------------------------------------------

    def _fresh(self, horizon: int, passed: list[tuple[int, Waiting]]) -> list[tuple[int, Waiting]]:
        """Refuse what is older than a start may lie back: it waited in a queue while nobody ran."""
        fresh = [(time, waiting) for time, waiting in passed if time >= horizon - STALE]
        for _, waiting in passed[: len(passed) - len(fresh)]:
            self._refuse(waiting, "late")
            self._dropped["late"] += 1
        return fresh

    def _refuse(self, waiting: Waiting, reason: str) -> None:
        self._records.of(waiting.sensor.name(waiting.sample)).refused[reason] += 1

    def _try_start(
        self, horizon: int, passed: list[tuple[int, Waiting]], afforded: int
    ) -> list[tuple[int, Waiting]]:
        """Start the belief if what is needed has come; return the measurements that lie after the start."""
        if self.configuration.start.mode == "first_fix":
            return self._start_at_fix(passed, afforded)
        first = min((time for time, _ in passed), default=horizon)
        control = self._controls.earliest
        if not passed and (control is None or control > horizon):
            return passed
        time = first if control is None else min(first, max(control, horizon - SECOND))
        start = self.configuration.start
        anchor = None if start.position is None else Anchor(start.position, start.sigma)
        self._start(time, anchor, afforded)
        return passed

    def _start_at_fix(self, passed: list[tuple[int, Waiting]], afforded: int) -> list[tuple[int, Waiting]]:
        for index, (time, waiting) in enumerate(passed):
            anchor = self._anchor_of(waiting)
            if anchor is not None:
                self._start(time, anchor, afforded)
                return passed[index + 1 :]
            self._refuse(waiting, "before_start")
        return []

    def _anchor_of(self, waiting: Waiting) -> Anchor | None:
        """Return where a position fix says to start, with the origin learned from it if there was none."""
        reading = waiting.sample.reading
        if not isinstance(reading, GeodeticPosition | LocalPosition):
            return None
        if isinstance(reading, GeodeticPosition):
            altitude = 0.0 if reading.altitude is None else reading.altitude
            self._learn_origin(Geodetic(reading.latitude, reading.longitude, altitude))
        fix = position_of(reading, self._frame)
        if fix is None:
            return None
        sigma = waiting.sensor.sigma(reading.sigma_horizontal)
        return Anchor(fix, (sigma, sigma, reading.sigma_vertical or 2 * sigma))

    def _start(self, time: int, anchor: Anchor | None, afforded: int) -> None:
        wanted = self._filter.capacity if anchor is None else START_COUNT
        count = max(self.configuration.budget.particles_min, min(afforded, wanted))
        self._filter.initialize(draw(self.configuration, self._filter.names, count, self.seed, anchor))
        self._vehicle.stand_at(anchor)
        self._belief_time = time
        for companion in self._companions:
            companion.started(time)
        self.health.restart()

    # --- estimates out ------------------------------------------------------------------------------------------

    def _speak(self, now: int, unix: int, afforded: int, course: Course) -> Estimate:
        pose = None
        if self._belief_time is not None:
            pose = self._output.at(self._belief_time, now)
        facts = Facts(
            now,
            self._belief_time is not None,
            self.missing,
            pose.radius95 if pose else None,
            afforded,
            self.configuration.budget.particles_min,
            now - self._timeline.horizon,
        )
        state = self.health.judge(facts)
        return self._output.estimate(
            pose,
            self._frame,
            sequence=self._sequence,
            time=unix / SECOND,
            monotonic_ns=now,
            health=state,
            reason=self.health.reason,
            level=int(course.reached(self._demand, afforded)) if pose else 0,
            level_reason=course.reason(self._demand, afforded) if pose else "",
            demanded=self._demand,
            afforded=afforded,
            reset_counter=self.reset_counter,
        )

    @property
    def demand(self) -> int:
        """How many particles the belief needs (KLD bound)."""
        return self._demand

    @property
    def missing(self) -> list[str]:
        """What the belief waits for, in the user's words."""
        distance, turn = self._controls.sources
        absent = [s.title for s in self._sensors if s.title not in self._heard]
        if distance is None:
            absent.insert(0, "odometry")
        if turn is None:
            absent.insert(1 if distance is None else 0, "yaw rate")
        return absent

    @property
    def drops(self) -> dict[str, int]:
        """What came and was not used, since the start."""
        counts = self._dropped + self._timeline.refused
        counts["control out of order"] = self._controls.out_of_order
        counts["control implausible"] = self._controls.implausible
        return {what: count for what, count in counts.items() if count}

    def sensors(self, now: int) -> list[SensorStatus]:
        """Return every sensor's status, heard or not; rates are over the time since the last call."""
        silent = [s.title for s in self._sensors if s.title not in self._heard]
        return [
            *self._records.statuses(now),
            *(SensorStatus(title, 0.0, None, 0, {}, None, None) for title in silent),
        ]

    def cloud(self, count: int) -> NDArray[np.float32]:
        """Return a fair sub-sample of the particles at the last tick: north, east, heading, weight; (count, 4)."""
        if self._belief_time is None:
            return np.empty((0, 4), np.float32)
        return self._filter.cloud(min(count, self._filter.count), self._output.displacement)
