"""The simulator as its users start it: a process of its own, on real sockets and a serial adapter."""

from __future__ import annotations

import itertools
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path

import can
import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.sim_vehicle.listening import LONGEST_WAIT, Companion, is_a


@pytest.fixture
def companion() -> Iterator[Companion]:
    made = Companion()
    yield made
    made.close()


@pytest.fixture
def start() -> Iterator[object]:
    started: list[subprocess.Popen[str]] = []

    def begin(*arguments: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, "-m", "sim_vehicle", *arguments], stdout=subprocess.PIPE, text=True, bufsize=1
        )
        started.append(process)
        return process

    yield begin
    for process in started:
        process.kill()
        process.communicate()


def announced(process: subprocess.Popen[str]) -> str:
    """Return the line that says where the simulator can be met."""
    assert process.stdout is not None
    return process.stdout.readline()


def test_a_companion_on_udp_asks_and_is_answered(start, companion: Companion) -> None:
    start("beacons", "--mavlink", f"udpout:127.0.0.1:{companion.port}", "--realtime", "--seconds", "30")
    companion.wait_for(is_a("HEARTBEAT"))
    companion.say(mavlink.MAVLink_timesync_message(0, 1234))
    first = companion.wait_for(lambda message: message.get_type() == "TIMESYNC" and message.tc1 != 0)
    sent = time.monotonic_ns()
    companion.say(mavlink.MAVLink_timesync_message(0, 5678))
    second = companion.wait_for(lambda message: message.get_type() == "TIMESYNC" and message.tc1 != 0)
    elapsed = time.monotonic_ns() - sent
    assert (first.ts1, second.ts1) == (1234, 5678)
    # The vehicle's clock ran on between the answers, and by no more than the time that has passed here.
    assert 0 < second.tc1 - first.tc1 < elapsed + 10**9 * LONGEST_WAIT
    companion.wait_for(lambda message: message.get_type() == "TIMESYNC" and message.tc1 == 0)


def test_an_interval_is_accepted_and_kept_over_udp(start, companion: Companion) -> None:
    start("beacons", "--mavlink", f"udpout:127.0.0.1:{companion.port}", "--realtime", "--seconds", "30")
    companion.wait_for(is_a("HIGHRES_IMU"))
    command = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
    companion.say(mavlink.MAVLink_command_long_message(1, 1, command, 0, 105, 100_000.0, 0, 0, 0, 0, 0))
    acknowledgement = companion.wait_for(is_a("COMMAND_ACK"))
    assert (acknowledgement.command, acknowledgement.result) == (command, mavlink.MAV_RESULT_ACCEPTED)
    companion.wait_for(is_a("HIGHRES_IMU"))
    stamps = [companion.wait_for(is_a("HIGHRES_IMU")).time_usec for _ in range(4)]
    # By the vehicle's own stamps, so that a busy machine changes nothing.
    assert all(
        after - before == pytest.approx(100_000, abs=11_000) for before, after in itertools.pairwise(stamps)
    )
    companion.say(mavlink.MAVLink_command_long_message(1, 1, command, 0, 9000, 50_000.0, 0, 0, 0, 0, 0))
    assert companion.wait_for(is_a("COMMAND_ACK")).result == mavlink.MAV_RESULT_DENIED


def test_it_waits_on_udpin_writes_the_truth_and_stops_when_told(
    start, companion: Companion, tmp_path: Path
) -> None:
    truth, config = tmp_path / "truth.csv", tmp_path / "vehicle.toml"
    before = time.time()
    process = start(
        "beacons",
        "--mavlink",
        "udpin:127.0.0.1:0",
        "--realtime",
        "--truth",
        str(truth),
        "--config",
        str(config),
    )
    line = announced(process)
    assert line.startswith("beacons, seed 1: MAVLink at udpin:127.0.0.1:")
    port = int(line.strip().rpartition(":")[2])
    assert tomllib.loads(config.read_text())["link"][0]["url"] == f"udpout:127.0.0.1:{port}"
    companion.meet(port)
    companion.wait_for(is_a("RANGING_BEACON"))
    rows = truth.read_text().splitlines()
    assert rows[0] == "time_s,north_m,east_m,down_m,heading_rad"
    assert len(rows) > 2, "the truth is written while the rover drives"
    process.send_signal(signal.SIGTERM)
    said, _ = process.communicate(timeout=LONGEST_WAIT)
    assert process.returncode == 0
    assert "MAVLink frames" in said
    stamps = [float(row.partition(",")[0]) for row in truth.read_text().splitlines()[1:]]
    assert before <= stamps[0] <= stamps[-1] <= time.time()


def test_the_bus_is_read_through_a_serial_adapter(start, companion: Companion, tmp_path: Path) -> None:
    path = tmp_path / "can0"
    process = start(
        "demo", "--mavlink", f"udpout:127.0.0.1:{companion.port}", "--can", f"slcan:{path}", "--realtime"
    )
    assert f"CAN at slcan:{path}" in announced(process)
    for _ in range(2):
        with can.Bus(interface="slcan", channel=str(path), bitrate=1_000_000, sleep_after_open=0.0) as bus:
            wanted = {1063, 1028, 1034, 341}
            end = time.monotonic() + LONGEST_WAIT
            while wanted and time.monotonic() < end:
                message = bus.recv(timeout=1.0)
                if message is not None:
                    wanted.discard(message.arbitration_id >> 8 & 0xFFFF)
            assert not wanted
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=LONGEST_WAIT)
    assert process.returncode == 0
    assert not path.is_symlink()


def test_a_drive_ends_by_itself_after_its_seconds(start, companion: Companion) -> None:
    process = start(
        "beacons", "--mavlink", f"udpout:127.0.0.1:{companion.port}", "--realtime", "--seconds", "0.5"
    )
    process.communicate(timeout=LONGEST_WAIT)
    assert process.returncode == 0
