"""Frames of a car's bus as samples, by a DBC file and the signals that the configuration names.

Each signal is scaled to SI and becomes one reading, whose source is the signal as configured
(``SPEED.SPEED``). Wheels of one message are read together, and their source is the message (``WHEEL_SPEEDS``).
The bus has no clock of its own: a reading is of when its frame arrived.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from drivers.can import database, units
from drivers.can.database import DamagedFrame, DbcMessage
from drivers.can.decoder import Filter
from drivers.can.frame import LARGEST_EXTENDED, LARGEST_STANDARD, CanFrame
from drivers.can.settings import CanSettings, SignalSettings
from drivers.can.traffic import IdentifierTraffic
from drivers.can.wheels import FASTEST, Counters, Rolled
from drivers.clock import ClockMap
from drivers.plausibility import implausible
from drivers.sample import (
    Altitude,
    AnyReading,
    Clearance,
    Heading,
    MotorSpeed,
    Pressure,
    Range,
    Rotation,
    Sample,
    Speed,
)

TOGETHER = ("distance", "wheel_speed")
"""Measures of which those of one message are one reading."""

_ANYTHING = 1e18

_GROUP = 0x3FFFF00  # of a J1939 identifier: data page and format …
_FORMAT = 0x3FF0000  # … whose low byte is a destination where the format is below 240
_BROADCAST_FROM = 240


class Wanted(NamedTuple):
    """A signal that is wanted, with its scale to SI and where its counter starts anew (SI)."""

    settings: SignalSettings
    name: str
    scale: float
    span: float

    def measured(self, value: float) -> float:
        """Return a value of the file in SI units."""
        scaled = self.scale * value
        return (-scaled if self.settings.reversed else scaled) + self.settings.offset


def wanted_of(signals: Iterable[SignalSettings], known: database.Database) -> dict[str, list[Wanted]]:
    """Return the wanted signals by message.

    Raises
    ------
    DbcError
        A message or signal is not in the file, or neither it nor the settings say the unit.
    """
    wanted: dict[str, list[Wanted]] = {}
    for settings in signals:
        message, facts = known.find(settings.signal)
        scale = scale_of(settings, facts.unit)
        wanted.setdefault(message.name, []).append(
            Wanted(settings, facts.name, scale, abs(scale) * facts.span)
        )
    return wanted


def scale_of(settings: SignalSettings, unit: str) -> float:
    """Return the factor to SI: as configured, else by the file's unit; no unit at all is taken for SI.

    Raises
    ------
    DbcError
        The file's unit is none of what is measured.
    """
    if settings.scale is not None:
        return settings.scale
    known = units.factor(settings.measures, unit) if unit.strip() else 1.0
    if known is None:
        raise database.DbcError(
            f"{settings.signal}: the DBC file gives it in {unit!r}, which is no known unit of "
            f"{settings.measures}; say the scale to {units.si_unit(settings.measures)}"
        )
    return known


Reader = Callable[[Sequence[float], int], AnyReading]
"""Makes a reading of the values (SI) of its signals and the time."""


class Signals(NamedTuple):
    """Signals of one message that make one reading, under the source that it is given.

    ``largest``: beyond it a value is damage; a total would keep it for ever.
    """

    source: str
    wanted: tuple[Wanted, ...]
    read: Reader
    largest: float = _ANYTHING


def _single(wanted: Wanted, settings: CanSettings) -> Signals:
    facts = wanted.settings
    readers: dict[str, Callable[[float], AnyReading]] = {
        "speed": lambda value: Speed(value, facts.sigma),
        "yaw_rate": lambda value: Rotation(value, facts.sigma),
        "heading": lambda value: Heading(math.remainder(value, math.tau), facts.sigma),
        "motor_speed": lambda value: MotorSpeed(facts.index, value),
        "range": lambda value: Range(facts.beacon or 0, value, facts.sigma),
        "clearance": lambda value: Clearance(value, settings.range_orientation, facts.sigma),
        "altitude": lambda value: Altitude(value, facts.sigma),
        "pressure": Pressure,
    }
    read = readers[facts.measures]

    def alone(values: Sequence[float], _at: int) -> AnyReading:
        return read(values[0])

    return Signals(facts.signal, (wanted,), alone)


def _wheels(message: str, measures: str, wheels: Iterable[Wanted]) -> Signals:
    ordered = tuple(sorted(wheels, key=lambda wheel: wheel.settings.index))
    if measures == "distance":
        return Signals(message, ordered, Counters([wheel.span for wheel in ordered]).take)
    return Signals(message, ordered, Rolled(len(ordered)).take, FASTEST)


def _signals_of(message: str, wanted: list[Wanted], settings: CanSettings) -> list[Signals]:
    found = [_single(one, settings) for one in wanted if one.settings.measures not in TOGETHER]
    for measures in TOGETHER:
        wheels = [one for one in wanted if one.settings.measures == measures]
        if wheels:
            found.append(_wheels(message, measures, wheels))
    return found


class DbcDecoder:
    """Turns the frames of one bus into samples; a :class:`drivers.can.decoder.FrameDecoder`.

    Parameters
    ----------
    link_name : str
        Name of the link in the configuration, for the samples' envelope.
    settings : CanSettings
        Of that link: the DBC file, the signals.

    Attributes
    ----------
    messages : int
        Frames understood.
    malformed : Counter[str]
        ``MESSAGE.cut_short``, ``MESSAGE.multiplexer``, ``MESSAGE.undecodable``, and readings that cannot be true, as
        ``MESSAGE.SIGNAL.speed``.
    unusable : Counter[str]
        ``MESSAGE.SIGNAL``: the value has a name in the file (``SNA``), so it is no measurement.
    ignored : int
        Frames of other messages.

    Raises
    ------
    DbcError
        The file cannot be read, or a signal is not in it.
    """

    def __init__(self, link_name: str, settings: CanSettings) -> None:
        self._link = link_name
        self._known = database.read(settings.dbc)
        self._readers: dict[tuple[bool, int], tuple[DbcMessage, list[Signals]]] = {}
        self._groups: dict[int, tuple[DbcMessage, list[Signals]]] = {}
        self.messages = 0
        self.ignored = 0
        self.malformed: Counter[str] = Counter()
        self.unusable: Counter[str] = Counter()
        for name, wanted in wanted_of(settings.signals, self._known).items():
            message = self._known.messages[name]
            entry = (message, _signals_of(name, wanted, settings))
            if message.group:
                self._groups[group_of(message.identifier)] = entry
            else:
                self._readers[message.extended, message.identifier] = entry

    @property
    def clock(self) -> ClockMap | None:
        """None: frames bear no stamps."""
        return None

    @property
    def filters(self) -> list[Filter]:
        """What an interface has to let through."""
        exact = [
            Filter(identifier, LARGEST_EXTENDED if extended else LARGEST_STANDARD, extended)
            for extended, identifier in self._readers
        ]
        return [*exact, *(Filter(group, _mask_of(group), True) for group in self._groups)]

    def census(self) -> IdentifierTraffic:
        """Return a new count of frames by identifier, under the file's names."""
        return IdentifierTraffic({(m.extended, m.identifier): m.name for m in self._known.messages.values()})

    def decode(self, frame: CanFrame, received_ns: int) -> list[Sample]:
        """Take one frame; return its samples.

        Parameters
        ----------
        frame : CanFrame
            Of any kind, CAN FD too; whatever is wrong with it is counted, never raised.
        received_ns : int
            When it arrived, on the clock of the samples.
        """
        entry = self._readers.get((frame.extended, frame.identifier))
        if entry is None and frame.extended and self._groups:
            entry = self._groups.get(group_of(frame.identifier))
        if entry is None:
            self.ignored += 1
            return []
        message, signals = entry
        try:
            values = message.values(frame.data)
        except DamagedFrame as error:
            self.malformed[f"{message.name}.{error}"] += 1
            return []
        self.messages += 1
        if message.cut_short(frame.data) and any(w.name not in values for s in signals for w in s.wanted):
            self.malformed[f"{message.name}.cut_short"] += 1
        return [
            Sample(received_ns, received_ns, self._link, one.source, reading)
            for one in signals
            if (reading := self._read(one, values, received_ns)) is not None
        ]

    def _read(self, one: Signals, values: dict[str, float | None], at: int) -> AnyReading | None:
        measured: list[float] = []
        for wanted in one.wanted:
            if wanted.name not in values:
                return None  # not switched on by the multiplexer, or cut off
            value = values[wanted.name]
            if value is None:
                self.unusable[wanted.settings.signal] += 1
                return None
            measured.append(wanted.measured(value))
        if not all(abs(value) <= one.largest for value in measured):  # nor is a NaN
            self.malformed[f"{one.source}.value"] += 1
            return None
        reading = one.read(measured, at)
        wrong = implausible(reading)
        if wrong is not None:
            self.malformed[f"{one.source}.{wrong}"] += 1
            return None
        return reading


def group_of(identifier: int) -> int:
    """Return the part of a J1939 identifier that says what it is, without priority, source and destination."""
    broadcast = identifier >> 16 & 0xFF >= _BROADCAST_FROM
    return identifier & (_GROUP if broadcast else _FORMAT)


def _mask_of(group: int) -> int:
    return _GROUP if group >> 16 & 0xFF >= _BROADCAST_FROM else _FORMAT
