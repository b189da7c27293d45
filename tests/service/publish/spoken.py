"""What the loop and the supervisor say to the publishing process, as values and as hand-packed datagrams."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from service.config import Configuration
from service.estimate import (
    Budget,
    Cell,
    Cloud,
    Density,
    Estimate,
    Health,
    HealthState,
    Hypotheses,
    Hypothesis,
    LinkStatus,
    ProcessStatus,
    Sensors,
    SensorStatus,
    StageCost,
)

PATIENCE = 15.0


def wait_for(condition: Callable[[], object], seconds: float = PATIENCE) -> object:
    """Return the first true value of ``condition``; fail after ``seconds``."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        value = condition()
        if value:
            return value
        time.sleep(0.005)
    pytest.fail(f"waited {seconds} s for nothing")


def estimate(sequence: int, **changes: object) -> Estimate:
    """Return an estimate as the loop would make it."""
    value = Estimate(
        sequence=sequence,
        time=1_700_000_000.0 + 0.02 * sequence,
        monotonic_ns=20_000_000 * sequence,
        health=HealthState.TRACKING,
        reason="ranges and odometry agree",
        level=0,
        position=(1.0 + sequence, -2.0, None),
        velocity=(0.5, 0.0, None),
        heading=0.25,
        position_covariance=(0.04, 0.0, None, 0.04, None, None),
        velocity_covariance=(0.01, 0.0, None, 0.01, None, None),
        heading_variance=0.01,
        latitude=40.4433,
        longitude=-79.9436,
        altitude=None,
        radius95=0.49,
        hypotheses=1,
        particles=1500,
        demanded=1500,
        afforded=20_000,
        effective_sample_size=900.0,
        reset_counter=0,
        biases={"gyro_bias": (0.001, 0.0005)},
    )
    return msgspec.structs.replace(value, **changes)


def health(state: HealthState, reason: str, time: float = 1_700_000_000.0) -> Health:
    """Return one change of health."""
    return Health(time=time, state=state, reason=reason, since=time, reset_counter=0)


def budget() -> Budget:
    """Return a budget as the loop would make it."""
    cost = StageCost(median=0.4, p99=0.9, worst=1.5)
    names = ("ingest", "motion", "sensing", "resampling", "extraction", "publishing", "tick")
    stages = dict.fromkeys(names, cost)
    return Budget(
        time=1_700_000_000.0,
        budget_ms=4.0,
        rate=50.0,
        stages=stages,
        use=0.42,
        demanded=1500,
        afforded=20_000,
        particles=1500,
        level=0,
        ticks=500,
        missed_ticks=0,
        overruns=1,
        lateness=cost,
        queues={"autopilot": 0, "bus": 2},
        drops={"late": 3},
    )


def sensors() -> Sensors:
    """Return the sensors and links as the loop would tell them."""
    return Sensors(
        time=1_700_000_000.0,
        sensors=[
            SensorStatus("range/autopilot/5", 10.0, 3.1, 420, {"outlier": 4}, -0.12, 0.04),
            SensorStatus("position/bus", 5.0, None, 210, {}, 0.8, None),
        ],
        links=[
            LinkStatus(
                "autopilot",
                "up",
                "",
                900,
                500,
                {"bad_checksum": 1},
                {"GPS_RAW_INT.fix_type": 77},
                40,
                0,
                3,
                "timesync",
                0.2,
                0.001,
                0.1,
            ),
            LinkStatus("bus", "retrying", "no such device", 0, 0, {}, {}, 0, 0, 0, "", None, None, None),
        ],
    )


def processes() -> list[ProcessStatus]:
    """Return the processes as the supervisor would tell them."""
    return [
        ProcessStatus("loop", 101, "up", 0, "", 90_000_000),
        ProcessStatus("link bus", None, "waiting", 3, "exit 1", None),
    ]


def tagged(tag: bytes, value: object) -> bytes:
    """Return a datagram as the loop sends it."""
    return tag + msgspec.json.encode(value)


def hypotheses() -> Hypotheses:
    """Return two places, as the loop would tell of them."""
    near = Hypothesis(1, 0.7, (1.0, -2.0, None), (0.04, 0.0, None, 0.04, None, None), 0.25, 0.01)
    far = Hypothesis(3, 0.3, (1.0, 9.0, None), (0.09, 0.0, None, 0.09, None, None), None, None)
    return Hypotheses(1_700_000_000.0, [near, far])


def density() -> Density:
    """Return a density of two columns, with two cells."""
    cells = [Cell((0.0, 1.0), (0.0, 1.0), 0.75), Cell((1.0, 2.0), (0.0, 1.0), 0.25)]
    columns, covariance = ["north", "east"], [[0.25, 0.0], [0.0, 0.25]]
    return Density("histogram", 1_700_000_000.0, 1000, columns, [0.75, 0.5], covariance, cells=cells)


def cloud(rows: NDArray[np.float32], time: float = 1_700_000_000.0) -> bytes:
    """Return the datagram of a cloud, packed by hand."""
    description = msgspec.json.encode(Cloud(count=len(rows), time=time))
    return b"P" + struct.pack("<I", len(description)) + description + rows.astype("<f4").tobytes()


def configured(vehicle: str = "mower", file: str = "") -> Configuration:
    """Return a configuration for a vehicle with one link."""
    return Configuration.model_validate(
        {
            "vehicle": {"name": vehicle},
            "link": [{"name": "autopilot", "kind": "mavlink", "url": "udpin:127.0.0.1:14550"}],
            "publish": {"zenoh": file},
        }
    )
