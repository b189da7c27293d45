"""One link in a process of its own: open with back-off, poll, pass on, report.

Whatever happens in here happens to this link alone. Nothing waits for the loop: a full queue refuses, and the
samples it refused are counted in the report.
"""

from __future__ import annotations

import logging
import socket
import time

import msgspec

from drivers.link import Link, LinkError
from drivers.sample import LinkReport, SampleBatch, batches, encode
from service.backoff import BackOff
from service.channels import Heart, Outlet

REPORT_PERIOD = 1.0
STATE_PERIOD = 0.1
"""Seconds: how often the state is looked at, and the longest that a poll may wait."""

_log = logging.getLogger(__name__)


class LinkProcess:
    """Runs one link.

    Parameters
    ----------
    name : str
        As in the configuration.
    link : Link
        The driver, not yet open.
    samples : socket.socket
        Outlet of the queue to the loop.
    heart : Heart
        Line to the supervisor.
    """

    def __init__(self, name: str, link: Link, samples: socket.socket, heart: Heart) -> None:
        self._name = name
        self._link = link
        self._outlet = Outlet(samples)
        self._heart = heart
        self._back_off = BackOff()
        self._refused = 0
        self._state = ""
        self._complaint = ""
        self._look_due = 0.0
        self._report_due = 0.0

    def run(self) -> None:
        """Keep the link open and pass on what it says, until an exception (on SIGTERM) ends it."""
        try:
            while True:
                self._attempt()
        finally:
            self._link.close()

    def _attempt(self) -> None:
        """Open the link and stay with it until it breaks; then wait for the next attempt."""
        began = time.monotonic()
        try:
            self._report("opening", "")
            self._heart.announce(f"opening {self._name}")
            self._link.open()
            self._complain("")
            while True:
                self._pass_on()
        except LinkError as error:
            self._link.close()
            self._complain(str(error))
            self._wait(self._back_off.failed(time.monotonic() - began), str(error))

    def _pass_on(self) -> None:
        samples = self._link.poll(STATE_PERIOD)
        for batch in batches(samples):
            self._send(batch)
        now = time.monotonic()
        if now < self._look_due:
            return
        self._look_due = now + STATE_PERIOD
        report = self._link.report()
        if report.state != self._state or now >= self._report_due:
            self._report(report.state, report.reason)

    def _send(self, batch: SampleBatch) -> None:
        if not self._outlet.send(encode(batch)):
            self._refused += len(batch.samples)

    def _report(self, state: str, reason: str) -> None:
        """Tell the loop how the link is, and the supervisor that this process is at work."""
        report: LinkReport = self._link.report()
        report = msgspec.structs.replace(
            report, link=self._name, state=state, reason=reason, dropped=report.dropped + self._refused
        )
        self._outlet.send(encode(report))
        self._heart.beat()
        self._state = state
        self._report_due = time.monotonic() + REPORT_PERIOD

    def _wait(self, delay: float, reason: str) -> None:
        until = time.monotonic() + delay
        while (remaining := until - time.monotonic()) > 0.0:
            self._report("retrying", reason)
            time.sleep(min(remaining, REPORT_PERIOD))

    def _complain(self, complaint: str) -> None:
        """Log a reason once, not at every attempt, and the recovery from it."""
        if complaint and complaint != self._complaint:
            _log.warning("link %s: %s; trying again", self._name, complaint)
        elif self._complaint and not complaint:
            _log.info("link %s: open", self._name)
        self._complaint = complaint
