"""DroneCAN frames as samples, without a node: nothing is ever sent on the bus."""

from __future__ import annotations

from collections import Counter

from drivers.can.decoder import Filter
from drivers.can.dsdl import MalformedPayload, Message
from drivers.can.frame import CanFrame
from drivers.can.readings import DATA_TYPES, PassedOver, Refused, readings_of
from drivers.can.settings import CanSettings
from drivers.can.traffic import Traffic
from drivers.can.transfer import Reassembler, Transfer, message_identifier
from drivers.clock import US_56, ClockMap
from drivers.plausibility import implausible
from drivers.sample import AnyReading, Sample

_UNKNOWN: Message = {"usec": 0}


class Decoder:
    """Turns the frames of one bus into samples.

    Parameters
    ----------
    link_name : str
        Name of the link in the configuration, for the samples' envelope.
    settings : CanSettings
        Of that link.

    Attributes
    ----------
    messages : int
        Transfers understood.
    unusable : Counter[str]
        Fields by which a sound message said that it has nothing usable: ``gnss.Fix2.status``.
    """

    def __init__(self, link_name: str, settings: CanSettings) -> None:
        self._link = link_name
        self._settings = settings
        self._transfers = Reassembler(DATA_TYPES)
        self._refused: Counter[str] = Counter()
        self._clocks: dict[int, ClockMap] = {}
        self.messages = 0
        self.unusable: Counter[str] = Counter()

    @property
    def malformed(self) -> Counter[str]:
        """What was refused: transfers by kind (see ``Reassembler``), contents as ``gnss.Fix2.latitude``."""
        return self._transfers.malformed + self._refused

    @property
    def ignored(self) -> int:
        """Frames that are well-formed but not wanted, or that the bus delivered twice."""
        return self._transfers.ignored + self._transfers.repeated

    @property
    def clock(self) -> ClockMap | None:
        """The clock of the node with the least steady stamps; ``None`` while no stamp has come."""
        return max(self._clocks.values(), key=lambda clock: clock.jitter or 0.0, default=None)

    @property
    def filters(self) -> list[Filter]:
        """What an interface has to let through: the wanted message types from any node."""
        return [Filter(*message_identifier(data_type), True) for data_type in DATA_TYPES]

    def census(self) -> Traffic:
        """Return a new count of transfers by type."""
        return Traffic()

    def decode(self, frame: CanFrame, received_ns: int) -> list[Sample]:
        """Take one frame; return the samples of the transfer that it completes.

        Parameters
        ----------
        frame : CanFrame
            Of any kind; whatever is wrong with it is counted, never raised.
        received_ns : int
            When it arrived, on the clock of the samples.
        """
        transfer = self._transfers.accept(frame, received_ns)
        if transfer is None:
            return []
        name = transfer.data_type.name
        try:
            message = transfer.data_type.unpack(transfer.payload, tail_array_optimised=not transfer.flexible)
        except MalformedPayload as error:
            self._refused[f"{name}.{error}"] += 1
            return []
        self.messages += 1
        time_ns = self._measured_ns(transfer, message)
        return [
            Sample(time=time_ns, received=received_ns, link=self._link, source=name, reading=reading)
            for reading in self._usable(transfer, message)
        ]

    def _usable(self, transfer: Transfer, message: Message) -> list[AnyReading]:
        readings: list[AnyReading] = []
        name = transfer.data_type.name
        for reading in readings_of(transfer.data_type, message, self._settings):
            if isinstance(reading, PassedOver):
                self.unusable[f"{name}.{reading.field}"] += 1
                continue
            field = reading.field if isinstance(reading, Refused) else implausible(reading)
            if field is not None:
                self._refused[f"{name}.{field}"] += 1
            elif not isinstance(reading, Refused):
                readings.append(reading)
        return readings

    def _measured_ns(self, transfer: Transfer, message: Message) -> int:
        """Map the stamp of the message, where it has one, from its node's clock to the host's."""
        stamp = message.get("timestamp", _UNKNOWN)["usec"]
        if stamp == 0:
            return transfer.received_ns
        clock = self._clocks.setdefault(transfer.source, ClockMap())
        return clock.host_time(stamp, US_56, transfer.received_ns)
