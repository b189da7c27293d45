"""Pressure as altitude, by the standard atmosphere."""

from __future__ import annotations

SEA_LEVEL = 101_325.0
"""Pa."""

SEA_LEVEL_TEMPERATURE = 288.15
"""K."""

LAPSE = 0.0065
"""K per metre, up to 11 km."""

EXPONENT = 8.31432 * LAPSE / (9.80665 * 0.0289644)
"""Gas constant times lapse rate, over gravity times the molar mass of air."""


def pressure_altitude(pressure: float) -> float:
    """Return the altitude above mean sea level, metres, at which the standard atmosphere has ``pressure`` (Pa).

    U.S. Standard Atmosphere, 1976, equation 33a, solved for the height, as every barometric altimeter has it. The
    weather shifts it by up to 300 m, by metres an hour; air that is 3 K colder than the standard's stretches it by 1 %.
    """
    return SEA_LEVEL_TEMPERATURE / LAPSE * (1.0 - (pressure / SEA_LEVEL) ** EXPONENT)
