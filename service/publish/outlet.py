"""What a session offers once it is open: the declared publishers, the queryables, the liveliness token.

There are no callbacks: an undrained or slow callback can stall or hang a whole session, so queries wait
in ring channels until :meth:`Outlet.answer` polls them.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Protocol

import msgspec
import zenoh
import zenoh.ext

from service.publish.inbox import Value
from service.publish.session import Opened, close
from service.publish.topics import HEALTH, HISTORY, JSON, LIVE, QUERIES, TOPICS, Keys, Topic

Answer = Callable[[], bytes]
"""Makes the JSON of one answer, or raises :class:`RefusedError`."""

Request = Callable[[bytes], bytes]
"""Takes what the payload of a query asks for and makes the JSON of the answer, or raises :class:`RefusedError`."""

Reply = Callable[[bytes], None]
Refuse = Callable[[str], None]
Slow = Callable[[Mapping[str, str], Reply, Refuse], None]
"""Begins what the parameters of a query ask for, or raises :class:`RefusedError`; one of the others is called later."""

_WAITING_QUERIES = 64


class RefusedError(Exception):
    """A query that cannot be answered; the text is the reason, as the asker reads it."""


class _Publisher(Protocol):
    def put(self, payload: bytes, *, attachment: bytes | None = None) -> None: ...


class Outlet:
    """Everything declared on one open session.

    Parameters
    ----------
    opened : Opened
        The session; it is closed with the outlet.
    keys : Keys
        Whose keys.
    answers : dict[str, Answer]
        What each of :data:`~service.publish.topics.QUERIES` answers.
    requests : dict[str, Request], optional
        What takes each of those that ask for something.
    slow : dict[str, Slow], optional
        What begins each of those whose answer takes its time.
    """

    def __init__(
        self,
        opened: Opened,
        keys: Keys,
        answers: dict[str, Answer],
        requests: dict[str, Request] | None = None,
        slow: dict[str, Slow] | None = None,
    ) -> None:
        self._opened = opened
        self._keys = keys
        self._answers = answers
        self._requests = requests or {}
        self._slow = slow or {}
        session = opened.session
        self._publishers = {topic.key: _declare(session, keys, topic) for topic in TOPICS}
        self._queryables = {
            key: session.declare_queryable(keys.of(key), _ring(), complete=True)
            for key in (*QUERIES, *self._requests, *self._slow)
        }
        self._token = session.liveliness().declare_token(keys.of(LIVE))

    @property
    def place(self) -> str:
        """How the session stands, in words."""
        return self._opened.place

    def orphaned(self) -> bool:
        """Tell whether the hub that this session depends on has gone and its port is free."""
        return self._opened.orphaned()

    def put(self, value: Value) -> float:
        """Publish one value and return the seconds it took. Never blocks: Zenoh drops what does not fit.

        Raises
        ------
        zenoh.ZError
            The session does not take it.
        """
        publisher = self._publishers[value.topic]
        start = time.perf_counter()
        publisher.put(value.payload, attachment=value.attachment)
        return time.perf_counter() - start

    def answer(self) -> None:
        """Answer every query that waits.

        Raises
        ------
        zenoh.ZError
            The session does not take the reply.
        """
        for key, queryable in self._queryables.items():
            while (query := queryable.try_recv()) is not None:
                if key in self._slow:
                    self._begin(key, query)
                else:
                    with query:
                        self._reply(key, query)

    def close(self, seconds: float) -> bool:
        """Close the session and its liveliness token within ``seconds``; tell whether it is closed."""
        return close(self._opened.session, seconds)

    def _reply(self, key: str, query: zenoh.Query) -> None:
        try:
            query.reply(self._keys.of(key), self._made(key, query), encoding=JSON)
        except RefusedError as refusal:
            query.reply_err(msgspec.json.encode({"reason": str(refusal)}), encoding=JSON)

    def _begin(self, key: str, query: zenoh.Query) -> None:
        """Begin an answer; the query is kept open until it is there."""

        def reply(payload: bytes) -> None:
            with query:
                query.reply(self._keys.of(key), payload, encoding=JSON)

        def refuse(reason: str) -> None:
            with query:
                query.reply_err(msgspec.json.encode({"reason": reason}), encoding=JSON)

        try:
            self._slow[key](_parameters(query), reply, refuse)
        except RefusedError as refusal:
            refuse(str(refusal))

    def _made(self, key: str, query: zenoh.Query) -> bytes:
        if key not in self._requests:
            return self._answers[key]()
        return self._requests[key](b"" if query.payload is None else query.payload.to_bytes())


def _parameters(query: zenoh.Query) -> dict[str, str]:
    """Return what stands behind the question mark of a selector, ``name=value;name=value``."""
    parts = (part.partition("=") for part in str(query.parameters).split(";") if part)
    return {name: value for name, _, value in parts}


def _ring() -> zenoh.handlers.RingChannel[zenoh.Query]:
    return zenoh.handlers.RingChannel(_WAITING_QUERIES)


def _declare(session: zenoh.Session, keys: Keys, topic: Topic) -> _Publisher:
    if topic is HEALTH:
        # No heart-beat of the sequence: Zenoh sends those blocking. Gaps are found by the subscriber's
        # own queries.
        return zenoh.ext.declare_advanced_publisher(
            session,
            keys.of(topic.key),
            encoding=topic.encoding,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=topic.priority,
            express=False,
            cache=zenoh.ext.CacheConfig(HISTORY),
            sample_miss_detection=zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=None),
            publisher_detection=True,
        )
    return session.declare_publisher(
        keys.of(topic.key),
        encoding=topic.encoding,
        congestion_control=zenoh.CongestionControl.DROP,
        priority=topic.priority,
        express=False,
    )
