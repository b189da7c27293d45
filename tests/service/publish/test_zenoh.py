"""The publishing process as it runs: real datagrams in, a real session, and plain clients."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Callable
from itertools import pairwise

import jsonschema
import msgspec
import numpy as np
import pytest
import zenoh

from service.estimate import HealthState, Status
from service.publish.session import Opened, SessionError
from service.publish.topics import QUERIES, REQUESTS, TOPICS
from service.publish.zenoh import Publisher
from tests.service.publish.conftest import Daemon
from tests.service.publish.spoken import (
    budget,
    cloud,
    configured,
    density,
    estimate,
    health,
    hypotheses,
    processes,
    sensors,
    tagged,
    wait_for,
)

Start = Callable[..., Daemon]
Client = Callable[[], zenoh.Session]

ROOT = "beliefd/v1/mower/"


def answer(session: zenoh.Session, key: str) -> zenoh.Reply:
    """Return the one reply to a query."""
    (reply,) = list(session.get(ROOT + key, timeout=5.0))
    return reply


def answered(session: zenoh.Session, key: str) -> bytes:
    """Return the payload of the one good reply, waiting until the daemon has declared it."""

    def _try() -> bytes | None:
        replies = [reply.ok for reply in session.get(ROOT + key, timeout=5.0)]
        return replies[0].payload.to_bytes() if replies and replies[0] is not None else None

    payload = wait_for(_try)
    assert isinstance(payload, bytes)
    return payload


def status(session: zenoh.Session) -> Status:
    """Return what the daemon says of itself."""
    return msgspec.json.decode(answered(session, "@rpc/status"), type=Status)


def test_a_session_that_cannot_be_had_is_tried_ever_more_rarely() -> None:
    """The waits between five attempts double from 0.1 s, however long the machine has been up."""
    attempts: list[float] = []

    def refuse() -> Opened:
        attempts.append(time.monotonic())
        raise SessionError("the port is taken")

    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    with ours, theirs:
        publisher = Publisher(configured(), theirs, refuse)
        while len(attempts) < 5:
            publisher.step()
    waits = [later - earlier for earlier, later in pairwise(attempts)]
    assert all(wait >= 0.1 * 2**index for index, wait in enumerate(waits)), waits


def test_every_key_arrives_as_it_is_declared(start: Start, client: Client, endpoint: str) -> None:
    """A wildcard subscriber sees all seven topics, byte for byte, with encoding, priority and attachment."""
    daemon = start(endpoint)
    session = client()
    subscriber = session.declare_subscriber(ROOT + "**", zenoh.handlers.RingChannel(1000))
    rows = np.arange(12, dtype=np.float32).reshape(3, 4)
    sent = {
        "estimate": tagged(b"E", estimate(1)),
        "budget": tagged(b"B", budget()),
        "sensors": tagged(b"S", sensors()),
        "health": tagged(b"H", health(HealthState.TRACKING, "ranges agree")),
        "particles": cloud(rows, time=1234.5),
        "hypotheses": tagged(b"Y", hypotheses()),
    }
    seen: dict[str, zenoh.Sample] = {}

    def _all_seen() -> bool:
        daemon.send(*sent.values())
        while (sample := subscriber.try_recv()) is not None:
            seen[str(sample.key_expr).removeprefix(ROOT)] = sample
        time.sleep(0.02)
        return set(seen) == {topic.key for topic in TOPICS}

    wait_for(_all_seen)
    for topic in TOPICS:
        sample = seen[topic.key]
        assert str(sample.encoding) == topic.encoding
        assert sample.priority == topic.priority
        assert sample.congestion_control == zenoh.CongestionControl.DROP
        assert sample.express is False
        assert sample.timestamp is not None
    for key in ("estimate", "budget", "sensors", "health", "hypotheses"):
        assert seen[key].payload.to_bytes() == sent[key][1:]
        assert seen[key].attachment is None
    assert seen["estimate/slow"].payload == seen["estimate"].payload
    attachment = seen["particles"].attachment
    assert attachment is not None
    assert json.loads(attachment.to_bytes()) == {
        "count": 3,
        "time": 1234.5,
        "columns": ["north", "east", "heading", "weight"],
    }
    received = np.frombuffer(seen["particles"].payload.to_bytes(), "<f4").reshape(-1, 4)
    np.testing.assert_array_equal(received, rows)


def test_the_slow_estimate_is_at_most_five_a_second(start: Start, client: Client, endpoint: str) -> None:
    daemon = start(endpoint)
    session = client()
    slow = session.declare_subscriber(ROOT + "estimate/slow", zenoh.handlers.RingChannel(1000))

    def _first() -> zenoh.Sample | None:
        daemon.send(tagged(b"E", estimate(0)))
        time.sleep(0.01)
        return slow.try_recv()

    wait_for(_first)
    begin, count = time.monotonic(), 0
    while time.monotonic() - begin < 2.0:
        daemon.send(tagged(b"E", estimate(1)))
        time.sleep(0.01)
        while slow.try_recv() is not None:
            count += 1
    elapsed = time.monotonic() - begin
    assert 1 <= count <= elapsed / 0.2 + 2


def test_queries_are_answered(start: Start, client: Client, endpoint: str) -> None:
    daemon = start(endpoint)
    session = client()
    daemon.send(
        tagged(b"E", estimate(7)),
        tagged(b"B", budget()),
        tagged(b"S", sensors()),
        tagged(b"H", health(HealthState.LOST, "no range for 30 s")),
        tagged(b"R", processes()),
    )
    assert answered(session, "@rpc/latest") == msgspec.json.encode(estimate(7))
    told = status(session)
    assert told.vehicle == "mower"
    assert told.health == health(HealthState.LOST, "no range for 30 s")
    assert told.budget == budget()
    assert told.sensors == sensors()
    assert told.processes == processes()
    assert told.publishing is not None
    assert told.publishing.opened == 1
    configuration = json.loads(answered(session, "@rpc/config"))
    assert configuration["vehicle"]["name"] == "mower"
    assert configuration["link"][0]["url"] == "udpin:127.0.0.1:14550"
    assert configuration["loop"]["rate"] == 50.0
    reply = answer(session, "@rpc/latest").ok
    assert reply is not None
    assert str(reply.encoding) == "application/json"


def test_a_query_without_an_answer_says_why(start: Start, client: Client, endpoint: str) -> None:
    start(endpoint)
    session = client()
    assert status(session).processes == []
    reply = answer(session, "@rpc/latest")
    assert reply.ok is None
    assert reply.err is not None
    assert json.loads(reply.err.payload.to_bytes()) == {"reason": "no estimate yet: the loop has not ticked"}


def test_a_value_that_was_not_understood_is_said(start: Start, client: Client, endpoint: str) -> None:
    daemon = start(endpoint)
    session = client()
    status(session)
    daemon.send(b'B{"time": "now"}')

    def _refused() -> str | None:
        error = answer(session, "@rpc/status").err
        return None if error is None else json.loads(error.payload.to_bytes())["reason"]

    assert "the last budget was not understood" in str(wait_for(_refused))


def test_no_wildcard_fires_a_query(start: Start, client: Client, endpoint: str) -> None:
    """Verbatim chunks: ``**`` reaches none of ``@rpc``."""
    start(endpoint)
    session = client()
    status(session)
    assert list(session.get(ROOT + "**", timeout=1.0)) == []
    assert len(list(session.get(ROOT + "@rpc/*", timeout=5.0))) == len(QUERIES) + len(REQUESTS)


def test_every_value_fits_the_schema_that_is_told(start: Start, client: Client, endpoint: str) -> None:
    daemon = start(endpoint)
    session = client()
    daemon.send(tagged(b"B", budget()), tagged(b"S", sensors()), tagged(b"R", processes()))
    daemon.send(tagged(b"H", health(HealthState.WAITING, "no data")), tagged(b"E", estimate(1)))
    schema = json.loads(answered(session, "@rpc/schema"))
    unknown = estimate(2, position=(None, None, None), heading=None, radius95=None, biases={})
    values = {
        "Estimate": [json.loads(answered(session, "@rpc/latest")), msgspec.to_builtins(unknown)],
        "Status": [json.loads(answered(session, "@rpc/status"))],
        "Budget": [msgspec.to_builtins(budget())],
        "Sensors": [msgspec.to_builtins(sensors())],
        "Health": [msgspec.to_builtins(health(HealthState.LOST, "why"))],
        "Hypotheses": [msgspec.to_builtins(hypotheses())],
        "Density": [msgspec.to_builtins(density())],
        "Cloud": [{"count": 3, "time": 0.5, "columns": ["north", "east", "heading", "weight"]}],
    }
    assert set(values) == set(schema["values"])
    for name, examples in values.items():
        validator = jsonschema.Draft202012Validator({**schema, **schema["values"][name]})
        for example in examples:
            validator.validate(json.loads(msgspec.json.encode(example)))
    wrong = {**values["Estimate"][0], "position": "here"}
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(wrong, {**schema, **schema["values"]["Estimate"]})


def test_a_late_joiner_gets_the_history_of_health(start: Start, client: Client, endpoint: str) -> None:
    """The last fifty changes, in order, and none of an earlier time."""
    daemon = start(endpoint)
    session = client()
    changes = [health(HealthState.TRACKING, f"change {number}", float(number)) for number in range(60)]
    for change in changes:
        daemon.send(tagged(b"H", change))
    wait_for(lambda: (p := status(session).publishing) is not None and p.published.get("health") == 60)
    late = client()
    subscriber = zenoh.ext.declare_advanced_subscriber(
        late,
        ROOT + "health",
        zenoh.handlers.RingChannel(100),
        history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=50),
    )
    got: list[bytes] = []

    def _all() -> bool:
        while (sample := subscriber.try_recv()) is not None:
            got.append(sample.payload.to_bytes())
        return len(got) >= 50

    wait_for(_all)
    assert got == [msgspec.json.encode(change) for change in changes[-50:]]


def test_liveliness_is_seen_and_gone_with_a_clean_stop(start: Start, client: Client, endpoint: str) -> None:
    daemon = start(endpoint)
    session = client()
    token = session.liveliness().declare_subscriber(
        "beliefd/v1/*/@live", zenoh.handlers.RingChannel(10), history=True
    )
    appeared = wait_for(token.try_recv)
    assert isinstance(appeared, zenoh.Sample)
    assert (appeared.kind, str(appeared.key_expr)) == (zenoh.SampleKind.PUT, ROOT + "@live")
    assert daemon.stop() == 0
    gone = wait_for(token.try_recv)
    assert isinstance(gone, zenoh.Sample)
    assert (gone.kind, str(gone.key_expr)) == (zenoh.SampleKind.DELETE, ROOT + "@live")
    log = daemon.log.read_text()
    assert "publishing beliefd/v1/mower/**" in log
    assert "Traceback" not in log
