"""What the supervisor says to systemd (``sd_notify(3)``); without systemd it goes nowhere."""

from __future__ import annotations

import os
import socket
import time
from typing import Protocol, cast

import sdnotify

LONGEST_WAIT = 0.2
"""Seconds that a notification may wait for room: who reads it may hang, the supervisor must not."""

WATCHDOG_PERIOD = 0.25
"""Seconds: signs of life are not repeated more often."""


class _Channel(Protocol):
    socket: socket.socket | None

    def notify(self, state: str) -> None: ...


class Notifier:
    """The service's side of the notification socket named by ``NOTIFY_SOCKET``."""

    def __init__(self) -> None:
        self._channel = cast("_Channel", sdnotify.SystemdNotifier())
        if self._channel.socket is not None:
            self._channel.socket.settimeout(LONGEST_WAIT)
        self._watchdog_due = 0.0
        self.watchdog_period = int(os.environ.get("WATCHDOG_USEC", "0")) * 1e-6
        """Seconds that systemd waits for a sign of life (``WatchdogSec=``); 0: it does not."""

    def ready(self) -> None:
        """Say that the loop publishes."""
        self._channel.notify("READY=1")

    def reloading(self) -> None:
        """Say that the configuration is being read again; :meth:`ready` ends it."""
        self._channel.notify(f"RELOADING=1\nMONOTONIC_USEC={time.monotonic_ns() // 1000}")

    def stopping(self) -> None:
        """Say that the service is going down."""
        self._channel.notify("STOPPING=1")

    def watchdog(self) -> None:
        """Say that the loop ticks; as often as one likes."""
        now = time.monotonic()
        if now >= self._watchdog_due:
            self._watchdog_due = now + WATCHDOG_PERIOD
            self._channel.notify("WATCHDOG=1")

    def watchdog_within(self, seconds: float) -> None:
        """Say how long the next :meth:`watchdog` may take from now on, and arm the watchdog anew."""
        self._channel.notify(f"WATCHDOG_USEC={round(seconds * 1e6)}")

    def status(self, text: str) -> None:
        """Say in one line how the service is (``systemctl status`` shows it)."""
        self._channel.notify("STATUS=" + " ".join(text.split()))
