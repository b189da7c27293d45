"""What turns frames into samples, whichever language is spoken on the bus; and which one a link's settings ask for."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple, Protocol

from drivers.can.frame import CanFrame
from drivers.can.settings import DBC, CanSettings
from drivers.can.traffic import Census
from drivers.clock import ClockMap
from drivers.sample import Sample


class Filter(NamedTuple):
    """Lets those identifiers through that equal ``identifier`` where ``mask`` has ones."""

    identifier: int
    mask: int
    extended: bool


class FrameDecoder(Protocol):
    """Frames of one bus in, samples out; what is wrong with a frame is counted, never raised."""

    messages: int
    unusable: Counter[str]

    @property
    def malformed(self) -> Counter[str]:
        """What was refused, by kind."""
        ...

    @property
    def ignored(self) -> int:
        """Frames that are well-formed but not wanted."""
        ...

    @property
    def clock(self) -> ClockMap | None:
        """The clock of whoever stamps the messages, if anyone does."""
        ...

    @property
    def filters(self) -> list[Filter]:
        """What an interface has to let through."""
        ...

    def census(self) -> Census:
        """Return a new count of what passes by, in the terms of this protocol."""
        ...

    def decode(self, frame: CanFrame, received_ns: int) -> list[Sample]:
        """Take one frame, arrived at ``received_ns`` on the samples' clock; return what it completes."""
        ...


def decoder_of(link_name: str, settings: CanSettings) -> FrameDecoder:
    """Return the decoder for the protocol of a link; each is imported only where it is used.

    Raises
    ------
    ValueError
        The settings name what is not there; the text says what and where.
    """
    if settings.protocol == DBC:
        from drivers.can.dbc import DbcDecoder

        return DbcDecoder(link_name, settings)
    from drivers.can.dronecan import Decoder

    return Decoder(link_name, settings)
