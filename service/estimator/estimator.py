"""The estimator: samples in, estimates out, with no clock and no process of its own.

It binds what the wire said to the models of :mod:`filters` and keeps the belief at a delayed horizon: measurements
wait in the :class:`~service.estimator.intake.Intake` until the horizon passes them, the particle filter takes them in
order (Table 4.3, :class:`~service.estimator.fusion.Fusion`), and an output predictor carries the moments from there to
now with the controls already received. The daemon's loop and a replay drive the very same object; only where ``now``
and ``afforded`` come from differs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import nullcontext
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from drivers.sample import SECOND, Sample
from filters.crew import Crew
from filters.particle import ParticleFilter
from service.checkpoint import Kept
from service.config import Configuration, Start
from service.estimate import Estimate, Hypotheses, SensorStatus
from service.estimator.caution import caution_of
from service.estimator.companion import Companion, Watched
from service.estimator.course import CROWD, Cause, Course, Level
from service.estimator.deputy import Deputy
from service.estimator.fusion import Fusion
from service.estimator.ground import GroundVehicle
from service.estimator.hypotheses import Tracker
from service.estimator.intake import Intake, Passed
from service.estimator.jumps import TRACKS, UNSEEN, Jumps
from service.estimator.lasting import Lasting
from service.estimator.latecomers import latecomers_of
from service.estimator.latency import latency_of
from service.estimator.mode import mode_of
from service.estimator.output import Output
from service.estimator.population import Population
from service.estimator.receivers import Receivers, biases_of, learned
from service.estimator.resuming import begin_again, kept_of
from service.estimator.search import Search
from service.estimator.start import Anchor, draw
from service.estimator.starting import Starter
from service.estimator.stopwatch import KALMAN, Silent, Stopwatch
from service.estimator.trust import trust_of
from service.estimator.vehicle import Vehicle, vehicle_of
from service.health import Facts, HealthMonitor

START_COUNT = 10_000
"""Particles of a start about a known place; one over an area takes all that can be afforded."""

PATIENCE = 20 * SECOND
"""A search waits so long for the judge of a lone receiver, who needs two to three seconds for a great lie."""

C = TypeVar("C", bound=Companion)


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
        self._stopwatch: Stopwatch = stopwatch or Silent()
        self._vehicle = vehicle_of(configuration)
        self._jumps = Jumps(TRACKS if self._vehicle.guided else UNSEEN)
        biases = biases_of(configuration)
        self._filter = ParticleFilter(
            self._vehicle.motion,
            capacity=configuration.budget.particles_max,
            seed=seed,
            slow=[*self._vehicle.slow_states, *learned(biases)],
            crew=crew,
        )
        self._intake = Intake(configuration, self._vehicle.controls)
        self._starter = Starter(configuration, self._intake, self._vehicle.controls)
        self._population = Population(configuration, self._filter, self._stopwatch)
        self._fusion = Fusion(
            self._vehicle, self._filter, self._population, self._intake, self.health, self._stopwatch
        )
        self._search = Search(configuration, self._vehicle, self._filter.names, seed)
        self._fusion.search = self._search
        self._fusion.companions.append(self._search)
        self._mode = mode_of(configuration, self._vehicle, self._filter)
        if self._mode is not None:
            mode = self._mode
            self._population.still = lambda: mode.still
            self._fusion.companions.append(mode)
        caution = caution_of(configuration, self._vehicle, self._filter)
        if caution is not None:
            self._fusion.caution = caution
            self._fusion.companions.append(caution)
        self._trust = trust_of(configuration, self._vehicle, self._filter, seed)
        if self._trust is not None:
            self._fusion.trust = self._trust
            self._fusion.companions.append(self._trust)
        self._fusion.watchers = [
            one for one in (self._search, self._mode, caution, self._trust) if one is not None
        ]
        latecomers = latecomers_of(configuration, self._vehicle, self._filter)
        if latecomers is not None:
            self._intake.latecomers = self._fusion.latecomers = latecomers
            self._fusion.companions.append(latecomers)
        self._late = 0 if latecomers is None else latecomers.stretch
        self._deputy = Deputy(self._vehicle, self._filter, seed)
        self._fusion.deputy = self._deputy
        self._fusion.companions.append(self._deputy)
        self._tracker = Tracker(self._filter) if configuration.honesty.hypotheses else None
        if self._tracker is not None:
            self._population.tracker = self._tracker
            self._fusion.companions.append(self._tracker)
        receivers = None
        if biases and isinstance(self._vehicle, GroundVehicle):
            placed = configuration.start.mode == "given"
            receivers = Receivers(biases, self._vehicle, self._filter, placed)
            self._fusion.receivers = self._population.receivers = receivers
            self._fusion.companions.append(receivers)
            if caution is not None:
                caution.receivers = receivers
        latency = latency_of(configuration, self._vehicle, self._filter)
        if latency is not None:
            self._fusion.latency = latency
            self._fusion.companions.append(latency)
        lasting = Lasting(receivers, latency)
        self._fusion.companions.append(lasting)
        self._output = Output(
            self._vehicle,
            self._filter,
            self._tracker,
            lasting,
            None if self._trust is None else self._trust.dispute,
        )
        self._left_since: int | None = None
        self._left_at = 0
        self._sequence = 0
        self._freely = Course()
        self._told: Start | None = None
        self._spoken: Estimate | None = None

    def accompany(self, make: Callable[[Vehicle, Watched], C]) -> C:
        """Have a companion told of every call on the belief from now on, and return it."""
        companion = make(self._vehicle, self._filter)
        self._fusion.companions.append(companion)
        return companion

    def ingest(self, samples: Iterable[Sample]) -> None:
        """Take samples as they arrive; whatever they hold, nothing is raised (:meth:`Intake.take`)."""
        self._intake.take(samples)

    # --- beginning elsewhere ----------------------------------------------------------------------------------------

    def kept(self) -> Kept | None:
        """Return what a later process may go on from; ``None`` while the belief has no place."""
        if self._fusion.time is None or self._search.blind or self._deputy.speaking:
            return None
        return kept_of(self._filter, self._fusion.time, self._vehicle, self._intake, self._spoken)

    def resume(self, kept: Kept) -> None:
        """Begin, before the first tick, with what another process kept: the way since then is unknown.

        Raises
        ------
        ValueError
            It is of a belief with other dimensions.
        """
        begin_again(kept, self._filter, self._vehicle, self._intake)
        self._search.placed()
        self._fusion.begin(kept.time)
        self._jumps.steps = kept.reset_counter

    def reinitialize(self, start: Start) -> None:
        """Begin anew at the next tick as ``start`` says; ``reset_counter`` steps."""
        self.configuration = self.configuration.model_copy(update={"start": start})
        self._starter = Starter(self.configuration, self._intake, self._vehicle.controls)
        self._told = start

    def _obey(self, now: int, horizon: int, afforded: int) -> None:
        """Begin anew as was told since the last tick."""
        start, self._told = self._told, None
        if start is None:
            return
        self._search.told(self.configuration)
        self._jumps.done(now)
        if start.mode == "first_fix":
            self._fusion.time = None
            self.health.restart()
        else:
            anchor = None if start.position is None else Anchor(start.position, start.sigma)
            self._start(horizon, anchor, afforded)

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
        if not self._vehicle.guided:
            horizon = self._intake.complete.until(now, horizon)
        passed = self._intake.release(horizon)
        self._stopwatch.lap("ingest")
        afforded = min(afforded, self._filter.capacity)
        self._obey(now, horizon, afforded)
        if self._fusion.time is None:
            passed = self._begin(horizon, passed, afforded)
        if self._fusion.time is not None:
            self._move(now, horizon, passed, afforded, course)
        oldest = horizon if self._fusion.time is None else self._fusion.time - self._late
        self._vehicle.controls.forget(oldest - SECOND)
        estimate = self._spoken = self._speak(now, unix, afforded, course)
        self._sequence += 1
        self._stopwatch.lap(KALMAN if course.deputised else "extraction")
        return estimate

    def _begin(self, horizon: int, passed: Passed, afforded: int) -> Passed:
        """Begin the belief if what is needed has come; return the measurements that lie after its beginning."""
        beginning = self._starter.attempt(horizon, passed)
        if beginning is None:
            return []
        self._start(beginning.time, beginning.anchor, afforded)
        return beginning.rest

    def _start(self, time: int, anchor: Anchor | None, afforded: int) -> None:
        wanted = self._filter.capacity if anchor is None else START_COUNT
        count = max(self.configuration.budget.particles_min, min(afforded, wanted))
        self._filter.initialize(draw(self.configuration, self._filter.names, count, self.seed, anchor))
        self._vehicle.stand_at(anchor)
        self._fusion.begin(time)

    def _move(self, now: int, horizon: int, passed: Passed, afforded: int, course: Course) -> None:
        """Bring the belief to the horizon with all that was measured up to there."""
        self._appoint(afforded, course)
        taken_back = self._fusion.taken_back
        self._fusion.fuse(passed, afforded, course)
        self._fusion.keep_up(horizon)
        self._fusion.catch_up(afforded, course)
        if self._fusion.taken_back > taken_back:
            self._jumps.done(now)
        self._find(now, afforded)
        if self._deputy.speaking:
            return
        if course.level < Level.NO_CLOUD and not self._search.blind:
            self._look(now)
        self._population.fit(afforded)
        if not course.only_predicts:
            self._population.reckon(now)

    def _appoint(self, afforded: int, course: Course) -> None:
        """Have the Kalman filter stand in for the particles where the course wants it, and them take over after it."""
        if course.level is Level.KALMAN and not self._search.blind:
            course.deputised = self._deputy.take_over()
        if self._deputy.speaking and not course.deputised:
            self._deputy.hand_back(self._population.clamp(self.demand, afforded))
            if self._tracker is not None and self._fusion.time is not None:
                self._tracker.started(self._fusion.time)
            if self._fusion.receivers is not None and self._fusion.time is not None:
                self._fusion.receivers.started(self._fusion.time)
            self._stopwatch.lap("resampling")

    def _find(self, now: int, afforded: int) -> None:
        """Let the search for the place go on, and begin anew where it has found one."""
        assert self._fusion.time is not None
        blind = self._search.blind
        if self._search.idle or (not blind and self._left_to_trust(self._fusion.time)):
            return
        self._search.work(self._fusion.time)
        found = self._search.found(self._fusion.time, self._population.clamp(START_COUNT, afforded))
        if (
            found is not None
            and not blind
            and self._trust is not None
            and self._trust.refutes(found["heading"])
        ):
            self._left_since, found = self._fusion.time, None
        if found is not None:
            self._filter.initialize(found)
            with self._trust.unmoved() if self._trust is not None else nullcontext():
                self._fusion.begin(self._fusion.time)
            self.health.heard(self._fusion.time)
            if not blind:
                self._jumps.done(now)
        self._stopwatch.lap("search")

    def _left_to_trust(self, time: int) -> bool:
        """Say whether what sets the search off may be a lie; not for ever, if the judge of that sees none."""
        trust = self._trust
        if trust is None or not trust.decides:
            self._left_since = None
            return False
        if self._left_since is None or time - self._left_at > SECOND:
            self._left_since = time
        self._left_at = time
        return trust.suspects or time - self._left_since < PATIENCE

    def _look(self, now: int) -> None:
        """Ask for the hypotheses; while there are several nobody becomes a witness, for he would be of one of them."""
        if self._tracker is None:
            return
        self._tracker.look(now)
        if self._trust is not None:
            self._trust.divided = self._tracker.count > 1
        self._stopwatch.lap("extraction")

    # --- estimates out ------------------------------------------------------------------------------------------

    def _speak(self, now: int, unix: int, afforded: int, course: Course) -> Estimate:
        time = self._fusion.time
        speaker = self._deputy if self._deputy.speaking else self._output
        pose = None if time is None else speaker.at(time, now)
        facts = Facts(
            now,
            time is not None,
            self.missing,
            pose.radius95 if pose else None,
            afforded,
            self.configuration.budget.particles_min,
            now - self._intake.horizon,
            self._search.status,
            "" if self._tracker is None else self._tracker.ambiguity(),
            self._search.elsewhere,
        )
        if pose is not None:
            self._search.published(pose.moments)
        state = self.health.judge(facts)
        if self._tracker is not None:
            self._jumps.led(now, self._tracker.jumps)
        estimate = self._output.estimate(
            pose,
            self._intake.frame,
            sequence=self._sequence,
            time=unix / SECOND,
            monotonic_ns=now,
            health=state,
            reason=self.health.reason,
            level=int(course.reached(self.demand, afforded)) if pose else 0,
            level_reason=course.reason(self.demand, afforded) if pose else "",
            demanded=self.demand,
            afforded=afforded,
            reset_counter=self._jumps.steps,
            mode=None if self._mode is None or pose is None else self._mode.mode,
        )
        self._jumps.spoken(estimate)
        return estimate

    @property
    def reset_counter(self) -> int:
        """Jumps of the published position so far, for other reasons than motion."""
        return self._jumps.steps

    @property
    def demand(self) -> int:
        """How many particles the belief needs (KLD bound)."""
        return self._population.demand

    @property
    def missing(self) -> list[str]:
        """What the belief waits for, in the user's words."""
        return [*self._vehicle.missing, *self._intake.missing]

    @property
    def caught_up(self) -> int:
        """How many measurements came late and were fused all the same."""
        return self._intake.caught_up

    @property
    def drops(self) -> dict[str, int]:
        """What came and was not used, since the start."""
        return self._intake.drops

    def sensors(self, now: int) -> list[SensorStatus]:
        """Return every sensor's status, heard or not; rates are over the time since the last call."""
        return self._intake.statuses(now, None if self._trust is None else self._trust.log_odds)

    def hypotheses(self, unix: float) -> Hypotheses | None:
        """Return the places that the belief held at the last tick, ``unix`` (s); ``None`` while it has none."""
        return None if self._fusion.time is None else self._output.hypotheses(unix)

    def cloud(self, count: int) -> NDArray[np.float32]:
        """Return a fair sub-sample of the particles at the last tick: north, east, heading, weight; (count, 4)."""
        if self._fusion.time is None:
            return np.empty((0, 4), np.float32)
        return self._filter.cloud(min(count, self._filter.count), self._output.displacement)
