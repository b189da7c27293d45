"""What every live link offers: open, poll, report, close.

A link turns bytes into :class:`~drivers.sample.Sample`. It runs in a process of its own (the service gives it one),
so it may block up to the time-out that it is given, and nothing waits for it. A link that cannot be opened or that
breaks raises :class:`LinkError`; whoever runs it retries with back-off.
"""

from __future__ import annotations

from typing import Protocol

from drivers.sample import LinkReport, Sample


class LinkError(Exception):
    """The link cannot be opened or has broken; the text says what, where, and what would be right."""


class Link(Protocol):
    """A source of samples on a live bus, socket or serial line."""

    def open(self) -> None:
        """Open the port and say hello.

        Raises
        ------
        LinkError
            The port is taken, the interface absent, the address wrong.
        """
        ...

    def poll(self, timeout: float) -> list[Sample]:
        """Wait at most ``timeout`` seconds for bytes; return the samples understood, in order of arrival.

        Also does what the link owes its peer when it is due: heartbeats, requests, time synchronisation.

        Raises
        ------
        LinkError
            The port has gone.
        """
        ...

    def report(self) -> LinkReport:
        """Return the totals so far, and the state."""
        ...

    def close(self) -> None:
        """Close the port; harmless when it is closed."""
        ...
