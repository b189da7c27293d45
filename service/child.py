"""One process under supervision: started, listened to, ended, and started again with back-off.

A child that has a heart must beat: within ``start_patience`` of its start (or of its last announcement; twice
that after a start that took longer), and from then on never further apart than ``patience``. One that has none
is taken at its word as long as it lives.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from service.backoff import BackOff
from service.channels import undertaking
from service.estimate import ProcessStatus

TERMINATION = 1.5
"""Seconds that a process is given to end by itself after SIGTERM."""

MOST_DOUBLINGS = 4
"""Up to 16 times the patience, for computers on which a start takes minutes."""

_NO_STANDARD_OUTPUT = 2


@dataclass(frozen=True)
class Program:
    """What a child runs.

    Attributes
    ----------
    name : str
        What logs and status call it.
    command : tuple[str, ...]
        Its arguments, the interpreter first.
    descriptors : tuple[int, ...]
        Open files that it inherits under the same numbers.
    settings : str
        Everything that it reads of the configuration: when that changes, it is started anew.
    heart : socket.socket or None
        Where its beats come out.
    patience, start_patience : float
        Seconds without a beat after which it counts as hung.
    vital : bool
        Whether the service lives by its beats: READY, WATCHDOG and the limit on failed starts.
    environment : Mapping[str, str]
        What is added to the environment.
    """

    name: str
    command: tuple[str, ...]
    descriptors: tuple[int, ...] = ()
    settings: str = ""
    heart: socket.socket | None = None
    patience: float = 5.0
    start_patience: float = 30.0
    vital: bool = False
    environment: Mapping[str, str] = field(default_factory=dict[str, str])


class Child:
    """Follows one program through its lives.

    ``state`` is ``starting`` until the first beat, ``running``, ``waiting`` (for the back-off to pass),
    ``stopping`` or ``stopped``. Times are seconds on the monotonic clock, given by the caller.
    """

    def __init__(self, program: Program) -> None:
        self.program = program
        self.state = "waiting"
        self.reason = ""
        self.restarts = 0
        self.failed_starts = 0
        """Lives in a row that ended before the first beat."""
        self._slow_starts = 0
        self.due = 0.0
        """When something is to be done about it next: start it, or end it."""
        self._process: subprocess.Popen[bytes] | None = None
        self._back_off = BackOff()
        self._healthy_since: float | None = None
        self._again = True
        self._accused = ""

    @property
    def leaving(self) -> bool:
        """Whether nothing is to be started after it."""
        return not self._again

    @property
    def alive(self) -> bool:
        """Whether there is a process that has not been reaped."""
        return self._process is not None

    @property
    def pid(self) -> int | None:
        """Number of the process under way."""
        return self._process.pid if self._process else None

    @property
    def start_patience(self) -> float:
        """Seconds within which the life under way must beat first.

        They double whenever a start was ended for being slow: ended again at the same age on a slow
        computer, it would never run, and would only take from the others.
        """
        return self.program.start_patience * 2 ** min(self._slow_starts, MOST_DOUBLINGS)

    def start(self, now: float) -> int:
        """Start a process, and return a descriptor that becomes readable when it ends (pidfd)."""
        program = self.program
        if program.heart is not None:
            _discard(program.heart)
        hidden = ("NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID")
        inherited = {name: value for name, value in os.environ.items() if name not in hidden}
        self._process = subprocess.Popen(
            program.command,
            stdin=subprocess.DEVNULL,
            stdout=_NO_STANDARD_OUTPUT,
            pass_fds=program.descriptors,
            env=inherited | dict(program.environment),
            process_group=0,  # Ctrl-C in a terminal reaches the supervisor alone, which ends things in order
        )
        self._accused = ""
        self._healthy_since = None if program.heart else now
        self.state = "starting" if program.heart else "running"
        self.due = now + self.start_patience if program.heart else float("inf")
        return os.pidfd_open(self._process.pid)

    def listen(self, now: float) -> str | None:
        """Take what the heart has said; return the last announcement, or None. Beats make it ``running``."""
        announced: str | None = None
        while self.program.heart is not None:
            try:
                datagram = self.program.heart.recv(256)
            except BlockingIOError:
                break
            announced = undertaking(datagram)
            if self.state not in ("starting", "running"):
                continue
            if announced is not None:
                self.due = now + self.start_patience
            else:
                self._beat(now)
        return announced

    def _beat(self, now: float) -> None:
        self.due = now + self.program.patience
        if self.state == "starting":
            self.state = "running"
            self.failed_starts = self._slow_starts = 0
            self._healthy_since = now

    def hung(self, now: float, why: str) -> None:
        """End it at once, because it no longer does its work."""
        self._accused = why
        self._signal(signal.SIGKILL)
        self.due = now + TERMINATION

    def end(self, now: float, successor: Program | None) -> None:
        """Ask it to end; afterwards ``successor`` is started in its place, or nothing."""
        self._again = successor is not None
        self.program = successor or self.program
        if self.alive:
            self.state = "stopping"
            self.due = now + TERMINATION
            self._signal(signal.SIGTERM)
        elif self._again:
            self.state, self.due = "waiting", now
        else:
            self.state, self.due = "stopped", float("inf")

    def could_not_start(self, now: float, why: str) -> None:
        """Take note that there is not even a process; try again after the back-off."""
        self.state, self.reason = "waiting", why
        self.failed_starts += 1
        self.due = now + self._back_off.failed(0.0)

    def kill(self) -> None:
        """End it for good, without asking."""
        self._signal(signal.SIGKILL)
        self.due = float("inf")

    def ended(self, now: float) -> str:
        """Reap it after its descriptor said that it has ended; return how it ended."""
        process, self._process = self._process, None
        how = _ending(process.wait() if process else 0)
        if self.state == "stopping":
            self.state, self.due = ("waiting", now) if self._again else ("stopped", float("inf"))
            return how
        if self.state == "starting":
            self.failed_starts += 1
            self._slow_starts += bool(self._accused)
        lived = 0.0 if self._healthy_since is None else now - self._healthy_since
        self.state = "waiting"
        self.reason = self._accused or how
        self.restarts += 1
        self.due = now + self._back_off.failed(lived)
        return how

    def status(self) -> ProcessStatus:
        """Return what the service says about it."""
        pid = self.pid
        return ProcessStatus(
            self.program.name,
            pid,
            self.state,
            self.restarts,
            self.reason,
            resident_bytes(pid) if pid else None,
        )

    def _signal(self, number: signal.Signals) -> None:
        if self._process is not None:
            self._process.send_signal(number)


def resident_bytes(pid: int) -> int | None:
    """Return how much memory a process holds; None when it has gone."""
    try:
        pages = Path(f"/proc/{pid}/statm").read_text().split()[1]
    except (OSError, IndexError):
        return None
    return int(pages) * os.sysconf("SC_PAGE_SIZE")


def _discard(heart: socket.socket) -> None:
    """Forget what an earlier life has said."""
    while True:
        try:
            heart.recv(256)
        except BlockingIOError:
            return


def _ending(status: int) -> str:
    if status >= 0:
        return f"exit status {status}"
    try:
        return f"killed by {signal.Signals(-status).name}"
    except ValueError:
        return f"killed by signal {-status}"
