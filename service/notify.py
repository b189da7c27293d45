"""What the supervisor says to systemd (``sd_notify(3)``); without systemd it goes nowhere."""

from __future__ import annotations

import time
from typing import Protocol, cast

import sdnotify


class _Channel(Protocol):
    def notify(self, state: str) -> None: ...


class Notifier:
    """The service's side of the notification socket named by ``NOTIFY_SOCKET``."""

    def __init__(self) -> None:
        self._channel = cast("_Channel", sdnotify.SystemdNotifier())

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
        """Say that the loop ticks."""
        self._channel.notify("WATCHDOG=1")

    def status(self, text: str) -> None:
        """Say in one line how the service is (``systemctl status`` shows it)."""
        self._channel.notify("STATUS=" + " ".join(text.split()))
