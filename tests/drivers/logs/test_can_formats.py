"""Vector's and PEAK's recordings: written by python-can, whole and damaged, against its own readers."""

from __future__ import annotations

import gzip
import io
import struct
import tracemalloc
import zlib
from itertools import pairwise
from pathlib import Path

import can
import pytest
from can.io.trc import TRCFileVersion
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from drivers.can import CanFrame, CanSettings
from drivers.logs import LogReader, asc, blf, trc
from drivers.logs.canlog import CanLogReader, FrameSource, LoggedFrame, Tally
from drivers.sample import GeodeticPosition, Pressure, Velocity
from tests.drivers.can.encoding import fix, frames, message

START = 1_700_000_000.25
SOURCES: dict[str, FrameSource] = {"asc": asc.frames, "blf": blf.frames, "trc": trc.frames}


def messages(count: int = 20) -> list[can.Message]:
    """Frames of both kinds of identifier, a remote frame, and CAN FD of up to 64 bytes."""
    written: list[can.Message] = []
    for i in range(count):
        written.append(
            can.Message(
                timestamp=START + 0.01 * i,
                arbitration_id=0x18F00400 + i if i % 2 else 0x100 + i % 256,
                is_extended_id=bool(i % 2),
                data=bytes([i % 256, 255 - i % 256] * (i % 5)),
                channel=i % 2,
                is_rx=True,
            )
        )
    return written


def flexible(count: int = 8) -> list[can.Message]:
    lengths = (0, 1, 8, 12, 16, 24, 48, 64)
    return [
        can.Message(
            timestamp=START + 0.01 * i,
            arbitration_id=0x123 + i,
            is_extended_id=False,
            is_fd=True,
            bitrate_switch=bool(i % 2),
            data=bytes(range(lengths[i % 8])),
            channel=0,
        )
        for i in range(1, count)
    ]


def write(
    path: Path, written: list[can.Message], container: int | None = None, compression: int = -1
) -> None:
    options = {"compression_level": compression} if path.suffix == ".blf" else {}
    with can.Logger(path, **options) as logger:
        if container is not None:
            logger.max_container_size = container
        for one in written:
            logger(one)


def read(path: Path, form: str) -> tuple[list[LoggedFrame], Tally]:
    tally = Tally()
    with path.open("rb") as file:
        return list(SOURCES[form](file, tally)), tally


def plain(one: can.Message) -> CanFrame:
    return CanFrame(one.arbitration_id, bytes(one.data), one.is_extended_id, one.is_fd)


@pytest.mark.parametrize("form", SOURCES)
def test_what_python_can_writes_is_read(tmp_path: Path, form: str) -> None:
    path = tmp_path / f"log.{form}"
    write(path, messages())
    found, tally = read(path, form)
    assert [one.frame for one in found] == [plain(one) for one in messages()]
    assert not +tally.refused
    apart = [b.time_ns - a.time_ns for a, b in pairwise(found)]
    assert apart == pytest.approx([10_000_000] * 19, abs=2_000_000 if form == "trc" else 2_000)


@pytest.mark.parametrize("form", ["asc", "blf"])
def test_can_fd(tmp_path: Path, form: str) -> None:
    path = tmp_path / f"log.{form}"
    write(path, flexible())
    found, tally = read(path, form)
    assert [one.frame for one in found] == [plain(one) for one in flexible()]
    assert not +tally.refused


@pytest.mark.parametrize("form", SOURCES)
def test_python_can_reads_the_same(tmp_path: Path, form: str) -> None:
    path = tmp_path / f"log.{form}"
    write(path, messages() + ([] if form == "trc" else flexible()))
    with can.LogReader(path) as log:
        theirs = [(one.arbitration_id, bytes(one.data), one.is_extended_id, one.is_fd) for one in log]
    assert [tuple(one.frame) for one in read(path, form)[0]] == theirs


def test_the_start_of_a_blf_is_its_date(tmp_path: Path) -> None:
    path = tmp_path / "log.blf"
    write(path, messages())
    found, _ = read(path, "blf")
    assert found[0].time_ns == pytest.approx(START * 1e9, abs=1_000_000)
    assert [one.channel for one in found[:2]] == ["1", "2"]


def test_a_blf_of_many_containers_whose_objects_cross_them(tmp_path: Path) -> None:
    path = tmp_path / "log.blf"
    write(path, messages(3_000), container=1_000)
    found, tally = read(path, "blf")
    assert len(found) == 3_000
    assert not +tally.refused


def test_a_blf_without_compression(tmp_path: Path) -> None:
    path = tmp_path / "log.blf"
    write(path, messages(), compression=0)
    assert len(read(path, "blf")[0]) == 20


FD_64 = struct.Struct("<BBBBLLLLLLLHBBL")


@pytest.mark.parametrize("version", [1, 2])
def test_the_long_can_fd_object_by_hand(tmp_path: Path, version: int) -> None:
    """Type 101 with 12 bytes in a header of either version, beside an object of another type."""
    header = struct.pack("<LHHQ", 2, 0, 0, 5_000) if version == 1 else struct.pack("<LBxHQ8x", 1, 0, 0, 5)
    body = FD_64.pack(3, 9, 12, 0, 0x80000000 | 0x1ABCDE, 0, 0x1000, 0, 0, 0, 0, 0, 0, 0, 0) + bytes(
        range(12)
    )
    size = 16 + len(header) + len(body)
    one = struct.pack("<4sHHLL", b"LOBJ", 16 + len(header), version, size, 101) + header + body
    other = struct.pack("<4sHHLL", b"LOBJ", 32, 1, 40, 65) + bytes(24)
    content = zlib.compress(other + one)
    container = struct.pack("<4sHHLL", b"LOBJ", 16, 1, 32 + len(content), 10) + struct.pack(
        "<H6xL4x", 2, len(other + one)
    )
    path = tmp_path / "log.blf"
    path.write_bytes(b"LOGG" + struct.pack("<L", 144) + bytes(136) + container + content)
    found, tally = read(path, "blf")
    expected = 5_000 if version == 1 else 50_000
    assert found == [LoggedFrame(expected, "3", CanFrame(0x1ABCDE, bytes(range(12)), True, True))]
    assert (tally.skipped, +tally.refused) == (1, {})


def test_a_blf_with_a_damaged_container_loses_that_one(tmp_path: Path) -> None:
    path = tmp_path / "log.blf"
    write(path, messages(3_000), container=4_000)
    whole = bytearray(path.read_bytes())
    places = [i for i in range(len(whole)) if whole[i : i + 4] == b"LOBJ"]
    middle = places[len(places) // 2]
    whole[middle + 40 : middle + 60] = b"\xa5" * 20
    path.write_bytes(whole)
    found, tally = read(path, "blf")
    assert 2_800 < len(found) < 3_000
    assert found[-1].frame == plain(messages(3_000)[-1])
    assert tally.refused["bad_container"] == 1
    assert tally.refused["lost_bytes"] > 0


def test_a_blf_with_a_damaged_container_header_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "log.blf"
    write(path, messages(3_000), container=4_000)
    whole = bytearray(path.read_bytes())
    places = [i for i in range(len(whole)) if whole[i : i + 4] == b"LOBJ"]
    middle = places[len(places) // 2]
    for damage in (b"LUBJ", b"LOBJ\x10\0\1\0\xff\xff\x0f\0", b"LOBJ\x10\0\1\0\x20\0\0\0"):
        copy = bytearray(whole)
        copy[middle : middle + len(damage)] = damage
        path.write_bytes(copy)
        found, tally = read(path, "blf")
        assert 2_800 < len(found) <= 3_000
        assert found[-1].frame == plain(messages(3_000)[-1])
        assert sum(tally.refused.values()) > 0


def test_an_object_of_no_size_does_not_hang(tmp_path: Path) -> None:
    """python-can 4.6 reads this for ever."""
    stream = struct.pack("<4sHHLL", b"LOBJ", 32, 1, 0, 86) + bytes(32)
    content = zlib.compress(stream)
    container = struct.pack("<4sHHLL", b"LOBJ", 16, 1, 32 + len(content), 10) + struct.pack(
        "<H6xL4x", 2, len(stream)
    )
    path = tmp_path / "log.blf"
    path.write_bytes(b"LOGG" + struct.pack("<L", 144) + bytes(136) + container + content)
    assert read(path, "blf")[0] == []


def test_a_container_that_would_fill_the_memory_is_cut(tmp_path: Path) -> None:
    content = zlib.compress(bytes(64 << 20), 9)
    container = struct.pack("<4sHHLL", b"LOBJ", 16, 1, 32 + len(content), 10) + struct.pack("<H6xL4x", 2, 0)
    path = tmp_path / "log.blf"
    path.write_bytes(b"LOGG" + struct.pack("<L", 144) + bytes(136) + container + content)
    tracemalloc.start()
    try:
        found, tally = read(path, "blf")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert found == []
    assert tally.refused["bad_container"] == 1
    assert peak < 50 << 20


ASC = b"""date Sat Sep 30 10:06:13.191 PM 2017
base hex  timestamps absolute
internal events logged
// version 9.0.0
Begin Triggerblock Sat Sep 30 10:06:13.191 PM 2017
   0.000000 Start of measurement
   0.015991 CAN 1 Status:chip status error passive - TxErr: 132 RxErr: 0
   1.000000 1  1A2             Rx   d 3 01 02 FF  Length = 245 BitCount = 126 ID = 418
   1.500000 2  18EBFF00x       Rx   d 8 01 A0 0F A6 60 3B D1 40  Length = 273910 BitCount = 141
   2.000000 1  101             Rx   r
   2.100000 1  ErrorFrame
   2.200000 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%
   3.000000 CANFD   1 Rx        50005x  SomeName  0 0 5 5 00 01 02 03 04 140000 73 200050 7a60 46500250
End TriggerBlock
"""


def test_an_asc_as_vector_writes_it(tmp_path: Path) -> None:
    path = tmp_path / "log.asc"
    path.write_bytes(ASC)
    found, tally = read(path, "asc")
    start = 1_506_809_173_191_000_000  # 2017-09-30 22:06:13.191 UTC
    assert found == [
        LoggedFrame(start + 1_000_000_000, "1", CanFrame(0x1A2, b"\x01\x02\xff", False)),
        LoggedFrame(start + 1_500_000_000, "2", CanFrame(0x18EBFF00, bytes.fromhex("01a00fa6603bd140"))),
        LoggedFrame(start + 3_000_000_000, "1", CanFrame(0x50005, bytes(range(5)), True, True)),
    ]
    assert (tally.skipped, +tally.refused) == (5, {})


def test_an_asc_in_decimals_with_times_between_lines(tmp_path: Path) -> None:
    path = tmp_path / "log.asc"
    path.write_bytes(
        b"date Mit Mai 3 1:00:00 am 2023\nbase dec  timestamps relative\nno internal events logged\n"
        b"1.0 1 291 Rx d 2 255 16\n0.5 1 291 Rx d 1 7\n0.5 1 291 Rx d 2 256 1\n"
    )
    found, tally = read(path, "asc")
    start = 1_683_075_600_000_000_000
    assert [(one.time_ns - start, one.frame.data) for one in found] == [
        (1_000_000_000, b"\xff\x10"),
        (1_500_000_000, b"\x07"),
    ]
    assert tally.refused == {"bad_line": 1}


def test_an_asc_with_damaged_lines(tmp_path: Path) -> None:
    path = tmp_path / "log.asc"
    lines = ASC.splitlines(keepends=True)
    lines[7:7] = [
        b"\xff\x00\x81\n",
        b"   1.1 1  1A2  Rx  d 8 01 02\n",
        b"   1.2 1  1G2 Rx d 1 00\n",
        b"  1.3 1 FFF Rx d 0\n",
    ]
    path.write_bytes(b"".join(lines))
    found, tally = read(path, "asc")
    assert len(found) == 3
    assert tally.refused == {"bad_line": 4}


TRC_HEADS = {
    "1.0": b"; no version\n     1)      1000.0     0123  2  01 FF\n     2)  1500  18EBFF00 0\n",
    "1.1": b";$FILEVERSION=1.1\n;$STARTTIME=45000.5\n     1)      1000.0  Rx         0123  2  01 FF\n"
    b"     2)      1200.0  Warng  FFFFFFFF  4  00 00 00 08 BUSHEAVY\n     3)   1500  Rx  18EBFF00  0\n",
    "1.3": b";$FILEVERSION=1.3\n;$STARTTIME=45000.5\n     1)      1000.0 1  Rx        0123 -  2    01 FF\n"
    b"     2)      1200.0 1  Rx  0124 -  2  RTR\n     3)   1500 2  Rx  18EBFF00 - 0\n",
    "2.1": b";$FILEVERSION=2.1\n;$STARTTIME=45000.5\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n"
    b"  1  1000.000 DT 1      0123 Rx -  2    01 FF\n"
    b"  2  1200.0 ST 1 - Rx - 5 00 00 00 00 08\n  3  1500.0 DT 2 18EBFF00 Rx - 0\n",
}  # fmt: skip


@pytest.mark.parametrize("version", TRC_HEADS)
def test_every_version_of_trc(tmp_path: Path, version: str) -> None:
    path = tmp_path / "log.trc"
    path.write_bytes(TRC_HEADS[version] + b"not a line\n")
    found, tally = read(path, "trc")
    start = 0 if version == "1.0" else round((45000.5 - 25_569) * 86_400) * 1_000_000_000
    assert [(one.time_ns - start, one.frame) for one in found] == [
        (1_000_000_000, CanFrame(0x123, b"\x01\xff", False)),
        (1_500_000_000, CanFrame(0x18EBFF00, b"", True)),
    ]
    assert tally.refused == {"bad_line": 1}
    assert tally.skipped == (0 if version == "1.0" else 1)


def test_trc_of_can_fd(tmp_path: Path) -> None:
    path = tmp_path / "log.trc"
    path.write_bytes(
        b";$FILEVERSION=2.0\n;$COLUMNS=N,O,T,I,d,l,D\n 1 1.5 FB 0123 Rx 12 " + b"0A " * 12 + b"\n"
        b" 2 2.5 FD 00000123 Rx 9 00\n"
    )
    found, tally = read(path, "trc")
    assert found == [LoggedFrame(1_500_000, "1", CanFrame(0x123, b"\x0a" * 12, False, True))]
    assert tally.refused == {"bad_line": 1}


def test_trc_1_0_as_python_can_writes_it(tmp_path: Path) -> None:
    path = tmp_path / "log.trc"
    with can.TRCWriter(path) as writer:
        writer.file_version = TRCFileVersion.V1_0
        for one in messages():
            writer(one)
    assert [one.frame for one in read(path, "trc")[0]] == [plain(one) for one in messages()]


def dronecan_log(path: Path) -> None:
    sent = [*frames(fix()), *frames(message("air_data.StaticPressure", static_pressure=9e4))]
    write(
        path,
        [
            can.Message(timestamp=START + 0.001 * i, arbitration_id=f.identifier, data=f.data, channel=0)
            for i, f in enumerate(sent)
        ],
    )


@pytest.mark.parametrize("form", SOURCES)
def test_samples_of_the_live_decoder(tmp_path: Path, form: str) -> None:
    path = tmp_path / f"drive.{form}"
    dronecan_log(path)
    log: LogReader = CanLogReader(path, "bus", CanSettings(), SOURCES[form])
    samples = list(log)
    assert [type(one.reading) for one in samples] == [GeodeticPosition, Velocity, Pressure]
    assert log.report().malformed == {}
    assert log.position == log.size
    assert list(log) == samples


@pytest.mark.parametrize("form", ["asc", "trc"])
def test_a_text_log_may_be_zipped(tmp_path: Path, form: str) -> None:
    path = tmp_path / f"log.{form}"
    write(path, messages())
    zipped = path.with_suffix(f".{form}.gz")
    zipped.write_bytes(gzip.compress(path.read_bytes()))
    assert read(zipped, form)[0] == read(path, form)[0]


def damage(whole: bytes, kind: str, place: float, amount: bytes) -> bytes:
    at = int(place * len(whole))
    if kind == "truncated":
        return whole[:at]
    if kind == "inserted":
        return whole[:at] + amount + whole[at:]
    return whole[:at] + amount + whole[at + len(amount) :]


DAMAGES = {
    "kind": st.sampled_from(["truncated", "flipped", "inserted"]),
    "place": st.floats(0.0, 1.0),
    "amount": st.binary(min_size=1, max_size=40),
}


@pytest.fixture(scope="module", params=list(SOURCES))
def whole(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, bytes]:
    form = str(request.param)
    path = tmp_path_factory.mktemp("whole") / f"log.{form}"
    write(path, messages(400), container=2_000 if form == "blf" else None)
    return form, path.read_bytes()


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(**DAMAGES)
def test_damage_costs_what_it_covers_and_is_counted(
    whole: tuple[str, bytes], kind: str, place: float, amount: bytes
) -> None:
    """Frames before the damage are all there, those after it but for the container that it hit (2 KB: 42 of 400)."""
    form, content = whole
    tally = Tally()
    found = list(SOURCES[form](io.BytesIO(damage(content, kind, place, amount)), tally))
    expected = [plain(one) for one in messages(400)]
    kept = [one.frame for one in found]
    assert len(kept) <= 401
    if kind != "truncated" and place > 0.25:
        assert len(kept) >= 300
        assert kept[:10] == expected[:10]
    if kind != "truncated" and 0.25 < place < 0.75:
        assert kept[-10:] == expected[-10:]


@pytest.mark.parametrize("form", SOURCES)
@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=3_000))
def test_any_bytes_are_survived(form: str, content: bytes) -> None:
    head = {
        "blf": b"LOGG" + struct.pack("<L", 144) + bytes(136),
        "asc": b"base hex\n",
        "trc": b";$FILEVERSION=2.1\n",
    }
    for start in (b"", head[form]):
        list(SOURCES[form](io.BytesIO(start + content), Tally()))
