"""What the queries answer: the last estimate, the status, the configuration in force, the schema.

Answers are made from the bytes that went by; nothing is asked of the loop.
"""

from __future__ import annotations

import time
from collections import Counter, deque
from importlib.metadata import version
from typing import TypeVar

import msgspec
import numpy as np

from service.config import Configuration
from service.estimate import Budget, Health, ProcessStatus, Publishing, Sensors, StageCost, Status, schema
from service.publish.inbox import PROCESSES, Inbox, Value
from service.publish.outlet import Answer, RefusedError
from service.publish.topics import (
    BUDGET,
    CONFIG,
    ESTIMATE,
    HEALTH,
    LATEST,
    PARTICLES,
    SCHEMA,
    SENSORS,
    STATUS,
)

T = TypeVar("T")

_PUTS = 1000


class Book:
    """What the publishing process remembers: the newest value of each topic, and its own counts.

    Attributes
    ----------
    newest : dict[str, bytes]
        Payload by topic.
    cloud : Value or None
        The newest cloud, with its attachment.
    published, unsent : Counter[str]
        Values put, and values that found no session, by topic.
    seconds : deque[float]
        What the last thousand puts took.
    session : str
        How the session stands, in words.
    opened : int
        How often one was opened.
    """

    def __init__(self) -> None:
        self.newest: dict[str, bytes] = {}
        self.cloud: Value | None = None
        self.published: Counter[str] = Counter()
        self.unsent: Counter[str] = Counter()
        self.seconds: deque[float] = deque(maxlen=_PUTS)
        self.session = "not open"
        self.opened = 0
        self.started = time.time()

    def note(self, value: Value) -> None:
        """Remember a value as the newest of its topic."""
        self.newest[value.topic] = value.payload
        if value.topic == PARTICLES.key:
            self.cloud = value

    def publishing(self, inbox: Inbox) -> Publishing:
        """Return the counts as they go out with the status."""
        return Publishing(
            session=self.session,
            opened=self.opened,
            published=dict(self.published),
            superseded=dict(inbox.superseded),
            unsent=dict(self.unsent),
            malformed=dict(inbox.malformed),
            put_ms=_cost(self.seconds),
        )


def answers(configuration: Configuration, book: Book, inbox: Inbox) -> dict[str, Answer]:
    """Return what answers each query."""

    def latest() -> bytes:
        if ESTIMATE.key not in book.newest:
            raise RefusedError("no estimate yet: the loop has not ticked")
        return book.newest[ESTIMATE.key]

    def status() -> bytes:
        return msgspec.json.encode(_status(configuration, book, inbox))

    def configured() -> bytes:
        return configuration.model_dump_json().encode()

    def described() -> bytes:
        return msgspec.json.encode(schema())

    return {LATEST: latest, STATUS: status, CONFIG: configured, SCHEMA: described}


def _status(configuration: Configuration, book: Book, inbox: Inbox) -> Status:
    return Status(
        vehicle=configuration.vehicle.name,
        version=version("beliefd"),
        started=book.started,
        health=_newest(book, HEALTH.key, Health),
        budget=_newest(book, BUDGET.key, Budget),
        sensors=_newest(book, SENSORS.key, Sensors),
        processes=_newest(book, PROCESSES, list[ProcessStatus]) or [],
        publishing=book.publishing(inbox),
    )


def _newest(book: Book, topic: str, kind: type[T]) -> T | None:
    payload = book.newest.get(topic)
    if payload is None:
        return None
    try:
        return msgspec.json.decode(payload, type=kind)
    except msgspec.MsgspecError as error:
        raise RefusedError(f"the last {topic} was not understood: {error}") from error


def _cost(seconds: deque[float]) -> StageCost | None:
    if not seconds:
        return None
    median, p99, worst = np.quantile(np.array(seconds) * 1e3, (0.5, 0.99, 1.0)).tolist()
    return StageCost(median=median, p99=p99, worst=worst)
