"""The loop around a small estimator of the test's own, on real queues; nothing is lost uncounted."""

from __future__ import annotations

import contextlib
import gc
import time
import tracemalloc
from collections.abc import Iterable, Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.sample import LinkReport, Sample, SampleBatch, Speed, encode
from service.budget import Meters
from service.channels import Heart, Outlet, Pair, pair, undertaking
from service.config import Configuration, load
from service.estimate import Budget, Cloud, Estimate, Health, HealthState, Hypotheses, Sensors, SensorStatus
from service.estimator import Course, Level
from service.inlet import Inlet
from service.loop import Loop
from service.publish.inbox import Value, parse
from service.tick_costs import Line

RATE = 100.0
TOML = """
[vehicle]
name = "rover"
[loop]
rate = {rate}
[budget]
cpu_ms = 4.0
particles_min = 100
particles_max = 5000
[[link]]
name = "radio"
kind = "mavlink"
url = "udpin:127.0.0.1:0"
[[link]]
name = "bus"
kind = "mavlink"
url = "udpin:127.0.0.1:0"
"""


class SmallEstimator:
    """Counts what it is given; its state is what the test says."""

    def __init__(self, meters: Meters) -> None:
        self.meters = meters
        self.demand = 300
        self.taken: list[Sample] = []
        self.afforded: list[int] = []
        self.health = HealthState.WAITING
        self.jumps = 0
        self.stall = 0.0
        self.drops = {"late": 3}

    def ingest(self, samples: Iterable[Sample], /) -> None:
        self.taken.extend(samples)

    def tick(self, now_ns: int, unix_ns: int, afforded: int, course: Course, /) -> Estimate:
        self.meters.lap("motion")
        self.afforded.append(afforded)
        if self.stall:
            stall, self.stall = self.stall, 0.0
            time.sleep(stall)
        triple, triangle = (1.0, 2.0, None), (1.0, 0.0, None, 1.0, None, None)
        return Estimate(
            len(self.afforded), unix_ns * 1e-9, now_ns, self.health, "why", 0, triple, triple, 0.5, triangle,
            triangle, 0.1, None, None, None, 1.0, 1, min(self.demand, afforded), self.demand, afforded, 250.0,
            self.jumps, {},
        )  # fmt: skip

    def sensors(self, now_ns: int, /) -> list[SensorStatus]:
        return [SensorStatus("range/bus/1", 5.0, None, 7, {"late": 1}, 0.1, 0.2)]

    def hypotheses(self, unix: float, /) -> Hypotheses | None:
        return None if self.health == HealthState.WAITING else Hypotheses(unix, [])

    def cloud(self, count: int, /) -> NDArray[np.float32]:
        return np.ones((min(count, 10), 4), np.float32)


class Rig:
    """A loop with the far ends of its queues."""

    def __init__(
        self,
        configuration: Configuration,
        room: int = 1024 * 1024,
        estimator: type[SmallEstimator] = SmallEstimator,
    ) -> None:
        self.links = {link.name: pair(room) for link in configuration.link}
        self.estimates = pair(room)
        self.heart = pair(16 * 1024)
        self.meters = Meters(configuration.loop.rate)
        self.estimator = estimator(self.meters)
        self.inlets = [Inlet(name, ends.inlet) for name, ends in self.links.items()]
        self.loop = Loop(
            configuration,
            self.estimator,
            self.meters,
            self.inlets,
            Outlet(self.estimates.outlet),
            Heart(self.heart.outlet),
            {"motion": Line(1e-5, 1e-9)},
        )

    def run(self, ticks: int) -> None:
        self.loop.run(lambda: self.loop.ticks >= ticks)

    def published(self) -> list[Value]:
        """Return what waits for the publisher, taken apart as the publisher does."""
        return [parse(datagram) for datagram in self._received(self.estimates)]

    def beats(self) -> int:
        return sum(undertaking(datagram) is None for datagram in self._received(self.heart))

    @staticmethod
    def _received(ends: Pair) -> Iterator[bytes]:
        while True:
            try:
                yield ends.inlet.recv(262_144)
            except BlockingIOError:
                return

    def close(self) -> None:
        for ends in (*self.links.values(), self.estimates, self.heart):
            ends.close()


@pytest.fixture
def configuration(tmp_path: Path) -> Configuration:
    path = tmp_path / "rover.toml"
    path.write_text(TOML.format(rate=RATE))
    return load(path)


@pytest.fixture
def rig(configuration: Configuration) -> Iterator[Rig]:
    made = Rig(configuration)
    yield made
    made.close()


def batch(count: int, first: int = 0) -> bytes:
    now = time.monotonic_ns()
    return encode(
        SampleBatch([Sample(now, now, "bus", "test", Speed(float(first + i))) for i in range(count)])
    )


def of(values: list[Value], topic: str) -> list[bytes]:
    return [value.payload for value in values if value.topic == topic]


def test_every_tick_publishes_and_the_rest_has_its_rate(rig: Rig) -> None:
    """Two seconds at 100 Hz: 200 estimates, 2 budgets, 2 sensors, 1 health, 10 clouds, 20 beats."""
    rig.estimator.health = HealthState.TRACKING
    rig.run(200)
    values = rig.published()
    estimates = [msgspec.json.decode(payload, type=Estimate) for payload in of(values, "estimate")]
    assert [estimate.sequence for estimate in estimates] == list(range(1, 201))
    assert len(of(values, "budget")) == len(of(values, "sensors")) == 2
    assert len(of(values, "health")) == 1
    assert len(of(values, "particles")) == 10
    assert rig.beats() == 20


def test_ticks_lie_on_their_deadlines(rig: Rig) -> None:
    """From the first tick to the last lie all that were done and all that were missed, but for their lateness."""
    rig.run(100)
    times = [msgspec.json.decode(p, type=Estimate).monotonic_ns for p in of(rig.published(), "estimate")]
    assert min(np.diff(times)) > 0
    periods = 99 + rig.loop.missed_ticks
    error = abs((times[-1] - times[0]) * 1e-9 - periods / RATE)
    assert error <= rig.meters.lateness.worst + 1e-6


def test_a_stall_skips_ticks_and_counts_them(rig: Rig) -> None:
    """0.25 s of nothing at 100 Hz: at least 23 ticks are missed; those after it come a period apart, but for
    the lateness of the first, which is less than a period.
    """
    rig.run(5)
    rig.estimator.stall = 0.25
    rig.loop.ticks = 0
    rig.run(20)
    assert rig.loop.missed_ticks >= 23
    times = [msgspec.json.decode(p, type=Estimate).monotonic_ns for p in of(rig.published(), "estimate")]
    assert rig.meters.durations.worst >= 0.25
    assert (times[-1] - times[-15]) * 1e-9 > 13 / RATE - 1e-3


def test_samples_of_all_links_are_taken(rig: Rig) -> None:
    for ends in rig.links.values():
        ends.outlet.send(batch(10))
    rig.run(2)
    assert len(rig.estimator.taken) == 20


def test_a_flood_stays_in_its_queue_and_the_other_link_is_heard(rig: Rig) -> None:
    """One queue is full to the brim; the other link's only sample is heard at once, and no flood is lost."""
    radio, bus = rig.links["radio"].outlet, rig.links["bus"].outlet
    sent = 0
    try:
        while True:
            radio.send(batch(8, first=8 * sent))
            sent += 1
    except BlockingIOError:
        pass
    bus.send(batch(1, first=1_000_000))
    rig.loop.tick(time.monotonic_ns())
    assert 1_000_000.0 in [s.reading.speed for s in rig.estimator.taken if isinstance(s.reading, Speed)]
    rig.loop.run(lambda: rig.inlets[0].waiting == 0 and rig.loop.ticks > 1)
    speeds = [s.reading.speed for s in rig.estimator.taken if isinstance(s.reading, Speed)]
    assert [speed for speed in speeds if speed < 1_000_000] == [float(i) for i in range(8 * sent)]


def test_drops_are_counted_by_whom_they_befell(rig: Rig, configuration: Configuration) -> None:
    rig.links["bus"].outlet.send(b"\xc1")
    rig.links["radio"].outlet.send(encode(LinkReport("radio", "up", dropped=5)))
    rig.run(2)
    assert rig.loop.drops() == {"link radio": 5, "link bus": 0, "publisher": 0, "undecodable": 1, "late": 3}


def test_a_publisher_that_does_not_read_holds_nothing_up(configuration: Configuration) -> None:
    """What was refused and what waits add up to what was sent: estimates, clouds and all."""
    rig = Rig(configuration, room=8 * 1024)
    rig.run(150)
    waiting = len(rig.published())
    dropped = rig.loop.drops()["publisher"]
    rig.close()
    assert rig.loop.ticks == 150
    assert 0 < waiting < 150
    # 150 estimates, 1 health, 2 budgets, 1 or 2 sensors; no clouds while it waits
    assert waiting + dropped == 150 + 1 + 2 + 1


def test_health_is_said_on_change_and_when_asked(rig: Rig) -> None:
    rig.run(3)
    rig.estimator.health = HealthState.TRACKING
    rig.loop.run(lambda: rig.loop.ticks >= 6)
    rig.estimator.jumps = 1
    rig.loop.run(lambda: rig.loop.ticks >= 9)
    rig.heart.inlet.send(b"!")
    rig.loop.run(lambda: rig.loop.ticks >= 12)
    said = [msgspec.json.decode(p, type=Health) for p in of(rig.published(), "health")]
    assert [(h.state, h.reset_counter) for h in said] == [
        ("waiting", 0), ("tracking", 0), ("tracking", 1), ("tracking", 1),
    ]  # fmt: skip
    assert said[1].since == said[2].since == said[3].since == said[1].time
    assert said[3].time > said[2].time > said[1].time


def test_budget_and_sensors_say_what_they_should(rig: Rig) -> None:
    rig.links["bus"].outlet.send(encode(LinkReport("bus", "up", malformed={"crc": 2})))
    rig.run(100)
    values = rig.published()
    budget = msgspec.json.decode(of(values, "budget")[-1], type=Budget)
    assert (budget.rate, budget.budget_ms, budget.demanded, budget.particles) == (100.0, 4.0, 300, 300)
    assert set(budget.queues) == {"radio", "bus"}
    assert {"ingest", "motion", "publishing", "tick"} <= set(budget.stages)
    assert budget.stages["tick"].median >= budget.stages["motion"].median > 0.0
    assert budget.use == pytest.approx(budget.stages["tick"].median / 4.0)
    sensors = msgspec.json.decode(of(values, "sensors")[-1], type=Sensors)
    assert [(link.name, link.state) for link in sensors.links] == [("radio", "starting"), ("bus", "up")]
    assert sensors.links[1].malformed == {"crc": 2}
    assert sensors.sensors[0].name == "range/bus/1"


def test_the_cloud_has_its_rows_and_says_so(rig: Rig) -> None:
    rig.estimator.health = HealthState.TRACKING
    rig.run(20)
    cloud = next(value for value in rig.published() if value.topic == "particles")
    assert msgspec.json.decode(cloud.attachment or b"", type=Cloud).count == 10
    assert len(cloud.payload) == 160


def test_nothing_is_left_open(configuration: Configuration) -> None:
    before = len(list(Path("/proc/self/fd").iterdir()))
    rig = Rig(configuration)
    rig.run(2)
    rig.close()
    assert len(list(Path("/proc/self/fd").iterdir())) == before


def test_the_summary_is_one_line(rig: Rig) -> None:
    rig.run(10)
    assert rig.loop.summary().startswith("10 ticks, ")
    assert "\n" not in rig.loop.summary()


def burn(seconds: float) -> None:
    """Use the processor, as a dear estimator does; waiting would cost nothing."""
    until = time.process_time() + seconds
    while time.process_time() < until:
        pass


class DearEstimator(SmallEstimator):
    """Costs ten times the budget, whatever it is told to leave out."""

    def tick(self, now_ns: int, unix_ns: int, afforded: int, course: Course, /) -> Estimate:
        burn(40e-3)
        estimate = super().tick(now_ns, unix_ns, afforded, course)
        level, reason = course.reached(self.demand, afforded), course.reason(self.demand, afforded)
        return msgspec.structs.replace(estimate, level=int(level), level_reason=reason)


def test_a_loop_that_cannot_afford_the_least_rests_and_says_so(configuration: Configuration) -> None:
    """40 ms of processor time at 100 Hz with a budget of 4 ms: a tick in ten is done, 40 % of a processor used.

    Nothing is affordable, so the estimator (the real one) would say starved; level and reason tell what was given up.
    """
    rig = Rig(configuration, estimator=DearEstimator)
    rig.run(5)  # the grace
    used, began = time.process_time(), time.monotonic()
    rig.loop.run(lambda: rig.loop.ticks >= 35)
    share = (time.process_time() - used) / (time.monotonic() - began)
    values = rig.published()
    rig.close()
    assert share <= 0.5
    last = msgspec.json.decode(of(values, "estimate")[-1], type=Estimate)
    assert last.afforded == 0
    assert last.level == Level.PREDICTION_ONLY
    assert "ticks rested" in last.level_reason
    assert len(of(values, "estimate")) == 35


class CuttableEstimator(SmallEstimator):
    """Weighs ten measurements of 1 ms each, as long as it may."""

    def tick(self, now_ns: int, unix_ns: int, afforded: int, course: Course, /) -> Estimate:
        course.offered = 10
        while course.weighed < min(10, course.most) and course.goes_on():
            burn(1e-3)
        self.meters.lap("sensing")
        self.cuts = [*getattr(self, "cuts", []), course.cut]
        return super().tick(now_ns, unix_ns, afforded, course)


def test_a_tick_that_would_overrun_is_cut(configuration: Configuration) -> None:
    """The first tick knows nothing of 10 ms; the budget of 4 ms cuts it. A second later most are thinned beforehand."""
    rig = Rig(configuration, estimator=CuttableEstimator)
    rig.run(200)
    budget = rig.loop.budget(msgspec.json.decode(of(rig.published(), "estimate")[-1], type=Estimate))
    cuts = rig.estimator.cuts  # type: ignore[attr-defined]
    rig.close()
    assert cuts[0]
    assert sum(cuts[100:]) < 50
    assert sum(cuts) == budget.cut_ticks
    assert sum(budget.levels.values()) == budget.ticks == 200


def test_memory_is_flat_and_ticks_leave_nothing_behind(rig: Rig) -> None:
    """Four thousand ticks, with everything that is sent in between: what Python holds afterwards is what it held
    before but for 32 KiB (counters grow into larger integers, and on a busy machine there are more of them; one object
    that every tick left behind would be 110 KiB at least), and no tick needs more than 64 KiB on the way.
    """
    rig.estimator.health = HealthState.TRACKING
    rig.estimator.afforded = Forgetful()
    tick(rig, 1000)
    tracemalloc.start()
    try:
        tick(rig, 500)
        gc.collect()
        before, _ = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        tick(rig, 4000)
        gc.collect()
        after, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert after - before < 32 * 1024
    assert peak - before < 64 * 1024


class Forgetful(list[int]):
    """A list that does not grow: the test's own memory is not the question."""

    def append(self, value: int, /) -> None:
        self[:] = [value]


def tick(rig: Rig, ticks: int) -> None:
    for _ in range(ticks):
        rig.loop.tick(time.monotonic_ns())
        rig.meters.end(0.0, 0.0)
        for ends in (rig.estimates, rig.heart):
            with contextlib.suppress(BlockingIOError):
                while True:
                    ends.inlet.recv(8192)
