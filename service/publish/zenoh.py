"""The publishing process: from the loop's datagrams to Zenoh, never in anybody's way.

One thread does everything: it waits for a datagram (and no longer than a query may wait), takes what has
come, puts the newest of each topic, answers the queries, and looks after the session. When there is no
session it says so, tries again with back-off, and goes on draining, so that the loop never notices.
"""

from __future__ import annotations

import logging
import os
import select
import signal
import socket
import sys
import time
from collections import deque
from collections.abc import Callable

import zenoh

from service.backoff import BackOff
from service.channels import Outlet as Queue
from service.config import Configuration
from service.publish.answers import Book, answers
from service.publish.densities import Densities
from service.publish.desk import Desk
from service.publish.inbox import PROCESSES, Inbox, Value
from service.publish.outlet import Outlet, Request
from service.publish.session import Opened, SessionError, close, open_embedded, open_from_file, plain
from service.publish.topics import DENSITY, ESTIMATE, HEALTH, HISTORY, REINITIALIZE, SLOW, Keys

log = logging.getLogger(__name__)

_QUERY_WAIT_MS = 20
_SLOW_PERIOD = 0.2
_UPKEEP_PERIOD = 1.0
_CLOSING = 1.0


def run(configuration: Configuration, estimates: socket.socket, orders: socket.socket | None = None) -> None:
    """Publish until SIGTERM.

    Parameters
    ----------
    configuration : Configuration
        Says whose keys, and which session.
    estimates : socket.socket
        The receiving end of the datagram socket pair that the loop and the supervisor write to.
    orders : socket.socket, optional
        The sending end of the one that the loop reads: what users tell the belief.

    Notes
    -----
    Leaves by :func:`os._exit` when Zenoh does not close its session within a second: a stalled peer can
    hold it for ten, and hang the interpreter's exit altogether.
    """
    stop = False

    def _stop(_signal: int, _frame: object) -> None:
        nonlocal stop
        stop = True

    signal.signal(signal.SIGTERM, _stop)
    publisher = Publisher(configuration, estimates, opener(configuration), orders)
    while not stop:
        publisher.step()
    if not publisher.close(_CLOSING):
        log.warning("the Zenoh session did not close within %g s: leaving without it", _CLOSING)
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(0)


def opener(configuration: Configuration) -> Callable[[], Opened]:
    """Return what opens the session that the configuration asks for."""
    path = configuration.publish.zenoh
    if path:
        return lambda: open_from_file(path)
    return open_embedded


class Publisher:
    """The loop of the publishing process, one :meth:`step` at a time.

    Parameters
    ----------
    configuration : Configuration
        Whose keys, and what ``@rpc/config`` answers.
    estimates : socket.socket
        Where the datagrams come from.
    open_session : callable
        Opens a session or raises :class:`~service.publish.session.SessionError`.
    orders : socket.socket, optional
        Where what users tell the belief goes; without it they are refused.
    """

    def __init__(
        self,
        configuration: Configuration,
        estimates: socket.socket,
        open_session: Callable[[], Opened],
        orders: socket.socket | None = None,
    ) -> None:
        self._open_session = open_session
        self._keys = Keys(configuration.publish.prefix, configuration.vehicle.name)
        self._inbox = Inbox(estimates)
        self._book = Book()
        self._answers = answers(configuration, self._book, self._inbox)
        desk = Desk(configuration, None if orders is None else Queue(orders))
        self._requests: dict[str, Request] = {REINITIALIZE: desk.reinitialize}
        self._densities = Densities(lambda: self._book.cloud)
        self._outlet: Outlet | None = None
        self._changes: deque[Value] = deque(maxlen=HISTORY)
        self._slow_at = 0.0
        self._upkeep_at = 0.0
        self._back_off = BackOff()
        self._opened_at = 0.0
        self._complaint = ""
        self._poll = select.poll()
        self._poll.register(estimates, select.POLLIN)

    def step(self, wait_ms: int = _QUERY_WAIT_MS) -> None:
        """Wait for a datagram, at most ``wait_ms``; publish what came, answer what was asked."""
        if time.monotonic() >= self._upkeep_at:
            self._look_after_session()
        self._poll.poll(wait_ms)
        for value in self._inbox.drain():
            self._book.note(value)
            self._publish(value)
        if self._outlet is not None:
            try:
                self._outlet.answer()
                self._densities.look_after()
            except zenoh.ZError as error:
                self._book.unsent["reply"] += 1
                log.warning("a query could not be answered: %s", plain(error))

    def close(self, seconds: float) -> bool:
        """Close the session within ``seconds``; tell whether it is closed (or there was none)."""
        outlet, self._outlet = self._outlet, None
        self._densities.close()
        return outlet is None or outlet.close(seconds)

    def _publish(self, value: Value) -> None:
        if value.topic == PROCESSES:
            return
        if value.topic == HEALTH.key:
            self._changes.append(value)
        self._put(value)
        now = time.monotonic()
        if value.topic == ESTIMATE.key and now >= self._slow_at:
            self._slow_at += _SLOW_PERIOD  # steps of the period: the mean rate holds at any rate of the loop
            if self._slow_at <= now:
                self._slow_at = now + _SLOW_PERIOD
            self._put(Value(SLOW.key, value.payload))

    def _put(self, value: Value) -> None:
        if self._outlet is None:
            self._book.unsent[value.topic] += 1
            return
        try:
            self._book.seconds.append(self._outlet.put(value))
        except zenoh.ZError as error:
            self._book.unsent[value.topic] += 1
            self._lose(plain(error))
        else:
            self._book.published[value.topic] += 1

    def _look_after_session(self) -> None:
        self._upkeep_at = time.monotonic() + _UPKEEP_PERIOD
        if self._outlet is not None and self._outlet.orphaned():
            self._lose("whoever listened has gone: taking its place")
        if self._outlet is None:
            self._open()

    def _open(self) -> None:
        try:
            opened = self._open_session()
        except SessionError as error:
            self._retry_later(str(error))
            return
        try:
            slow = {DENSITY: self._densities.ask}
            self._outlet = Outlet(opened, self._keys, self._answers, self._requests, slow)
        except zenoh.ZError as error:
            close(opened.session, _CLOSING)
            self._retry_later(plain(error))
            return
        self._opened_at = time.monotonic()
        self._complaint = ""
        self._book.session = opened.place
        self._book.opened += 1
        log.info("publishing %s, %s", self._keys.of("**"), opened.place)
        for change in self._changes:  # a new session has an empty cache: late joiners still get the history
            self._put(change)

    def _retry_later(self, reason: str) -> None:
        self._upkeep_at = time.monotonic() + self._back_off.failed(0.0)
        if reason != self._complaint:
            log.error("no Zenoh session: %s; trying again", reason)
            self._complaint = reason

    def _lose(self, reason: str) -> None:
        log.warning("the Zenoh session is given up: %s", reason)
        now = time.monotonic()
        self._upkeep_at = now + self._back_off.failed(now - self._opened_at)
        self._book.session = "not open"
        outlet, self._outlet = self._outlet, None
        if outlet is not None:
            outlet.close(_CLOSING)
