"""The clock mapping against a simulated sensor whose true offset is known.

Arrival jitter is that of a real ArduPilot (MESSAGES.md): median 18 ms, 99th percentile 33, worst 750.
"""

from __future__ import annotations

import random
import sys
from collections.abc import Callable, Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import clock
from drivers.clock import (
    BOOT_MS,
    BOOT_US,
    BOOT_US_32,
    NEW_LINE_AFTER,
    SECOND,
    US_56,
    ClockMap,
    DeviceClocks,
    StampKind,
)

MILLI = 1_000_000
HOST_START = 5_000 * SECOND
KINDS = (BOOT_MS, BOOT_US, BOOT_US_32, US_56)


def latency(chance: random.Random) -> int:
    """Nanoseconds between the stamp and the arrival, by the figures above."""
    draw = chance.random()
    if draw < 0.0005:
        return int(chance.uniform(0.1, 0.75) * SECOND)
    return max(2 * MILLI, int(chance.gauss(18.0, 6.0) * MILLI))


def stream(
    seconds: float, rate: float, drift: float = 0.0, boot: int = 10 * SECOND, seed: int = 1
) -> Iterator[tuple[int, int, int]]:
    """Yield (sensor ns, true host ns, received ns) of a clock that runs ``drift`` too fast."""
    chance = random.Random(seed)
    for index in range(int(seconds * rate)):
        true = HOST_START + int(index * SECOND / rate)
        yield boot + int((true - HOST_START) * (1.0 + drift)), true, true + latency(chance)


def stamped(sensor: int, kind: StampKind) -> int:
    count = sensor // kind.unit
    return count if kind.period is None else count % (kind.period // kind.unit)


def errors(samples: Iterator[tuple[int, int, int]], kind: StampKind, settle: float = 20.0) -> list[float]:
    """Milliseconds that the mapped time is late, once settled."""
    mapped, late = ClockMap(), list[float]()
    for sensor, true, received in samples:
        time = mapped.host_time(stamped(sensor, kind), kind, received)
        assert time <= received
        if true > HOST_START + settle * SECOND:
            late.append((time - true) / MILLI)
    assert mapped.epoch == 0
    return late


@pytest.mark.parametrize("kind", KINDS)
def test_jitter_of_arrival_is_taken_out(kind: StampKind) -> None:
    """The latency of 18 ms shrinks to the quickest arrivals, 2 ms; the worst, 750 ms, is no exception."""
    late = errors(stream(120, 50), kind)
    assert max(late) < 5.0
    assert min(late) > -1.0  # a stamp in milliseconds is cut, so up to that much early


@pytest.mark.parametrize("drift", [50e-6, -50e-6])
def test_drift_is_followed_both_ways_over_an_hour(drift: float) -> None:
    """50 ppm are 180 ms in an hour; the mapping stays within some milliseconds of the truth throughout."""
    late = errors(stream(3_600, 10, drift), BOOT_US)
    assert max(late) < 12.0
    assert min(late) > -1.0


@pytest.mark.parametrize("drift", [300e-6, -300e-6])
def test_a_drift_beyond_what_is_allowed_is_still_followed(drift: float) -> None:
    """By the window: at most 30 s of it, 9 ms, on top of the rest."""
    late = errors(stream(600, 20, drift), BOOT_US, settle=60.0)
    assert max(late) < 20.0
    assert min(late) > -12.0


def test_rare_stamps_are_remembered_longer() -> None:
    """One in twenty seconds, half of them late by half a second: 30 s would often hold no quick one."""
    mapped, chance = ClockMap(), random.Random(5)
    late: list[int] = []
    for index in range(300):
        now = HOST_START + index * 20 * SECOND
        delay = chance.choice((2, 500)) * MILLI
        late.append(mapped.host_time((now - HOST_START + SECOND) // 1_000, BOOT_US, now + delay) - now)
    assert max(late[20:]) < 60 * MILLI


@pytest.mark.parametrize(
    ("kind", "wraps_at"), [(BOOT_MS, 2**32 * MILLI), (BOOT_US_32, 2**32 * 1_000), (US_56, 2**56 * 1_000)]
)
def test_a_counter_that_wraps_goes_on(kind: StampKind, wraps_at: int) -> None:
    # not in step with the wrap: a count of just 0 is "unknown", and costs that one sample its mapping
    late = errors(stream(120, 50, boot=wraps_at - 60 * SECOND - 7_003_000), kind)
    assert max(late) < 5.0
    assert min(late) > -1.0


def test_counters_of_one_boot_share_a_line() -> None:
    """Two hours after boot, first heard by the counter that has wrapped: the wide one sets it right."""
    mapped = ClockMap()
    boot = 7_200 * SECOND
    late: list[int] = []
    for index, (sensor, true, received) in enumerate(stream(20, 50, boot=boot)):
        kind = (BOOT_US_32, BOOT_US)[index % 2]
        time = mapped.host_time(stamped(sensor, kind), kind, received)
        if index > 500:
            late.append(time - true)
    assert max(late) < 5 * MILLI
    assert mapped.epoch == 0


@pytest.mark.parametrize("uptime", [3.0, 100.0, 90_000.0])
@pytest.mark.parametrize("kind", [BOOT_MS, BOOT_US, BOOT_US_32])
def test_a_reboot_starts_an_epoch_and_is_right_at_once(uptime: float, kind: StampKind) -> None:
    mapped = ClockMap()
    before = stream(uptime if uptime < 60 else 30, 50, boot=int(max(1.0, uptime - 30) * SECOND))
    received = last = 0
    for sensor, _, received in before:
        mapped.host_time(stamped(sensor, kind), kind, received)
    gap = received - HOST_START + 5 * SECOND
    late: list[int] = []
    for index, (sensor, true, received) in enumerate(stream(30, 50, boot=SECOND, seed=2)):
        last = mapped.host_time(stamped(sensor, kind), kind, received + gap)
        assert last <= received + gap
        if index >= NEW_LINE_AFTER - 1:
            late.append(last - true - gap)
    assert mapped.epoch == 1
    assert max(late) < 40 * MILLI
    assert late[-1] < 5 * MILLI
    assert min(late) > -1 * MILLI


def test_an_old_stamp_is_old_and_starts_nothing() -> None:
    """A frozen message among running ones stays at its time, however long."""
    mapped = ClockMap()
    frozen_at = HOST_START + 10 * SECOND
    for sensor, true, received in stream(60, 50):
        mapped.host_time(sensor // 1_000, BOOT_US, received)
        if true > frozen_at:
            old = mapped.host_time(20 * SECOND // 1_000, BOOT_US, received)
            assert abs(old - frozen_at) < 10 * MILLI
    assert mapped.epoch == 0


def test_one_wild_stamp_harms_nothing() -> None:
    mapped = ClockMap()
    for index, (sensor, true, received) in enumerate(stream(60, 50)):
        if index % 100 == 50:
            wild = mapped.host_time(2**60, BOOT_US, received)
            assert wild == received
            continue
        time = mapped.host_time(sensor // 1_000, BOOT_US, received)
        if index > 1_000:
            assert abs(time - true) < 5 * MILLI


@pytest.mark.parametrize("nonsense", [2**64 - 1, 2**63])
def test_a_first_stamp_from_the_far_future_makes_no_time_that_no_datagram_can_carry(nonsense: int) -> None:
    """The true stamps after it lie before the clock's zero, until three of them have made the true line."""
    clock = ClockMap()
    now = 1000 * SECOND
    times = [clock.host_time(nonsense, BOOT_US, now)]
    for step in range(1, 40):
        arrival = now + step * SECOND // 10
        times.append(clock.host_time(500_000_000 + step * 100_000, BOOT_US, arrival))
    assert min(times) >= 0
    assert times[-1] == arrival


def test_a_backlog_is_old_and_not_a_new_clock() -> None:
    """Ten seconds held back and then delivered at once: the stamps say when it was, the arrival does not."""
    mapped = ClockMap()
    for sensor, true, received in stream(60, 50):
        held = HOST_START + 30 * SECOND <= true < HOST_START + 40 * SECOND
        arrival = HOST_START + 40 * SECOND if held else received
        time = mapped.host_time(sensor // 1_000, BOOT_US, arrival)
        if true > HOST_START + 20 * SECOND:
            assert abs(time - true) < 5 * MILLI
    assert mapped.epoch == 0


def test_a_clock_that_stopped_is_found_again() -> None:
    """The device hung for 100 s and went on counting: soon what it says is not taken for 100 s old."""
    mapped, late = ClockMap(), list[int]()
    for sensor, true, received in stream(60, 50):
        stopped = 100 * SECOND if true > HOST_START + 30 * SECOND else 0
        time = mapped.host_time(sensor // 1_000, BOOT_US, received + stopped)
        if true > HOST_START + 33 * SECOND:
            late.append(time - true - stopped)
    assert max(map(abs, late)) < 40 * MILLI
    assert abs(late[-1]) < 5 * MILLI
    assert mapped.epoch == 0


def test_a_device_that_repeats_itself_has_not_rebooted() -> None:
    mapped, received = ClockMap(), 0
    for sensor, _, received in stream(30, 50):
        mapped.host_time(sensor // 1_000, BOOT_US, received)
    for index in range(20):
        old = mapped.host_time(20 * SECOND // 1_000, BOOT_US, received + index * 20 * MILLI)
        assert abs(old - HOST_START - 10 * SECOND) < 10 * MILLI
    assert mapped.epoch == 0


def test_drift_in_silence_is_allowed_for() -> None:
    """A clock 90 ppm slow is 324 ms behind after an hour in which it was not heard."""
    mapped = ClockMap()
    for sensor, _, received in stream(60, 50, -90e-6):
        mapped.host_time(sensor // 1_000, BOOT_US, received)
    later = 3_600 * SECOND
    time = mapped.host_time(
        int(10 * SECOND + later * (1 - 90e-6)) // 1_000, BOOT_US, HOST_START + later + 10 * MILLI
    )
    assert abs(time - HOST_START - later) < 45 * MILLI


def test_silence_forgets_nothing() -> None:
    """After an hour of silence the first arrival, 750 ms late, is placed by what was known before."""
    mapped = ClockMap()
    for sensor, _, received in stream(60, 50):
        mapped.host_time(sensor // 1_000, BOOT_US, received)
    later = 3_600 * SECOND
    time = mapped.host_time((10 * SECOND + later) // 1_000, BOOT_US, HOST_START + later + 750 * MILLI)
    assert time - HOST_START - later < 400 * MILLI  # an hour at the allowed drift


@pytest.mark.parametrize("kind", KINDS)
def test_an_unknown_stamp_is_the_arrival(kind: StampKind) -> None:
    mapped = ClockMap()
    assert mapped.host_time(0, kind, HOST_START) == HOST_START
    assert mapped.method == "arrival"
    assert mapped.offset is None
    assert mapped.jitter is None


def test_boot_or_1970_by_magnitude() -> None:
    clocks = DeviceClocks()
    clocks.microseconds(12_000_000, HOST_START)
    clocks.microseconds(1_795_300_760_657_267, HOST_START)
    assert clocks.boot.offset == pytest.approx(HOST_START / SECOND - 12.0)
    assert clocks.unix.offset == pytest.approx(HOST_START / SECOND - 1_795_300_760.657267)


def test_a_step_of_the_sensors_wall_clock_is_followed() -> None:
    """Unix stamps that are set an hour back, then forward: soon right again."""
    clocks = DeviceClocks()
    unix = 1_795_300_760 * SECOND
    for step in (0, -3_600 * SECOND, 3_600 * SECOND):
        late: list[int] = []
        for sensor, true, received in stream(30, 50, seed=step % 7):
            shift = {0: 0, -3_600 * SECOND: 40 * SECOND, 3_600 * SECOND: 80 * SECOND}[step]
            time = clocks.microseconds((unix + sensor + shift + step) // 1_000, received + shift)
            late.append(time - true - shift)
        assert abs(late[-1]) < 5 * MILLI


def test_no_clock_of_the_host_is_read() -> None:
    """So no step of the host's wall clock can matter: time is what the caller says."""
    assert "time" not in vars(clock)
    assert "datetime" not in vars(clock)
    assert not {name for name, value in vars(clock).items() if value is sys.modules["time"]}


def exchange(
    mapped: ClockMap, now: int, offset: int, outward: Callable[[], int], homeward: Callable[[], int]
) -> int:
    """One TIMESYNC over a path with these delays; return when it ended."""
    arrived = now + outward()
    back = arrived + homeward()
    mapped.exchanged(now, arrived - offset, back)
    return back


def test_exchanges_take_over_and_beat_the_envelope() -> None:
    """Where no message takes less than 15 ms the envelope is 15 ms late; a symmetric exchange is exact."""
    mapped, chance, offset = ClockMap(), random.Random(3), HOST_START - 10 * SECOND
    methods: list[str] = []
    late = 0
    for index in range(200):
        now = HOST_START + index * SECOND // 10
        mapped.host_time((now - offset) // 1_000, BOOT_US, now + int(chance.uniform(15, 40) * MILLI))
        late = mapped.host_time((now - offset) // 1_000, BOOT_US, now + 30 * MILLI) - now
        methods.append(mapped.method)
        exchange(mapped, now + 50 * MILLI, offset, lambda: 5 * MILLI, lambda: 5 * MILLI)
    assert methods[0] == "envelope"
    assert methods[-1] == "timesync"
    assert abs(late) < MILLI
    assert mapped.jitter == pytest.approx(0.028, abs=0.01)


@pytest.mark.parametrize(("out", "home"), [(2, 20), (20, 2), (1, 1)])
def test_the_error_is_at_most_half_the_round_trip(out: int, home: int) -> None:
    mapped, offset = ClockMap(), HOST_START - 10 * SECOND
    for index in range(20):
        exchange(mapped, HOST_START + index * SECOND, offset, lambda: out * MILLI, lambda: home * MILLI)
    assert mapped.method == "timesync"
    assert mapped.offset is not None
    assert abs(mapped.offset * SECOND - offset) <= (out + home) / 2 * MILLI + 1_000


def test_the_quickest_exchange_counts() -> None:
    """Nineteen of twenty go through a congested way out; the one that does not decides."""
    mapped, offset = ClockMap(), HOST_START - 10 * SECOND
    for index in range(60):
        out = 1 * MILLI if index % 20 == 10 else 80 * MILLI
        exchange(mapped, HOST_START + index * SECOND, offset, lambda out=out: out, lambda: 1 * MILLI)
    assert mapped.offset is not None
    assert abs(mapped.offset * SECOND - offset) < 3 * MILLI


def test_exchanges_that_stop_give_way_to_the_envelope() -> None:
    mapped, offset = ClockMap(), HOST_START - 10 * SECOND
    now = HOST_START
    for _ in range(20):
        now = exchange(mapped, now + SECOND, offset, lambda: MILLI, lambda: MILLI)
    assert mapped.method == "timesync"
    for _ in range(40):
        now += SECOND
        mapped.host_time((now - offset) // 1_000, BOOT_US, now + 4 * MILLI)
    assert mapped.method == "envelope"


def test_an_answer_on_another_clock_is_not_believed() -> None:
    """A peer whose TIMESYNC is an hour off its stamps: the stamps count."""
    mapped, offset = ClockMap(), HOST_START - 10 * SECOND
    for index in range(100):
        now = HOST_START + index * SECOND // 2
        mapped.host_time((now - offset) // 1_000, BOOT_US, now + 4 * MILLI)
        peer = now - offset + 3_600 * SECOND + (index % 2) * 7 * SECOND
        mapped.exchanged(now, peer, now + MILLI)
    assert mapped.method == "envelope"
    assert mapped.disagreements == 100
    assert mapped.offset == pytest.approx((offset + 4 * MILLI) / SECOND, abs=1e-3)


def test_exchanges_that_contradict_the_stamps_are_not_believed() -> None:
    """Half a second: by the exchanges the stamps would have arrived before they were given."""
    mapped, offset = ClockMap(), HOST_START - 10 * SECOND
    for index in range(100):
        now = HOST_START + index * SECOND // 2
        mapped.host_time((now - offset) // 1_000, BOOT_US, now + 4 * MILLI)
        mapped.exchanged(now, now - offset - SECOND // 2, now + MILLI)
    assert mapped.method == "envelope"
    assert mapped.disagreements > 80


@pytest.mark.parametrize("trip", [-1, 11 * SECOND])
def test_an_impossible_round_trip_is_not_believed(trip: int) -> None:
    mapped = ClockMap()
    mapped.exchanged(HOST_START, SECOND, HOST_START + trip)
    assert mapped.disagreements == 1
    assert mapped.method == "arrival"


def test_exchanges_of_unix_nanoseconds_belong_to_the_unix_clock() -> None:
    clocks = DeviceClocks()
    for index in range(20):
        now = HOST_START + index * SECOND
        clocks.exchanged(now, 1_795_300_760 * SECOND + index * SECOND, now + MILLI)
    assert clocks.unix.method == "timesync"
    assert clocks.boot.method == "arrival"


@given(
    st.lists(
        st.tuples(st.integers(0, 2**64 - 1), st.sampled_from(KINDS), st.integers(-(2**40), 2**40)),
        max_size=40,
    )
)
def test_no_stamps_raise_and_none_is_in_the_future(arrivals: list[tuple[int, StampKind, int]]) -> None:
    mapped, now = ClockMap(), HOST_START
    for stamp, kind, step in arrivals:
        now += step
        assert mapped.host_time(stamp, kind, now) <= now
