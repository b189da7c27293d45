"""What is written: four files, readable by others' tools, the same bytes for the same seed."""

from __future__ import annotations

import csv
import itertools
import struct
from pathlib import Path

import can
import pytest
from pymavlink.dialects.v20 import all as mavlink

from sim_vehicle import scenarios
from sim_vehicle.clock import LOG_EPOCH
from sim_vehicle.frame import CanFrame
from sim_vehicle.recording import candump_line, tlog_record, write

ENDINGS = (".tlog", ".candump.log", "_truth.csv", ".toml")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("drive")
    for stem, seed in (("one", 1), ("again", 1), ("other", 2)):
        write(scenarios.draw("demo", seed), seed, 3.0, made / "deep" / stem)
    return made / "deep"


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(folder: Path) -> None:
    for ending in ENDINGS:
        one, again, other = ((folder / (stem + ending)).read_bytes() for stem in ("one", "again", "other"))
        assert one == again
        assert one != other
        assert len(one) > 500


def test_the_telemetry_log_is_stamped_in_the_order_of_arrival(folder: Path) -> None:
    """Read as ground stations do: eight bytes of microseconds, then a frame of the length that it says."""
    data, place, stamps, kinds = (folder / "one.tlog").read_bytes(), 0, [], set()
    parser = mavlink.MAVLink(None)
    while place < len(data):
        (stamp,) = struct.unpack_from(">Q", data, place)
        length = data[place + 9] + 12
        message = parser.decode(bytearray(data[place + 8 : place + 8 + length]))
        stamps.append(stamp)
        kinds.add(message.get_type())
        place += 8 + length
    assert stamps == sorted(stamps)
    assert LOG_EPOCH * 10**6 <= stamps[0] < stamps[-1] <= (LOG_EPOCH + 3) * 10**6
    assert {"HEARTBEAT", "HIGHRES_IMU", "WHEEL_DISTANCE", "RANGING_BEACON"} <= kinds


def test_python_can_reads_the_candump_log(folder: Path) -> None:
    with can.CanutilsLogReader(str(folder / "one.candump.log")) as reader:
        frames = list(reader)
    assert len(frames) > 500
    assert all(frame.is_extended_id and frame.channel == "can0" for frame in frames)
    assert all(before.timestamp <= after.timestamp for before, after in itertools.pairwise(frames))
    assert {frame.arbitration_id & 0x7F for frame in frames} == {10, 42, 51, 52}


def test_lines_and_records_are_as_the_formats_say() -> None:
    line = candump_line(1_700_000_000_123_456, CanFrame(0x1800F7A, b"\x01\xab"))
    assert line == "(1700000000.123456) can0 01800F7A#01AB\n"
    assert candump_line(1_000_000, CanFrame(0x12, b"", extended=False)) == "(1.000000) can0 012#\n"
    assert tlog_record(1_700_000_000_000_000, b"\xfd") == bytes.fromhex("00060a24181e4000") + b"\xfd"


def test_the_truth_has_fifty_rows_a_second_on_the_logs_clock(folder: Path) -> None:
    with (folder / "one_truth.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert list(rows[0]) == ["time_s", "north_m", "east_m", "down_m", "heading_rad"]
    assert len(rows) == 151
    assert float(rows[0]["time_s"]) == LOG_EPOCH
    assert float(rows[-1]["time_s"]) == LOG_EPOCH + 3.0
    start = scenarios.draw("demo", 1).start
    assert float(rows[0]["north_m"]) == pytest.approx(start.north, abs=1e-6)
    assert float(rows[0]["heading_rad"]) == pytest.approx(start.heading, abs=1e-6)


def test_without_a_bus_there_is_no_can_log(tmp_path: Path) -> None:
    recorded = write(scenarios.draw("beacons", 1), 1, 1.0, tmp_path / "b")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["b.tlog", "b.toml", "b_truth.csv"]
    assert (recorded.can_frames, recorded.truth_rows) == (0, 51)
    assert recorded.mavlink_frames > 100


def test_what_befalls_the_drive_is_a_table_on_the_truths_clock(tmp_path: Path) -> None:
    drawn = scenarios.draw("spoof", 1)
    recorded = write(drawn, 1, 0.5, tmp_path / "s")
    assert tmp_path / "s_events.csv" in recorded.files
    assert (tmp_path / "s_events.csv").read_text() == (
        "time_s,event\n1700000060.000000,spoof\n1700000360.000000,honest\n"
    )
