"""``beliefd listen``: a subscriber in the terminal; in a pipe, one line of JSON for each slow estimate."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator

import zenoh
from rich.console import Console
from rich.live import Live

from service.publish.session import LOOPBACK, SessionError, close, open_client
from service.publish.topics import PREFIX, SLOW, Keys
from service.view.feed import Feed, vehicles
from service.view.known import Known
from service.view.panel import Screen

WRONG_USE = 2

_PATIENCE = 5.0
_RETRY = 0.5
_FRAME = 0.125
_CLOSING = 1.0
_PIPE = 0.05


def run(vehicle: str | None, router: str | None, prefix: str = PREFIX) -> int:
    """Show what a vehicle publishes until Ctrl-C; return the exit status.

    Parameters
    ----------
    vehicle : str or None
        Its name; without it the only one that is alive.
    router : str or None
        Zenoh endpoint to connect to (``tcp/192.168.1.7:7447``); without it the daemon on this machine.
    prefix : str
        As ``publish.prefix`` of the daemon.

    Notes
    -----
    Nobody listening yet, or no vehicle alive, is waited for, and said after five seconds.
    """
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # the terminal is put right again in any case
    endpoint = router or LOOPBACK
    session: zenoh.Session | None = None
    status = 0
    try:
        if vehicle is not None:
            Keys(prefix, vehicle)
        session = _connected(endpoint)
        name = vehicle or _only(session, endpoint, prefix)
        feed, known = Feed(session, Keys(prefix, name)), Known(name)
        if sys.stdout.isatty():
            _show(feed, known, endpoint)
        else:
            _pipe(feed, known, endpoint)
    except ValueError as error:
        _say(str(error))
        status = WRONG_USE
    except BrokenPipeError:  # whoever read us has gone, as `| head` does; the interpreter still flushes
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except KeyboardInterrupt:
        pass  # the way to end it
    if session is not None and not close(session, _CLOSING):
        sys.stdout.flush()
        os._exit(status)  # a stalled session would hang the interpreter's exit
    return status


def _connected(endpoint: str) -> zenoh.Session:
    if "/" not in endpoint:
        raise ValueError(
            f"--router {endpoint}: an endpoint is written protocol/host:port, as tcp/192.168.1.7:7447"
        )
    reminder = _Reminder(
        f"nobody answers at {endpoint}: is `beliefd run` started there? "
        "Another place is named with --router tcp/HOST:PORT. Waiting."
    )
    while True:
        try:
            return open_client(endpoint)
        except SessionError:
            reminder.due()
            time.sleep(_RETRY)


def _only(session: zenoh.Session, endpoint: str, prefix: str) -> str:
    reminder = _Reminder(
        f"connected to {endpoint}, but no vehicle is alive under {prefix}/: its daemon may be starting, "
        "or publish under another prefix. Waiting."
    )
    while True:
        names = vehicles(session, prefix)
        if len(names) > 1:
            raise ValueError(f"several vehicles are alive, name one of them: {', '.join(names)}")
        if names:
            return names[0]
        reminder.due()
        time.sleep(_RETRY)


def _show(feed: Feed, known: Known, endpoint: str) -> None:
    with Live(Screen(known, endpoint), screen=True, auto_refresh=False, console=Console()) as live:
        configured = False
        while True:
            deadline = time.monotonic() + _FRAME
            for topic, payload in feed.poll():
                known.take(topic, payload)
            if feed.alive and not configured and (answer := feed.configuration()) is not None:
                known.configured(answer)
                configured = True
            live.update(Screen(known, _standing(feed, known, endpoint)), refresh=True)
            time.sleep(max(0.0, deadline - time.monotonic()))


def _standing(feed: Feed, known: Known, endpoint: str) -> str:
    if known.silence() is None:
        return "alive, but nothing arrives" if feed.alive else f"not alive at {endpoint}"
    return f"{known.rate():.0f} Hz from {endpoint}"


def _pipe(feed: Feed, known: Known, endpoint: str) -> None:
    reminder = _Reminder("")
    for topic, payload in _arrivals(feed):
        if topic == SLOW.key:
            sys.stdout.write(payload.decode() + "\n")
            sys.stdout.flush()
            reminder = _Reminder("")
        elif topic == "":
            state = "is alive, but sends no estimate" if feed.alive else "is not alive"
            reminder.text = f"{known.vehicle} {state} at {endpoint}. Waiting."
            reminder.due()


def _arrivals(feed: Feed) -> Iterator[tuple[str, bytes]]:
    """Yield what arrives, and an empty topic whenever nothing has."""
    while True:
        arrived = feed.poll()
        yield from arrived or [("", b"")]
        time.sleep(_PIPE)


class _Reminder:
    """Says something once, when the patience is over."""

    def __init__(self, text: str) -> None:
        self.text = text
        self._at = time.monotonic() + _PATIENCE
        self._said = False

    def due(self) -> None:
        """Say it if it is time and it has not been said."""
        if not self._said and time.monotonic() >= self._at:
            self._said = True
            _say(self.text)


def _say(text: str) -> None:
    sys.stderr.write(f"beliefd listen: {text}\n")
    sys.stderr.flush()
