"""A subscription to one vehicle, as any client has it: polled, never blocking, nothing in callbacks."""

from __future__ import annotations

from typing import Protocol

import zenoh
import zenoh.ext

from service.publish.topics import (
    BUDGET,
    CONFIG,
    ESTIMATE,
    HEALTH,
    HISTORY,
    LIVE,
    SENSORS,
    SLOW,
    STATUS,
    Keys,
    live,
    vehicle_of,
)

_ANSWER = 2.0
_ESTIMATES = 4096
_OTHERS = 64


class _Subscriber(Protocol):
    def try_recv(self) -> zenoh.Sample | None: ...


class Feed:
    """Everything that a vehicle publishes but the cloud, and its answers.

    Parameters
    ----------
    session : zenoh.Session
        An open session; whoever opened it closes it.
    keys : Keys
        Whose.
    """

    def __init__(self, session: zenoh.Session, keys: Keys) -> None:
        self._session = session
        self._keys = keys
        self._subscribers: dict[str, _Subscriber] = {
            topic.key: session.declare_subscriber(keys.of(topic.key), _ring(size))
            for topic, size in (
                (ESTIMATE, _ESTIMATES),
                (SLOW, _OTHERS),
                (BUDGET, _OTHERS),
                (SENSORS, _OTHERS),
            )
        }
        self._subscribers[HEALTH.key] = zenoh.ext.declare_advanced_subscriber(
            session,
            keys.of(HEALTH.key),
            _ring(_OTHERS),
            history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=HISTORY),
        )
        self._alive = session.liveliness().declare_subscriber(keys.of(LIVE), _ring(_OTHERS), history=True)
        self.alive = False
        """Whether the vehicle's liveliness token stands."""

    def poll(self) -> list[tuple[str, bytes]]:
        """Return what has arrived since, as topic and payload, each topic in order."""
        while (token := self._alive.try_recv()) is not None:
            self.alive = token.kind == zenoh.SampleKind.PUT
        arrived: list[tuple[str, bytes]] = []
        for topic, subscriber in self._subscribers.items():
            while (sample := subscriber.try_recv()) is not None:
                arrived.append((topic, sample.payload.to_bytes()))
        return arrived

    def configuration(self) -> bytes | None:
        """Ask for the configuration in force; ``None`` when nobody answers."""
        return self._ask(CONFIG)

    def status(self) -> bytes | None:
        """Ask for the status; ``None`` when nobody answers."""
        return self._ask(STATUS)

    def _ask(self, key: str) -> bytes | None:
        for reply in self._session.get(self._keys.of(key), timeout=_ANSWER):
            if reply.ok is not None:
                return reply.ok.payload.to_bytes()
        return None


def vehicles(session: zenoh.Session, prefix: str) -> list[str]:
    """Return the names of the vehicles that are alive."""
    replies = session.liveliness().get(live(prefix), timeout=_ANSWER)
    return sorted({vehicle_of(prefix, str(reply.ok.key_expr)) for reply in replies if reply.ok is not None})


def _ring(size: int) -> zenoh.handlers.RingChannel[zenoh.Sample]:
    return zenoh.handlers.RingChannel(size)
