"""Air data: SCALED_PRESSURE, SCALED_PRESSURE2, SCALED_PRESSURE3, and what may be taken from VFR_HUD and the autopilot.

How high the autopilot thinks it is, it has from barometer and GNSS by a filter of its own: no sensor, so only if asked.
"""

from __future__ import annotations

import math
from typing import Any

from drivers.mavlink.inertial import HECTOPASCAL, KELVIN
from drivers.mavlink.moment import Moment, Timed
from drivers.sample import Altitude, Heading, Pressure, Speed

CENTIKELVIN = 0.01
MILLIMETRE = 1e-3


def scaled_pressure(fields: Any, at: Moment) -> list[Timed]:
    """SCALED_PRESSURE 29, 137, 143: hPa, hundredths of a degree Celsius; differential 0: no such sensor."""
    differential = fields.press_diff * HECTOPASCAL if fields.press_diff != 0.0 else None
    if differential is not None and not math.isfinite(differential):
        at.refuse("press_diff")
        differential = None
    temperature = fields.temperature * CENTIKELVIN + KELVIN
    reading = Pressure(fields.press_abs * HECTOPASCAL, differential, temperature)
    return [(at.boot_ms(fields.time_boot_ms), reading)]


def altitude(fields: Any, at: Moment) -> list[Timed]:
    """ALTITUDE 141: the one above mean sea level; NaN, and from PX4 without GNSS, is not known."""
    if not math.isfinite(fields.altitude_amsl):
        at.pass_over("altitude_amsl")
        return []
    return [(at.microseconds(fields.time_usec), Altitude(fields.altitude_amsl))]


def global_position(fields: Any, at: Moment) -> list[Timed]:
    """GLOBAL_POSITION_INT 33: the altitude alone; without a position it reads 0, 0, and its altitude is nothing."""
    if fields.lat == 0 and fields.lon == 0:
        at.pass_over("lat")
        return []
    return [(at.boot_ms(fields.time_boot_ms), Altitude(fields.alt * MILLIMETRE))]


class Hud:
    """VFR_HUD 74, as far as the settings ask for it. It has no stamp.

    It repeats GNSS and the autopilot's filter; its airspeed, which may be made up, is not offered at all.
    """

    def __init__(self, wanted: frozenset[str]) -> None:
        self._wanted = wanted

    def __call__(self, fields: Any, at: Moment) -> list[Timed]:
        """Return speed over ground, altitude, heading: those asked for."""
        readings: list[Timed] = []
        if "groundspeed" in self._wanted:
            readings.append((at.received, Speed(fields.groundspeed)))
        if "altitude" in self._wanted:
            readings.append((at.received, Altitude(fields.alt)))
        if "heading" in self._wanted:
            if 0 <= fields.heading <= 360:
                heading = math.remainder(math.radians(fields.heading), math.tau)
                readings.append((at.received, Heading(heading)))
            else:
                at.refuse("heading")
        return readings
