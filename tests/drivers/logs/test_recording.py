"""Recordings of samples: what was written comes back, and damage costs what it hit and is counted."""

from __future__ import annotations

import json
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import Writer

from drivers.logs.recognise import Format, recognise
from drivers.logs.recording import RecordingReader, write
from drivers.sample import AnyReading, Bearing, Odometer, RangeBearing, Rotation, Sample
from tests.drivers.examples import KINDS, fields

ZSTANDARD = b"\x28\xb5\x2f\xfd"
"""What every compressed chunk begins with."""

START = 1_700_000_000_123_456_789


def samples_of(count: int) -> list[Sample]:
    readings: list[AnyReading] = [
        Odometer((1.5, 2.5)),
        RangeBearing(3.0, -0.2, 7),
        Rotation(0.1),
        Bearing(0.2),
    ]
    return [
        Sample(
            START + i * 10_000_000, START + i * 10_000_000 + 5, f"link{i % 2}", f"s{i % 4}", readings[i % 4]
        )
        for i in range(count)
    ]


def test_what_was_written_comes_back_to_the_nanosecond(tmp_path: Path) -> None:
    samples = samples_of(5000)
    path = tmp_path / "drive.mcap"
    assert write(path, samples) == 5000
    assert recognise(path) is Format.RECORDING
    reader = RecordingReader(path)
    assert list(reader) == samples
    assert list(reader) == samples  # each iteration begins anew
    assert reader.report().malformed == {}
    assert reader.report().samples == 5000
    assert reader.position == reader.size


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_every_kind_of_reading_comes_back(kind: type[AnyReading], tmp_path: Path) -> None:
    sample = Sample(START, START, "l", "s", kind(**fields(kind)))
    write(tmp_path / "one.mcap", [sample])
    assert list(RecordingReader(tmp_path / "one.mcap")) == [sample]


def test_others_can_read_it(tmp_path: Path) -> None:
    """By the mcap library's own reader: JSON, topics by link and source, times as documented."""
    samples = samples_of(8)
    write(tmp_path / "drive.mcap", samples)
    with (tmp_path / "drive.mcap").open("rb") as file:
        found = list(make_reader(file, validate_crcs=True).iter_messages())
    assert [message.log_time for _, _, message in found] == [sample.received for sample in samples]
    assert [message.publish_time for _, _, message in found] == [sample.time for sample in samples]
    assert [channel.topic for _, channel, _ in found[:2]] == ["sample/link0/s0", "sample/link1/s1"]
    assert json.loads(found[1][2].data) == {
        "kind": "range_bearing",
        "distance": 3.0,
        "bearing": -0.2,
        "landmark": 7,
    }


def test_others_channels_are_left_alone_and_bad_messages_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "mixed.mcap"
    good = msgspec.json.encode(Rotation(0.5))
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        mine = writer.register_channel("sample/imu", "json", 0)
        other = writer.register_channel("/camera", "ros2", 0)
        writer.add_message(other, 10, b"picture", 10)
        writer.add_message(mine, 20, good, 15)
        writer.add_message(mine, 30, b'{"kind":"rotation","yaw_rate":1e9}', 30)
        writer.add_message(mine, 40, b"{", 40)
        writer.add_message(mine, 50, good, 60)  # measured after it came
        writer.add_message(mine, 18, good, 18)  # out of order: it comes when the log had come so far
        writer.finish()
    reader = RecordingReader(path)
    assert list(reader) == [
        Sample(15, 20, "sample", "sample/imu", Rotation(0.5)),
        Sample(18, 20, "sample", "sample/imu", Rotation(0.5)),
    ]
    report = reader.report()
    assert report.ignored == 1
    assert report.malformed == {
        "sample/imu.yaw_rate": 1,
        "sample/imu.bad_json": 1,
        "sample/imu.time": 1,
    }


def test_a_damaged_chunk_costs_itself_only(tmp_path: Path) -> None:
    path = tmp_path / "drive.mcap"
    write(path, samples_of(20_000))
    whole = path.read_bytes()
    at = whole.index(ZSTANDARD, len(whole) // 2) + 100
    path.write_bytes(whole[:at] + bytes(byte ^ 0x55 for byte in whole[at : at + 8]) + whole[at + 8 :])
    reader = RecordingReader(path)
    left = len(list(reader))
    assert 15_000 < left < 20_000
    assert reader.report().malformed["broken_chunk"] == 1
    assert reader.report().malformed["lost_bytes"] > 0


def test_a_log_cut_off_is_read_up_to_the_cut(tmp_path: Path) -> None:
    path = tmp_path / "drive.mcap"
    write(path, samples_of(20_000))
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    reader = RecordingReader(path)
    left = list(reader)
    assert left == samples_of(20_000)[: len(left)]
    assert len(left) > 5000
    assert reader.report().malformed["broken_container"] == 1


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_no_bytes_crash_it(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    """Whatever is overwritten: samples come, or damage is counted, and every sample is one that was written."""
    path = tmp_path_factory.mktemp("fuzz") / "drive.mcap"
    write(path, samples_of(200))
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(content) - 1))
        junk = data.draw(st.binary(min_size=1, max_size=16))
        content[place : place + len(junk)] = junk
    path.write_bytes(content)
    assert len(list(RecordingReader(path))) <= 200
