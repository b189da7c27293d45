"""Telemetry logs: whole, damaged, cut off, with a clock that was set; and the recordings where they are."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from drivers.logs import LogReader
from drivers.logs.tlog import ReceiveClock, TlogReader
from drivers.mavlink.settings import MavlinkSettings
from drivers.sample import Attitude, GeodeticPosition, LinkReport, Odometer, Range, Rotation, Sample
from tests.drivers.mavlink.wire import attitude, frame, frame_1, gps, heartbeat, raw_frame

RECORDINGS = Path(__file__).parents[3].parent / "shared" / "data"
START = 1_700_000_000_000_000  # µs
SETTINGS = MavlinkSettings(url="")


def entry(data: bytes, after_us: int) -> bytes:
    return (START + after_us).to_bytes(8, "big") + data


def ordinary(count: int) -> list[bytes]:
    """A heartbeat, then attitudes at 50 Hz that arrive when they were measured, 10 s after boot."""
    attitudes = [entry(attitude(10_000 + 20 * i, sequence=(i + 1) % 256), 20_000 * i) for i in range(count)]
    return [entry(heartbeat(), 0), *attitudes]


def read(path: Path, *entries: bytes) -> tuple[list[Sample], TlogReader]:
    path.write_bytes(b"".join(entries))
    reader = TlogReader(path, "autopilot", SETTINGS)
    return list(reader), reader


def lost(report: LinkReport) -> dict[str, int]:
    return {kind: count for kind, count in report.malformed.items() if kind != "lost_bytes"}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "flight.tlog"


def test_samples_come_in_order_on_the_receive_clock(path: Path) -> None:
    samples, reader = read(path, *ordinary(5))
    assert [s.received for s in samples[1:]] == [(START + 20_000 * i) * 1_000 for i in range(5)]
    assert all(s.link == "autopilot" for s in samples)
    assert all(s.time <= s.received for s in samples)
    report = reader.report()
    assert (report.messages, report.samples, report.malformed, report.ignored) == (6, 6, {}, 0)
    assert report.lost == 0
    assert report.clock == "envelope"
    assert reader.position == reader.size == path.stat().st_size


def test_each_iteration_begins_anew(path: Path) -> None:
    first, reader = read(path, *ordinary(5))
    again = list(reader)
    assert again == first
    assert reader.report().messages == 6


def test_progress_moves_while_it_is_read(path: Path) -> None:
    _, reader = read(path, *ordinary(50))
    places = [reader.position for _ in reader]
    assert places == sorted(places)
    assert 0 < places[0] < places[-1] == reader.size


def test_everything_that_was_met_is_named(path: Path) -> None:
    """Replay can say that the log has a truth of its own (SIM_STATE), though no one wants it."""
    simulated = entry(frame("SIM_STATE", *[0.0] * 21, 1, 1), 30_000)
    _, reader = read(path, *ordinary(2), simulated, entry(raw_frame(0xABCDEF, 0, b"?"), 40_000))
    assert reader.kinds() == {"HEARTBEAT": 1, "ATTITUDE": 2, "SIM_STATE": 1, "11259375": 1}
    report = reader.report()
    assert report.ignored == 1
    assert report.malformed == {"unknown_message": 1}


def test_what_is_missing_in_it_is_counted(path: Path) -> None:
    """One round and a half of the numbers, less twelve; an unknown message has a number as well."""
    whole = ordinary(400)
    whole[100] = entry(raw_frame(0xABCDEF, 0, b"?", sequence=100), 1_980_000)
    _, reader = read(path, *whole[:50], *whole[57:255], *whole[260:])
    assert reader.report().lost == 12
    assert reader.report().malformed == {"unknown_message": 1}
    list(reader)
    assert reader.report().lost == 12


def test_mavlink_1_and_signed_frames_are_read(path: Path) -> None:
    old = frame_1("ATTITUDE", 10_000, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0)
    signed = frame("ATTITUDE", 10_020, 0.1, 0.2, 0.4, 0.0, 0.0, 0.0, flags=1) + bytes(13)
    samples, reader = read(path, entry(old, 0), entry(signed, 20_000), entry(heartbeat(), 30_000))
    yaws = [s.reading.yaw for s in samples if isinstance(s.reading, Attitude)]
    assert yaws == pytest.approx([0.3, 0.4])
    assert reader.report().malformed == {}


def test_an_empty_log_is_empty(path: Path) -> None:
    samples, reader = read(path)
    assert samples == []
    assert reader.report().messages == 0


def test_an_absent_log_says_so(path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        list(TlogReader(path, "autopilot", SETTINGS))


def test_a_log_that_was_cut_off(path: Path) -> None:
    whole = b"".join(ordinary(3))
    for length in range(len(whole) - 1, len(whole) - 47, -1):
        samples, reader = read(path, whole[:length])
        assert len(samples) == 3
        assert lost(reader.report()) == {"truncated": 1}


def test_a_hole_costs_what_it_covers(path: Path) -> None:
    entries = ordinary(20)
    damaged = bytearray(b"".join(entries))
    size = len(entries[1])
    first = len(entries[0]) + 5 * size
    damaged[first + 3 : first + 2 * size + 11] = b"\xfd" * (2 * size + 8)  # the markers make it worse
    samples, reader = read(path, bytes(damaged))
    assert len(samples) == 21 - 3
    assert sum(lost(reader.report()).values()) <= 2
    assert reader.report().malformed["lost_bytes"] == 3 * size


def test_something_else_entirely(path: Path) -> None:
    samples, reader = read(path, b"This is no telemetry log at all, but a text.\n" * 100)
    assert samples == []
    assert reader.report().malformed == {"bad_prefix": 1, "lost_bytes": 4_500}
    assert reader.position == 4_500


def test_a_clock_set_back_goes_on(path: Path) -> None:
    """The recording laptop was set an hour back in flight: what arrived later stays later."""
    before = ordinary(50)
    after = [entry(attitude(11_000 + 20 * i), 1_000_000 + 20_000 * i - 3_600_000_000) for i in range(50)]
    samples, reader = read(path, *before, *after)
    assert all(earlier.received <= later.received for earlier, later in pairwise(samples))
    assert samples[-1].received < (START + 2_100_000) * 1_000
    assert lost(reader.report()) == {"clock_step": 1}


def test_a_pause_in_the_recording_is_a_pause(path: Path) -> None:
    later = [entry(heartbeat(), 7_200_000_000 + 20_000 * i) for i in range(3)]
    samples, reader = read(path, *ordinary(3), *later)
    assert samples[-1].received == (START + 7_200_040_000) * 1_000
    assert reader.report().malformed == {}


@pytest.mark.parametrize("stamp", [0, START - 10**12, START + 10**12, 2**64 - 1])
@pytest.mark.parametrize("place", [0, 1, 5])
def test_a_damaged_stamp_is_bridged(path: Path, stamp: int, place: int) -> None:
    entries = ordinary(10)
    entries[place] = stamp.to_bytes(8, "big") + entries[place][8:]
    samples, reader = read(path, *entries)
    assert len(samples) == 11
    assert all(earlier.received <= later.received for earlier, later in pairwise(samples))
    assert samples[-1].received == (START + 180_000) * 1_000
    if place:
        assert lost(reader.report()) == {"bad_stamp": 1}


def test_a_small_step_back_is_not_turned_round() -> None:
    """Two threads that write one log: a little out of order is no reason to run late for ever."""
    clock = ReceiveClock([100, 105, 103])
    times = [
        clock.read(stamp, following)
        for stamp, following in ((100, 105), (105, 103), (103, 104), (104, 110), (110, None))
    ]
    assert times == [100_000, 105_000, 105_000, 105_000, 110_000]


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_any_damage_is_survived(path: Path, data: st.DataObject) -> None:
    """Bytes changed, removed and inserted anywhere: no error, no lie about the order, little lost."""
    log = bytearray(b"".join(ordinary(40)))
    hits = data.draw(st.lists(st.integers(0, len(log) - 1), max_size=5))
    for hit in hits:
        change = data.draw(st.sampled_from(("set", "cut", "put")))
        if change == "set":
            log[min(hit, len(log) - 1)] = data.draw(st.integers(0, 255))
        elif change == "cut":
            del log[hit : hit + data.draw(st.integers(1, 30))]
        else:
            log[hit:hit] = data.draw(st.binary(max_size=30))
    samples, reader = read(path, bytes(log))
    assert len(samples) >= 41 - 3 * len(hits)
    assert all(earlier.received <= later.received for earlier, later in pairwise(samples))
    assert reader.position == len(log)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=2_000))
def test_any_bytes_are_survived(path: Path, log: bytes) -> None:
    _, reader = read(path, log)
    assert reader.position == len(log)


def test_it_is_a_log_reader(path: Path) -> None:
    path.write_bytes(entry(gps(), 0))
    reader: LogReader = TlogReader(path, "autopilot", SETTINGS)
    assert [type(s.reading).__name__ for s in reader] == ["GeodeticPosition", "Velocity"]


def recording(name: str) -> TlogReader:
    path = RECORDINGS / name
    if not path.exists():
        pytest.skip(f"the recording {name} is not in ../shared/data")
    return TlogReader(path, "autopilot", SETTINGS)


def counted(reader: TlogReader) -> Counter[type]:
    return Counter(type(sample.reading) for sample in reader)


@pytest.mark.recordings
def test_plaza2() -> None:
    """4,090 odometer and yaw rate readings, 1,816 ranges to tags 0, 1, 5, 6, and nothing refused."""
    reader = recording("plaza2.tlog")
    samples = list(reader)
    kinds = Counter(type(s.reading) for s in samples)
    assert (kinds[Odometer], kinds[Rotation], kinds[Range]) == (4_090, 4_090, 1_816)
    assert {s.reading.beacon for s in samples if isinstance(s.reading, Range)} == {0, 1, 5, 6}
    odometer = [s.reading for s in samples if isinstance(s.reading, Odometer)]
    assert {reading.epoch for reading in odometer} == {0}
    assert odometer[-1].distance[0] == pytest.approx(1_354, abs=20)
    assert reader.report().malformed == {}


@pytest.mark.recordings
def test_sitl_rover() -> None:
    """Forty kinds of message of a real autopilot; its magnetometer is refused, its silent RPM passed over."""
    reader = recording("sitl_rover.tlog")
    late: list[int] = []
    kinds: Counter[type] = Counter()
    for sample in reader:
        kinds[type(sample.reading)] += 1
        if sample.source == "RAW_IMU":
            late.append(sample.received - sample.time)
    assert kinds[Odometer] == 6_899
    assert kinds[GeodeticPosition] == 2_752
    assert len(reader.kinds()) == 41
    assert reader.kinds()["SIM_STATE"] == 6_890
    assert reader.report().malformed == {"HIGHRES_IMU.mag": 13_778}
    assert reader.report().unusable == {"GPS_RAW_INT.fix_type": 4, "RPM.rpm1": 2_768}
    late.sort()
    assert late[0] >= 0
    assert late[len(late) // 2] < 10_000_000
    assert late[-1] < 200_000_000


@pytest.mark.recordings
@pytest.mark.parametrize(
    ("name", "ranges"),
    [("uwb_los_a1", 8_405), ("uwb_los_b3", 6_645), ("uwb_nlos_a1", 9_447), ("uwb_nlos_b3", 6_297)],
)
def test_uwb(name: str, ranges: int) -> None:
    assert counted(recording(f"{name}.tlog"))[Range] == ranges


@pytest.mark.recordings
def test_real_telemetry_by_radio() -> None:
    """MAVLink 1 over a radio with a ground station on the link; the laptop's clock was set 227 s forward."""
    reader = recording("ubc_mission1.tlog")
    samples = list(reader)
    assert Counter(s.source for s in samples)["ATTITUDE"] == 902
    assert reader.report().ignored > 20_000
    assert 2_000 < reader.report().lost < 2_471  # all gaps by pymavlink's numbers, also those of silences
    settled = [
        s.received - s.time for s in samples if s.source == "ATTITUDE" and s.received > samples[0].received
    ]
    assert sorted(settled)[len(settled) * 9 // 10] < 5_000_000_000
    assert {s.source for s in samples} >= {"GPS_RAW_INT", "RAW_IMU", "HEARTBEAT", "SCALED_PRESSURE"}
