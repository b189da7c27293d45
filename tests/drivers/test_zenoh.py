"""Foreign samples over real Zenoh sessions on loopback; the port is chosen by the operating system."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import zenoh

from drivers.link import Link, LinkError
from drivers.sample import Heading, Range, Sample
from drivers.zenoh import MOST_SENSORS, ZenohLink, ZenohSettings

ROOT = "beliefd/v1/mower"
RANGE = b'{"kind": "range", "beacon": 5, "distance": 12.5}'


@pytest.fixture
def endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def session(**settings: object) -> zenoh.Session:
    quiet = {
        "scouting": {"multicast": {"enabled": False}},
        "transport": {"shared_memory": {"enabled": False}},
    }
    return zenoh.open(zenoh.Config.from_json5(json.dumps({**quiet, **settings})))


def hub(endpoint: str) -> zenoh.Session:
    """The publishing process: a peer that listens."""
    return session(mode="peer", listen={"endpoints": [endpoint]})


@pytest.fixture
def listening(endpoint: str) -> Iterator[zenoh.Session]:
    with hub(endpoint) as opened:
        yield opened


@pytest.fixture
def link(endpoint: str, listening: zenoh.Session) -> Iterator[ZenohLink]:
    opened = ZenohLink("uwb", ZenohSettings(ROOT, endpoint=endpoint))
    opened.open()
    yield opened
    opened.close()


@pytest.fixture
def foreigner(endpoint: str, listening: zenoh.Session) -> Iterator[zenoh.Session]:
    """A node of somebody else's, which knows nothing but the endpoint and the key."""
    with session(mode="client", connect={"endpoints": [endpoint]}) as opened:
        yield opened


def wait(condition: Callable[[], bool], seconds: float = 10.0) -> None:
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until, f"not within {seconds} s"
        time.sleep(0.005)


def publish(node: zenoh.Session, *payloads: bytes, sensor: str = "uwb") -> None:
    """Put, once the subscription is known at this end."""
    publisher = node.declare_publisher(f"{ROOT}/sample/{sensor}")
    wait(lambda: publisher.matching_status.matching)
    for payload in payloads:
        publisher.put(payload)


def collect(link: ZenohLink, count: int, seconds: float = 10.0) -> list[Sample]:
    samples: list[Sample] = []
    until = time.monotonic() + seconds
    while len(samples) < count and time.monotonic() < until:
        samples += link.poll(0.1)
    return samples


def test_a_foreign_sample_becomes_a_sample(link: ZenohLink, foreigner: zenoh.Session) -> None:
    as_link: Link = link
    before = time.monotonic_ns()
    publish(foreigner, RANGE)
    (sample,) = collect(link, 1)
    assert sample.reading == Range(beacon=5, distance=12.5)
    assert (sample.link, sample.source) == ("uwb", "sample/uwb")
    assert before < sample.time == sample.received <= time.monotonic_ns()
    report = as_link.report()
    assert (report.state, report.messages, report.samples, report.opened) == ("up", 1, 1, 1)


def test_its_time_is_mapped(link: ZenohLink, foreigner: zenoh.Session) -> None:
    stamp = time.time() - 5.0
    publish(
        foreigner, json.dumps({"kind": "heading", "heading": 1.0, "time": stamp}).encode(), sensor="compass"
    )
    (sample,) = collect(link, 1)
    assert sample.reading == Heading(heading=1.0)
    assert sample.source == "sample/compass"
    lag = (sample.received - sample.time) / 1e9
    assert 5.0 <= lag < 15.0
    assert abs((time.time() - time.monotonic()) + sample.time / 1e9 - stamp) < 0.1


def test_damage_is_counted_by_sensor_and_kind(link: ZenohLink, foreigner: zenoh.Session) -> None:
    publish(
        foreigner,
        b"not json",
        b'{"kind": "sonar"}',
        b'{"kind": "range", "beacon": 5, "distance": -3.0}',
        b'{"kind": "speed", "speed": 1.0, "time": 12.5}',
        b" " * 5000,
        RANGE,
    )
    assert len(collect(link, 1)) == 1
    assert link.report().malformed == {
        "sample/uwb.bad_json": 1,
        "sample/uwb.invalid": 1,
        "sample/uwb.distance": 1,
        "sample/uwb.time": 1,
        "sample/uwb.oversize": 1,
    }


def test_a_deletion_is_no_sample(link: ZenohLink, foreigner: zenoh.Session) -> None:
    publish(foreigner, RANGE)
    foreigner.delete(f"{ROOT}/sample/uwb")
    publish(foreigner, RANGE)
    assert len(collect(link, 2)) == 2
    assert link.report().ignored == 1


def test_other_keys_stay_outside(link: ZenohLink, foreigner: zenoh.Session) -> None:
    for key in ("beliefd/v1/other/sample/uwb", f"{ROOT}/estimate", f"{ROOT}/sample/a/b"):
        foreigner.put(key, RANGE)
    publish(foreigner, RANGE)
    assert [s.source for s in collect(link, 1)] == ["sample/uwb"]
    assert not link.poll(0.05)


def test_names_from_outside_are_bounded(link: ZenohLink, foreigner: zenoh.Session) -> None:
    publish(foreigner, RANGE, sensor="first")
    for number in range(MOST_SENSORS + 5):
        foreigner.put(f"{ROOT}/sample/s{number}", RANGE)
    foreigner.put(f"{ROOT}/sample/{'x' * 100}", RANGE)
    assert len(collect(link, MOST_SENSORS)) == MOST_SENSORS
    wait(lambda: not link.poll(0.01) and link.report().malformed == {"too_many_sensors": 6, "long_name": 1})


def test_a_flood_loses_the_oldest_and_blocks_nobody(endpoint: str, listening: zenoh.Session) -> None:
    link = ZenohLink("uwb", ZenohSettings(ROOT, endpoint=endpoint, ring=16))
    link.open()
    try:
        with session(mode="client", connect={"endpoints": [endpoint]}) as node:
            publisher = node.declare_publisher(
                f"{ROOT}/sample/uwb", congestion_control=zenoh.CongestionControl.BLOCK
            )
            wait(lambda: publisher.matching_status.matching)
            for number in range(2000):
                publisher.put(f'{{"kind": "range", "beacon": {number}, "distance": 1.0}}'.encode())
            last: list[int] = []
            wait(lambda: bool(last.extend(beacons(link.poll(0.1))) or 1999 in last))
        assert last == sorted(last)
        assert len(last) < 2000
    finally:
        link.close()


def beacons(samples: list[Sample]) -> list[int]:
    return [s.reading.beacon for s in samples if isinstance(s.reading, Range)]


def test_nobody_listens_yet(endpoint: str) -> None:
    link = ZenohLink("uwb", ZenohSettings(ROOT, endpoint=endpoint))
    with pytest.raises(LinkError, match=f"uwb: no Zenoh session by {endpoint}: .*should listen there"):
        link.open()
    with pytest.raises(LinkError, match="open it first"):
        link.poll(0.0)
    assert link.report().state == "opening"
    with hub(endpoint) as later:
        link.open()
        publish(later, RANGE)
        assert len(collect(link, 1)) == 1
        link.close()


def test_the_other_end_restarts(endpoint: str) -> None:
    link = ZenohLink("uwb", ZenohSettings(ROOT, endpoint=endpoint))
    with hub(endpoint):
        link.open()
    wait(lambda: link.report().state == "retrying")
    assert "is lost" in link.report().reason
    assert link.poll(0.01) == []
    with hub(endpoint) as again:
        wait(lambda: link.report().state != "retrying", seconds=20.0)
        publish(again, RANGE)
        assert len(collect(link, 1)) == 1
        assert link.report().state == "up"
        link.close()


def test_connected_but_silent(link: ZenohLink) -> None:
    wait(lambda: link.report().state == "silent")
    assert f"{ROOT}/sample/*" in link.report().reason


@pytest.mark.parametrize("by_mode", [False, True])
def test_the_publishing_process_file_makes_a_client_of_it(
    tmp_path: Path, endpoint: str, by_mode: bool
) -> None:
    endpoints: object = {"peer": [endpoint]} if by_mode else [endpoint]
    path = tmp_path / "zenoh.json5"
    multicast = {"multicast": {"enabled": False}}
    path.write_text(json.dumps({"mode": "peer", "listen": {"endpoints": endpoints}, "scouting": multicast}))
    with zenoh.open(zenoh.Config.from_file(str(path))) as publishing:
        link = ZenohLink("uwb", ZenohSettings(ROOT, configuration=str(path)))
        link.open()
        publish(publishing, RANGE)
        assert len(collect(link, 1)) == 1
        link.close()


def test_a_wrong_file(tmp_path: Path) -> None:
    path = tmp_path / "zenoh.json5"
    with pytest.raises(LinkError, match=r"zenoh\.json5 is not a file"):
        ZenohLink("uwb", ZenohSettings(ROOT, configuration=str(path))).open()
    path.write_text("{mode: 7")
    with pytest.raises(LinkError, match="no Zenoh session by"):
        ZenohLink("uwb", ZenohSettings(ROOT, configuration=str(path))).open()


def test_closing_twice_and_opening_again(link: ZenohLink, foreigner: zenoh.Session) -> None:
    link.close()
    link.close()
    link.open()
    publish(foreigner, RANGE)
    assert len(collect(link, 1)) == 1
    assert link.report().opened == 2


def test_a_process_that_forgets_to_close_still_ends(endpoint: str, listening: zenoh.Session) -> None:
    """Zenoh hangs at exit when callbacks are alive; there are none."""
    program = (
        "from drivers.zenoh import *\n"
        f"link = ZenohLink('uwb', ZenohSettings({ROOT!r}, endpoint={endpoint!r}))\n"
        "link.open()\n"
        "link.poll(0.1)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], timeout=30, check=False, cwd=Path(__file__).parents[2]
    )
    assert done.returncode == 0
