"""The real-time loop: every tick takes what the links said, lets the belief go on, and publishes it, on time.

It waits for nobody, writes nothing to disk and logs nothing while it runs. Everything that it sends or takes
is a datagram on a queue that the kernel bounds; what a queue refuses is counted and published.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from drivers.sample import SECOND, Sample
from service.budget import Meters
from service.channels import BUDGET, ESTIMATE, HEALTH, HYPOTHESES, SENSORS, Heart, Outlet, cloud
from service.checkpoint import Checkpoints
from service.config import Configuration
from service.debt import Debt
from service.decisions import DecisionSender
from service.estimate import Budget, Cloud, Estimate, Health, HealthState, Hypotheses, Sensors, SensorStatus
from service.estimator.course import Course, Level
from service.estimator.stopwatch import KALMAN
from service.governor import CLOUD, Decision, Governor
from service.inlet import Inlet
from service.orders import Orders
from service.schedule import Schedule
from service.tick_costs import Line

INGEST_SHARE = 0.5
"""Share of the budget that taking samples may use in one tick, all links together; the rest waits."""

BEAT_RATE = 10.0
HYPOTHESES_RATE = 10.0
CLOUD_RATE = 5.0

_OTHER = "other"


class Estimator(Protocol):
    """What the loop needs of :class:`service.estimator.Estimator`."""

    @property
    def demand(self) -> int:
        """Particles that the belief needs in the next tick."""
        ...

    @property
    def drops(self) -> dict[str, int]:
        """Samples that were not used, by reason."""
        ...

    def ingest(self, samples: Iterable[Sample], /) -> None:
        """Take samples in."""
        ...

    def tick(self, now_ns: int, unix_ns: int, afforded: int, course: Course, /) -> Estimate:
        """Bring the belief to now."""
        ...

    def sensors(self, now_ns: int, /) -> list[SensorStatus]:
        """Return every sensor as the belief sees it."""
        ...

    def hypotheses(self, unix: float, /) -> Hypotheses | None:
        """Return the places that the belief holds; ``None`` while it holds none."""
        ...

    def cloud(self, count: int, /) -> NDArray[np.float32]:
        """Return at most ``count`` particles, shape (n, 4): north, east, heading, weight."""
        ...


class Loop:
    """Ticks at the configured rate.

    Parameters
    ----------
    configuration : Configuration
        Rate, budget and bounds, and how many particles go out.
    estimator : Estimator
        The belief; its stopwatch is ``meters``.
    meters : Meters
        What measures the ticks.
    inlets : Sequence[Inlet]
        One for each link.
    outlet : Outlet
        Queue to the publisher.
    heart : Heart
        Line to the supervisor.
    shapes : Mapping[str, Line]
        What the stages cost in the rehearsal, for the governor to start from.
    decisions : DecisionSender, optional
        Where a record of every tick goes.
    orders : Orders, optional
        What users tell the belief.
    checkpoints : Checkpoints, optional
        Where what survives a restart goes, once a second.
    """

    def __init__(
        self,
        configuration: Configuration,
        estimator: Estimator,
        meters: Meters,
        inlets: Sequence[Inlet],
        outlet: Outlet,
        heart: Heart,
        shapes: Mapping[str, Line],
        decisions: DecisionSender | None = None,
        orders: Orders | None = None,
        checkpoints: Checkpoints | None = None,
    ) -> None:
        self._rate = configuration.loop.rate
        self._budget_ms = configuration.budget.cpu_ms
        self._cloud_count = configuration.publish.particles
        self._estimator = estimator
        self._meters = meters
        self._inlets = inlets
        self._outlet = outlet
        self._heart = heart
        bounds = configuration.budget.particles_min, configuration.budget.particles_max
        self._governor = Governor(self._budget_ms * 1e-3, *bounds, shapes, 1.0 / self._rate)
        self._debt = Debt(self._budget_ms * 1e-3, 1.0 / self._rate)
        self._decisions = decisions
        self._orders = orders
        self._checkpoints = checkpoints
        self._spare = 0.0
        self._course = Course(overrunning=self._overrunning)
        self._taken = [0] * len(inlets)
        self._booked = 0
        slices = max(1, len(inlets))
        self._slice_ns = round(INGEST_SHARE * self._budget_ms * 1e-3 * SECOND / slices)
        self._second = max(1, round(self._rate))
        self._beat_every = max(1, round(self._rate / BEAT_RATE))
        self._hypotheses_every = max(1, round(self._rate / HYPOTHESES_RATE))
        self._cloud_every = max(1, round(self._rate / CLOUD_RATE))
        self._schedule = Schedule(self._rate, 0)
        self._encoder = msgspec.json.Encoder()
        self._datagram = bytearray(4096)
        self._health: Health | None = None
        self.ticks = 0
        """Ticks done."""
        self.overruns = 0
        """Ticks that cost more than the budget."""
        self.cuts = 0
        """Ticks whose weighing was ended early."""
        self._levels = dict.fromkeys(Level, 0)
        self._faults = _page_faults()

    @property
    def missed_ticks(self) -> int:
        """Ticks that were never done because an earlier one was too late."""
        return self._schedule.missed

    def run(self, stopped: Callable[[], bool]) -> None:
        """Tick until ``stopped`` says so, which is asked once per tick."""
        self._schedule = Schedule(self._rate, time.monotonic_ns())
        self._booked = -1
        while not stopped():
            deadline = self._schedule.deadline_ns
            ahead = deadline - time.monotonic_ns()
            if ahead > 0:
                # From Python 3.11 on this is clock_nanosleep to an absolute time of the monotonic clock.
                time.sleep(ahead / SECOND)
            began = time.monotonic_ns()
            self.tick(began)
            ended = time.monotonic_ns()
            self._account((began - deadline) / SECOND, (ended - began) / SECOND)
            self._schedule.advance(time.monotonic_ns())

    def tick(self, now_ns: int) -> Estimate:
        """Do one tick: take, decide, estimate, publish."""
        meters, course = self._meters, self._course
        meters.begin()
        for index, inlet in enumerate(self._inlets):
            before = inlet.samples
            inlet.drain(self._estimator.ingest, time.monotonic_ns() + self._slice_ns)
            self._taken[index] = inlet.samples - before
        if self._orders is not None:
            self._orders.take()
        meters.lap("ingest")
        decision = self._governor.decide(self._estimator.demand)
        self._spare = self._budget_ms * 1e-3 - self._governor.reserve(decision.count)
        course.set(decision.level, decision.cause, decision.most)
        meters.lap(_OTHER)
        unix_ns = time.time_ns()
        estimate = self._estimator.tick(now_ns, unix_ns, decision.afforded, course)
        meters.lap("extraction")
        self._send(ESTIMATE, estimate)
        self._send_health(estimate)
        self._send_at_leisure(estimate, now_ns)
        if self._decisions is not None:
            self._decisions.send(self.ticks, now_ns, unix_ns, decision.afforded, course, self._taken)
        meters.lap("publishing")
        self._send_cloud_in_turn(estimate, decision)
        self._learn(estimate.particles)
        self._levels[Level(estimate.level)] += 1
        self.cuts += course.cut
        self.ticks += 1
        return estimate

    def _overrunning(self) -> bool:
        """Say whether what the tick has spent leaves only what must still be done."""
        return self._meters.spent > self._spare

    def _send(self, tag: bytes, value: msgspec.Struct) -> None:
        self._datagram[:1] = tag
        self._encoder.encode_into(value, self._datagram, 1)
        self._outlet.send(self._datagram)

    def _send_health(self, estimate: Estimate) -> None:
        """Say the state when it has changed, the position has jumped, or the publisher has started anew.

        A reason alone does not count: it holds figures that change all the time.
        """
        last = self._health
        if last is None or last.state != estimate.health:
            since = estimate.time
        elif last.reset_counter != estimate.reset_counter or self._heart.called():
            since = last.since
        else:
            return
        self._health = Health(estimate.time, estimate.health, estimate.reason, since, estimate.reset_counter)
        self._send(HEALTH, self._health)

    def _send_at_leisure(self, estimate: Estimate, now_ns: int) -> None:
        """Send what goes out less often; each in a tick of its own where the rate leaves room."""
        phase = self.ticks % self._second
        if phase == self._second // 4:
            self._send(BUDGET, self.budget(estimate))
        elif phase == self._second // 2:
            self._send(SENSORS, self.sensors(estimate.time, now_ns))
        elif phase == 3 * self._second // 4 and self._checkpoints is not None:
            self._checkpoints.send(now_ns, round(estimate.time * SECOND))
        if self.ticks % self._hypotheses_every == 0 and estimate.level < Level.NO_CLOUD:
            hypotheses = self._estimator.hypotheses(estimate.time)
            if hypotheses is not None:
                self._send(HYPOTHESES, hypotheses)
        if self.ticks % self._beat_every == 0 or self._course.rested:
            self._heart.beat()

    def _send_cloud_in_turn(self, estimate: Estimate, decision: Decision) -> None:
        due = self.ticks % self._cloud_every == self._cloud_every // 2
        wanted = self._cloud_count and estimate.health != HealthState.WAITING
        if not (due and wanted) or decision.level >= Level.NO_CLOUD:
            return
        rows = self._estimator.cloud(self._cloud_count)
        description = self._encoder.encode(Cloud(len(rows), estimate.time))
        self._outlet.send(cloud(description, np.ascontiguousarray(rows, "<f4").tobytes()))
        self._meters.lap(CLOUD)

    def _learn(self, particles: int) -> None:
        """Tell the governor what the tick cost."""
        course, costs = self._course, self._meters.costs
        if course.deputised:
            self._governor.observe_deputy(costs[KALMAN], course.weighed)
            particles = 0
        self._governor.observe(costs, particles, course.offered, course.weighed)
        self._meters.lap(_OTHER)

    def _account(self, lateness: float, duration: float) -> None:
        """Close the tick; when it was far over the budget, leave out as many as pay for it."""
        cost = self._meters.end(lateness, duration)
        self._governor.observe_wait(lateness + duration - cost)
        self.overruns += cost > self._budget_ms * 1e-3
        periods = self._schedule.tick - self._booked
        self._booked = self._schedule.tick
        self._course.rested = self._debt.charge(cost, periods)
        if self._course.rested:
            self._schedule.rest(self._course.rested)

    def budget(self, estimate: Estimate) -> Budget:
        """Return what the loop spent over the last second, and what it gave up since the start."""
        stages = self._meters.stages()
        return Budget(
            time=estimate.time,
            budget_ms=self._budget_ms,
            rate=self._rate,
            stages=stages,
            use=stages["tick"].median / self._budget_ms,
            demanded=estimate.demanded,
            afforded=estimate.afforded,
            particles=estimate.particles,
            level=estimate.level,
            ticks=self.ticks,
            missed_ticks=self.missed_ticks,
            overruns=self.overruns,
            lateness=self._meters.recent_lateness(),
            queues={inlet.name: inlet.waiting for inlet in self._inlets},
            drops=self.drops(),
            rested_ticks=self._schedule.rested,
            cut_ticks=self.cuts,
            levels={str(int(level)): count for level, count in self._levels.items()},
            level_reason=estimate.level_reason,
            run_lateness=self._meters.lateness.distribution(),
            run_duration=self._meters.durations.distribution(),
            page_faults=self._new_faults(),
        )

    def _new_faults(self) -> int:
        before, self._faults = self._faults, _page_faults()
        return self._faults - before

    def drops(self) -> dict[str, int]:
        """Return what was dropped since the start, by what."""
        drops = {f"link {inlet.name}": inlet.dropped for inlet in self._inlets}
        drops["publisher"] = self._outlet.dropped
        if self._decisions is not None:
            drops["recording"] = self._decisions.dropped
        if self._checkpoints is not None and self._checkpoints.dropped:
            drops["checkpoints"] = self._checkpoints.dropped
        if self._orders is not None and self._orders.malformed:
            drops["orders"] = self._orders.malformed
        drops["undecodable"] = sum(inlet.undecodable for inlet in self._inlets)
        return drops | self._estimator.drops

    def summary(self) -> str:
        """Return the whole run in one line."""
        lateness, duration = self._meters.lateness, self._meters.durations
        return (
            f"{self.ticks} ticks, {self.missed_ticks} missed, {self._schedule.rested} rested, "
            f"{self.overruns} over the budget; "
            f"lateness median {1e3 * lateness.quantile(0.5):.2f}, 99 % {1e3 * lateness.quantile(0.99):.2f}, "
            f"worst {1e3 * lateness.worst:.2f} ms; duration median {1e3 * duration.quantile(0.5):.2f}, "
            f"99 % {1e3 * duration.quantile(0.99):.2f}, worst {1e3 * duration.worst:.2f} ms"
        )

    def sensors(self, unix: float, now_ns: int) -> Sensors:
        """Return every sensor and every link."""
        return Sensors(
            unix, self._estimator.sensors(now_ns), [inlet.status(now_ns) for inlet in self._inlets]
        )


def _page_faults() -> int:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_minflt + usage.ru_majflt
