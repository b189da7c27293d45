"""The supervisor: the service's main process, that starts, watches, restarts, answers systemd, and stops.

It does no other work. One thread, one wait: for the end of a child (pidfd), for its beats, for a signal, or
for the next thing that is due.
"""

from __future__ import annotations

import contextlib
import logging
import os
import selectors
import signal
import socket
import time
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import Protocol

import msgspec

from service.channels import PROCESSES, Outlet
from service.child import Child, Program, resident_bytes
from service.config import ConfigurationError
from service.estimate import ProcessStatus
from service.journal import write_log
from service.notify import Notifier
from service.wiring import Wiring

START_LIMIT = 5
"""Failed starts in a row of the vital process after which the service gives up."""

WATCHDOG_MARGIN = 2.0
"""Seconds by which systemd is at least more patient with the service than the service is with the loop."""

STATUS_PERIOD = 1.0
UNREAD = 5.0
"""Seconds that the publisher may leave its queue full before it counts as hung."""

_LAST_WAIT = 0.3
_log = logging.getLogger(__name__)


class Plan(Protocol):
    """What is to run, and where its status goes."""

    @property
    def publisher(self) -> str:
        """Name of the program that reads ``statuses``."""
        ...

    @property
    def statuses(self) -> Outlet:
        """Queue to the publisher."""
        ...

    def programs(self) -> Sequence[Program]:
        """Return what is to run now, in the order of starting."""
        ...

    def reload(self) -> None:
        """Read the configuration again; what :meth:`programs` returns may be different afterwards.

        Raises
        ------
        ConfigurationError
            The new one is wrong; the old one stays.
        """
        ...

    def call(self) -> None:
        """Ask the loop to say again what it says only on change: there is a new publisher."""
        ...


class Supervisor:
    """Runs a plan until SIGTERM or SIGINT.

    Parameters
    ----------
    plan : Plan
        What to run.
    notifier : Notifier
        Line to systemd.
    """

    def __init__(self, plan: Plan, notifier: Notifier) -> None:
        self._plan = plan
        self._notifier = notifier
        self._selector = selectors.DefaultSelector()
        self._children: dict[str, Child] = {}
        self._stopping = False
        self._exit_status = 0
        self._ready = False
        self._kept = ""
        self._said = ""
        self._status_due = 0.0
        self._read = time.monotonic()
        self._unread = False
        self._patient_until = 0.0
        """Until then a publisher that leaves its queue full may be one that has not started reading."""

    def run(self) -> int:
        """Supervise until told to stop; return the exit status: 0, or 1 when the loop cannot be started."""
        with self._signals():
            try:
                self._adopt()
                while not self._stopping:
                    self._step()
            finally:
                self._stop_all()
        return self._exit_status

    # --- waiting --------------------------------------------------------------------------------

    @contextlib.contextmanager
    def _signals(self) -> Generator[None]:
        reader, writer = socket.socketpair()
        reader.setblocking(False)
        writer.setblocking(False)
        before = signal.set_wakeup_fd(writer.fileno())  # first: a signal that comes from now on is not lost
        handlers = {
            number: signal.signal(number, _noted) for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
        }
        self._selector.register(reader, selectors.EVENT_READ)
        try:
            yield
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)
            signal.set_wakeup_fd(before)
            self._selector.close()
            reader.close()
            writer.close()

    def _step(self) -> None:
        """Wait for whatever comes next, and deal with it."""
        due = min([self._status_due, *(child.due for child in self._children.values())])
        self._dispatch(max(0.0, due - time.monotonic()))
        now = time.monotonic()
        for child in list(self._children.values()):
            if now >= child.due:
                self._attend(child, now)
        if now >= self._status_due:
            self._say_status(now)

    def _dispatch(self, timeout: float) -> None:
        for key, _ in self._selector.select(timeout):
            if not isinstance(key.data, Child):
                self._obey(key.fileobj)
            elif key.fileobj is key.data.program.heart:
                self._listen(key.data)
            elif isinstance(key.fileobj, int):
                self._bury(key.data, key.fileobj)

    def _obey(self, signals: object) -> None:
        assert isinstance(signals, socket.socket)
        for number in signals.recv(64):
            if number == signal.SIGHUP:
                if not self._stopping:
                    self._reload()
            else:
                _log.info("%s: stopping", signal.Signals(number).name)
                self._stopping = True

    # --- children -------------------------------------------------------------------------------

    def _adopt(self) -> None:
        """Bring the children into line with the plan: start the new, end the old, renew the changed."""
        now = time.monotonic()
        programs = {program.name: program for program in self._plan.programs()}
        for name in set(self._children) - set(programs):
            self._children[name].end(now, None)
            if not self._children[name].alive:
                del self._children[name]
        for name, program in programs.items():
            child = self._children.get(name)
            if child is None:
                self._children[name] = Child(program)
            elif child.leaving or child.program.settings != program.settings:
                child.end(now, program)
            else:
                child.program = program
        self._status_due = now

    def _attend(self, child: Child, now: float) -> None:
        """Do what is due: start it, kill it when it would not end, or end it because it hangs."""
        name = child.program.name
        if child.state == "waiting":
            self._start(child, now)
        elif child.state == "stopping":
            _log.warning("%s: did not end within its time, killed", name)
            child.kill()
        else:
            patience = child.program.patience if child.state == "running" else child.start_patience
            _log.warning("%s: no sign of life for %g s, killed", name, patience)
            child.hung(now, f"hung: no sign of life for {patience:g} s")
        self._status_due = now

    def _start(self, child: Child, now: float) -> None:
        name = child.program.name
        try:
            descriptor = child.start(now)
        except OSError as error:
            child.could_not_start(now, f"cannot be started: {error}")
            _log.error("%s: cannot be started: %s", name, error)
            self._stand_by(child, now)
            return
        self._selector.register(descriptor, selectors.EVENT_READ, child)
        if child.program.heart is not None:
            self._selector.register(child.program.heart, selectors.EVENT_READ, child)
        if child.program.vital and self._notifier.watchdog_period:
            self._notifier.watchdog_within(child.start_patience)
        if name == self._plan.publisher:
            # the queue may be full already, or fill, before it has started and reads
            self._patient_until = now + child.start_patience
            self._plan.call()

    def _listen(self, child: Child) -> None:
        now = time.monotonic()
        was_running = child.state == "running"
        announced = child.listen(now)
        if announced and child.program.vital and not self._ready:
            self._notifier.status(announced)
        if child.state != "running":
            return
        if not was_running:
            self._status_due = now
            _log.info("%s: running, process %s", child.program.name, child.pid)
        if child.program.vital:
            self._pass_on_beat(child, was_running)

    def _pass_on_beat(self, child: Child, was_running: bool) -> None:
        if not was_running and self._notifier.watchdog_period:
            # the loop that hangs is ours to replace, before systemd replaces all
            patience = max(self._notifier.watchdog_period, child.program.patience + WATCHDOG_MARGIN)
            self._notifier.watchdog_within(patience)
        if not self._ready:
            self._ready = True
            self._notifier.ready()
        self._notifier.watchdog()

    def _bury(self, child: Child, descriptor: int) -> None:
        """Take note of the end of a child."""
        self._selector.unregister(descriptor)
        os.close(descriptor)
        if child.program.heart is not None:
            self._selector.unregister(child.program.heart)
        now = time.monotonic()
        expected = child.state == "stopping"
        how = child.ended(now)
        self._status_due = now
        name = child.program.name
        if child.state == "stopped":
            del self._children[name]
        elif not expected:
            _log.warning("%s: %s; starting again in %.1f s", name, how, child.due - now)
            self._stand_by(child, now)

    def _stand_by(self, child: Child, now: float) -> None:
        """While the vital one waits to be started: keep systemd waiting, too, or give up after many failures."""
        if not child.program.vital:
            return
        if self._notifier.watchdog_period:  # the back-off may be longer than it
            self._notifier.watchdog_within(child.due - now + self._notifier.watchdog_period)
        if child.failed_starts >= START_LIMIT:
            name = child.program.name
            _log.error("%s: %d starts in a row failed (%s): giving up", name, START_LIMIT, child.reason)
            self._exit_status = 1
            self._stopping = True

    # --- the outside ----------------------------------------------------------------------------

    def _reload(self) -> None:
        self._notifier.reloading()
        try:
            self._plan.reload()
        except ConfigurationError as error:
            self._kept = f"kept the old configuration: {error}"
            for line in str(error).splitlines():
                _log.error("SIGHUP: %s", line)
            _log.error("SIGHUP: kept the old configuration")
            if self._ready:
                self._notifier.ready()
        else:
            self._kept = ""
            _log.info("SIGHUP: took the new configuration")
            self._adopt()
            renewed = any(
                child.program.vital and child.state != "running" for child in self._children.values()
            )
            self._ready = not renewed
            if self._ready:
                self._notifier.ready()
        self._status_due = time.monotonic()

    def _say_status(self, now: float) -> None:
        """Tell the publisher every second, and systemd when the words have changed."""
        self._status_due = now + STATUS_PERIOD
        statuses = [child.status() for child in self._children.values()]
        if self._ready or self._kept:
            words = self._kept + "; " * bool(self._kept) + _in_words(statuses)
            if words != self._said:
                self._said = words
                self._notifier.status(words)
        own = ProcessStatus("supervisor", os.getpid(), "running", 0, self._kept, resident_bytes(os.getpid()))
        if self._plan.statuses.send(PROCESSES + msgspec.json.encode([own, *statuses])):
            if self._unread:
                self._patient_until = now  # it has made room: it reads
            self._read, self._unread = now, False
            return
        self._unread = True
        if now > max(self._read + UNREAD, self._patient_until):
            self._publisher_hangs(now)

    def _publisher_hangs(self, now: float) -> None:
        child = self._children.get(self._plan.publisher)
        if child is not None and child.state == "running":
            _log.warning("%s: has not read for %g s, killed", child.program.name, UNREAD)
            child.hung(now, f"hung: has not read for {UNREAD:g} s")
            self._read = now

    def _stop_all(self) -> None:
        """End every child; what has not ended after its time is killed."""
        self._notifier.stopping()
        now = time.monotonic()
        for child in self._children.values():
            child.end(now, None)
        until = now + _LAST_WAIT + max((child.due - now for child in self._living()), default=0.0)
        while self._living() and time.monotonic() < until:
            due = min(child.due for child in self._living())
            self._dispatch(max(0.0, min(due, until) - time.monotonic()))
            for child in self._living():
                if time.monotonic() >= child.due:
                    _log.warning("%s: did not end within its time, killed", child.program.name)
                    child.kill()
        for child in self._living():
            _log.error("%s: process %s cannot be ended", child.program.name, child.pid)

    def _living(self) -> list[Child]:
        return [child for child in self._children.values() if child.alive]


def _noted(_signal: int, _frame: object) -> None:
    """Let a signal through to the wake-up descriptor."""


def run(path: Path, decisions: Path | None = None, recording: Path | None = None) -> int:
    """Run the daemon that a configuration file describes, until SIGTERM; return the exit status.

    Parameters
    ----------
    path : Path
        The configuration file.
    decisions : Path, optional
        Where the decision log goes.
    recording : Path, optional
        Where the recording of the run goes.

    Raises
    ------
    ConfigurationError
        The file is wrong.
    """
    write_log()
    with contextlib.closing(Wiring(path, decisions, recording)) as wiring:
        return Supervisor(wiring, Notifier()).run()


def _in_words(statuses: Sequence[ProcessStatus]) -> str:
    """Return one line: how many run, and of the others what is wrong."""
    running = [status.name for status in statuses if status.state == "running"]
    others = [
        f"{status.name} {status.state}" + (f" ({status.reason})" if status.reason else "")
        for status in statuses
        if status.state != "running"
    ]
    return "; ".join([f"running: {', '.join(running)}", *others])
