"""A run that is recorded: the real loop over the real estimator for a second, and the recorder behind its queue."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from pathlib import Path

from drivers.sample import AnyReading, Odometer, Range, Rotation, Sample, SampleBatch, encode
from service.budget import Meters
from service.channels import Heart, Outlet, pair
from service.checkpoint import Kept
from service.config import Configuration, validated
from service.decisions import DecisionSender
from service.estimator import Estimator
from service.inlet import Inlet
from service.loop import Loop
from service.orders import Orders
from service.recorder import Recorder, run_recording
from service.records import Doubled, begun, tell
from service.tick_costs import Line

RATE = 100.0
BEACONS = {1: (20.0, 10.0), 2: (-5.0, 20.0), 3: (30.0, -15.0)}
LINKS = ("radio", "bus")
SHAPES = {stage: Line(1e-5, 2e-8) for stage in ("motion", "sensing", "resampling", "extraction")}
ORDER = b'{"mode": "given", "position": [4.0, 1.0, 0.0], "heading": 0.1}'


def configuration(cpu_ms: float = 1.0) -> Configuration:
    """Return a rover between three beacons, on two links."""
    link = [{"name": name, "kind": "mavlink", "url": "udpin:127.0.0.1:0"} for name in LINKS]
    content = {
        "vehicle": {"name": "rover"},
        "start": {"position": [0.0, 0.0, 0.0], "heading": 0.0},
        "loop": {"rate": RATE, "horizon_ms": 20},
        "budget": {"cpu_ms": cpu_ms, "particles_min": 100, "particles_max": 20_000},
        "link": link,
        "sensor": [{"kind": "range", "sigma": 0.3}],
        "beacon": [{"id": number, "position": [*place, 0.0]} for number, place in BEACONS.items()],
    }
    return validated(content, Configuration, "rover.toml")


def said(now: int, began: int) -> Iterator[tuple[str, list[Sample]]]:
    """Return what a rover that drives north says now: controls on the bus, three ranges by radio, which come earlier.

    The loop takes the radio's first, so the samples' times run back within a tick; and a range was measured a little
    after it came, as happens while a clock mapping settles.
    """
    north = (now - began) * 1e-9
    controls: tuple[AnyReading, ...] = (Odometer((north, north)), Rotation(0.0))
    yield "bus", [Sample(now - 5_000, now, "bus", "test", reading) for reading in controls]
    ranges = [Range(number, math.hypot(n - north, e)) for number, (n, e) in BEACONS.items()]
    yield "radio", [Sample(now + 700, now - 300, "radio", "test", reading) for reading in ranges]


def record(
    path: Path,
    settings: Configuration,
    ticks: int,
    kept: Kept | None = None,
    room: int = 1 << 22,
    runs: int = 1,
) -> None:
    """Record a run: ``ticks`` of it in real time, an order in the middle, the recorder at work after the last tick.

    Parameters
    ----------
    kept : Kept, optional
        What the belief goes on from.
    room : int
        Bytes of the recorder's queue.
    runs : int
        How often the loop is started: a later one is stopped ten ticks sooner.
    """
    records = pair(room)
    for number in range(runs):
        _run(settings, ticks - 10 * number, kept, Outlet(records.outlet))
    recorder = Recorder([run_recording(path)], records.inlet)
    while recorder.step(0):
        pass
    recorder.close()
    records.close()


def _run(settings: Configuration, ticks: int, kept: Kept | None, records: Outlet) -> None:
    links = {name: pair(1 << 20) for name in LINKS}
    estimates, heart, orders = pair(1 << 22), pair(1 << 14), pair(1 << 14)
    meters = Meters(RATE)
    estimator = Estimator(settings, meters)
    if kept is not None:
        estimator.resume(kept)
    loop = Loop(
        settings, estimator, meters, [Inlet(name, ends.inlet, records) for name, ends in links.items()],
        Doubled(Outlet(estimates.outlet), records), Heart(heart.outlet), SHAPES,
        DecisionSender(records, len(links)), Orders(orders.inlet, estimator.reinitialize, records),
    )  # fmt: skip
    assert tell(records, begun(settings, kept))
    began = time.monotonic_ns()

    def stopped() -> bool:
        if loop.ticks == ticks // 2:
            orders.outlet.send(ORDER)
        for name, samples in said(time.monotonic_ns(), began):
            links[name].outlet.send(encode(SampleBatch(samples)))
        return loop.ticks >= ticks

    loop.run(stopped)
    for ends in (*links.values(), estimates, heart, orders):
        ends.close()
