"""The decision log: what a real loop decided over a real estimator gives the same bytes again."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.sample import AnyReading, Odometer, Range, Rotation, Sample, SampleBatch, encode
from service.budget import Meters
from service.channels import Heart, Outlet, pair
from service.config import Configuration, load
from service.decisions import (
    Decided,
    DecisionLogError,
    DecisionSender,
    decided,
    header,
    line,
    read,
)
from service.estimate import Estimate
from service.estimator import Cause, Estimator, Level
from service.inlet import Inlet
from service.loop import Loop
from service.publish.inbox import parse
from service.recorder import Recorder, decision_log
from service.tick_costs import Line

RATE = 100.0
BEACONS = {1: (20.0, 10.0), 2: (-5.0, 20.0), 3: (30.0, -15.0)}
TOML = """
[vehicle]
name = "rover"
[start]
position = [0.0, 0.0, 0.0]
heading = 0.0
[loop]
rate = 100.0
horizon_ms = 20
[budget]
cpu_ms = 1.0
particles_min = 100
particles_max = 20000
[[link]]
name = "radio"
kind = "mavlink"
url = "udpin:127.0.0.1:0"
[[link]]
name = "bus"
kind = "mavlink"
url = "udpin:127.0.0.1:0"
[[sensor]]
kind = "range"
sigma = 0.3
""" + "".join(f"[[beacon]]\nid = {i}\nposition = [{n}, {e}, 0.0]\n" for i, (n, e) in BEACONS.items())


@pytest.fixture
def configuration(tmp_path: Path) -> Configuration:
    path = tmp_path / "rover.toml"
    path.write_text(TOML)
    return load(path)


class Ear(Estimator):
    """The estimator, with what it was given kept per call."""

    heard: list[list[Sample]]

    def ingest(self, samples: Iterable[Sample]) -> None:
        samples = list(samples)
        self.heard.append(samples)
        super().ingest(samples)


def said(now: int, began: int) -> Iterator[tuple[str, list[Sample]]]:
    """Return what a rover that drives north says now: controls on the bus, three ranges by radio."""
    north = (now - began) * 1e-9
    controls: tuple[AnyReading, ...] = (Odometer((north, north)), Rotation(0.0))
    yield "bus", [Sample(now, now, "bus", "test", reading) for reading in controls]
    yield (
        "radio",
        [
            Sample(now, now, "radio", "test", Range(i, math.hypot(n - north, e)))
            for i, (n, e) in BEACONS.items()
        ],
    )


def test_a_recorded_run_gives_the_same_bytes_again(configuration: Configuration, tmp_path: Path) -> None:
    """Two hundred ticks in real time on this machine, busy or not, with counts, levels and cuts as they come.

    The samples are given again in the portions that the log tells, on another estimator without a clock: every
    estimate is the same, byte for byte.
    """
    links = {name: pair(1 << 20) for name in ("radio", "bus")}
    estimates, heart, records = pair(1 << 22), pair(1 << 14), pair(1 << 20)
    meters = Meters(RATE)
    estimator = Ear(configuration, meters)
    estimator.heard = []
    loop = Loop(
        configuration, estimator, meters, [Inlet(name, ends.inlet) for name, ends in links.items()],
        Outlet(estimates.outlet), Heart(heart.outlet),
        {stage: Line(1e-5, 2e-8) for stage in ("motion", "sensing", "resampling", "extraction")},
        DecisionSender(Outlet(records.outlet), len(links)),
    )  # fmt: skip
    began = time.monotonic_ns()

    def stopped() -> bool:
        for name, samples in said(time.monotonic_ns(), began):
            links[name].outlet.send(encode(SampleBatch(samples)))
        return loop.ticks >= 200

    loop.run(stopped)
    log = tmp_path / "decisions.csv"
    recorder = Recorder([decision_log(log, list(links))], records.inlet)
    while recorder.step(0):
        pass
    recorder.close()
    published = received(estimates.inlet)
    for ends in (*links.values(), estimates, heart, records):
        ends.close()

    decisions = read(log)
    assert len(decisions) == len(published) == 200
    assert len({decision.afforded for decision in decisions}) > 1
    again = Estimator(configuration)
    given = iter(sample for batch in estimator.heard for sample in batch)
    for decision, before in zip(decisions, published, strict=True):
        for count in decision.taken:
            again.ingest([next(given) for _ in range(count)])
        estimate = again.tick(decision.now, decision.unix, decision.afforded, decision.course())
        assert msgspec.json.encode(estimate) == before
    assert msgspec.json.decode(published[-1], type=Estimate).particles > 0


def received(inlet: object) -> list[bytes]:
    found: list[bytes] = []
    while True:
        try:
            value = parse(inlet.recv(1 << 18))  # type: ignore[attr-defined]
        except BlockingIOError:
            return found
        if value.topic == "estimate":
            found.append(value.payload)


whole = st.integers(0, 2**62)
count = st.integers(0, 2**31 - 1)


@settings(deadline=None)
@given(
    st.builds(
        Decided,
        tick=st.just(0), now=whole, unix=whole, afforded=count, level=st.sampled_from(Level),
        cause=st.sampled_from(Cause), most=count, cut_after=st.integers(-1, 64), rested=count,
        taken=st.tuples(count, count),
    )
)  # fmt: skip
def test_a_line_is_read_as_it_was_written(
    tmp_path_factory: pytest.TempPathFactory, decision: Decided
) -> None:
    path = tmp_path_factory.mktemp("log") / "one.csv"
    path.write_text(header(["a", "b"]) + line(decision))
    assert read(path) == [decision]


def a_tick(number: int) -> Decided:
    return Decided(number, 1, 2, 300, Level.FULL, Cause.NONE, 64, -1, 0, (4,))


def test_a_datagram_says_what_was_sent() -> None:
    ends = pair(1 << 14)
    sender = DecisionSender(Outlet(ends.outlet), 2)
    course = Decided(7, 0, 0, 0, Level.THINNED, Cause.BUDGET, 5, 2, 3, ()).course()
    course.offered = 9
    while course.goes_on():
        pass
    sender.send(7, 11, 12, 500, course, [1, 2])
    assert decided(ends.inlet.recv(4096)) == Decided(7, 11, 12, 500, 2, 1, 5, 2, 3, (1, 2))
    ends.close()


def test_the_last_run_counts_and_a_torn_line_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    head = header(["a"])
    path.write_text(head + line(a_tick(0)) + line(a_tick(1)) + head + line(a_tick(0)) + "1,2,")
    assert read(path) == [a_tick(0)]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "not a decision log"),
        ("time,north\n1,2\n", "not a decision log"),
        (header(["a"]) + line(a_tick(0)) + line(a_tick(2)), "line 3: tick 2, expected 1"),
        (header(["a"]) + "0,1,2,300,9,0,64,-1,0,4\n", "line 2: 9 is not a valid Level"),
        (header(["a"]) + "0,x\n", "line 2: invalid literal"),
    ],
)
def test_a_file_that_is_none_is_refused_with_its_line(tmp_path: Path, text: str, complaint: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text)
    with pytest.raises(DecisionLogError, match=complaint):
        read(path)
