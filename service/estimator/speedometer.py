"""A forward speed, whatever says it: a speed as such, a motor with a wheel on it, distances that wheels have rolled.

Used where a speed is a measurement and where several make the control; each speaker has a speedometer of its own.
"""

from __future__ import annotations

from drivers.sample import SECOND, AnyReading, MotorSpeed, Odometer, Speed
from service.config import Sensor
from service.estimator.track import FASTEST, GAP

NO_RADIUS, NO_WHEEL = "no_wheel_radius", "no_such_wheel"
FIRST, OUT_OF_ORDER = "first_count", "out_of_order"
TOO_FAST = "too_fast"


def matches(settings: Sensor, link: str, source: str, reading: AnyReading) -> bool:
    """Say whether a speed sensor of these settings wants what ``source`` said by ``link``."""
    if settings.link not in (None, link) or settings.source not in (None, source):
        return False
    if isinstance(reading, MotorSpeed):
        return settings.index in (None, reading.index)
    return isinstance(reading, Speed | Odometer)


class Speedometer:
    """Makes speeds of one speaker's readings, in their order.

    Parameters
    ----------
    index : int or None
        Which wheel of several that are said together; without it their mean.
    radius : float or None
        Of the driven wheels, metres.
    """

    def __init__(self, index: int | None, radius: float | None) -> None:
        self._index = index
        self._radius = radius
        self._last: tuple[int, float, tuple[int, int]] | None = None

    def read(self, time: int, reading: AnyReading) -> Speed | str:
        """Return the speed that ``reading`` says at ``time`` (nanoseconds), or why it says none.

        A distance says a mean speed since the one before: of half that interval ago, which is not made up for.
        """
        if isinstance(reading, Odometer):
            return self._rolled(time, reading)
        if isinstance(reading, MotorSpeed):
            if self._radius is None:
                return NO_RADIUS
            reading = Speed(reading.angular_speed * self._radius)
        assert isinstance(reading, Speed)
        return reading if abs(reading.speed) <= FASTEST else TOO_FAST

    def _rolled(self, time: int, reading: Odometer) -> Speed | str:
        wheels = reading.distance
        if not wheels or (self._index is not None and self._index >= len(wheels)):
            return NO_WHEEL
        distance = sum(wheels) / len(wheels) if self._index is None else wheels[self._index]
        epoch = (reading.epoch, len(wheels))
        last = self._last
        if last is not None and last[2] == epoch and time <= last[0]:
            return OUT_OF_ORDER
        self._last = (time, distance, epoch)
        if last is None or last[2] != epoch or time - last[0] > GAP:
            return FIRST
        speed = (distance - last[1]) * SECOND / (time - last[0])
        return Speed(speed) if abs(speed) <= FASTEST else TOO_FAST
