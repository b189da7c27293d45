"""The units that DBC files write, as factors to SI: which factor belongs to what a signal measures.

A DBC file gives each signal a unit as free text. Where it is one of these, the scale need not be configured, and
a configured one can be compared with it.
"""

from __future__ import annotations

import math

_METRES_PER_SECOND = {
    "m/s": 1.0, "mps": 1.0, "mm/s": 1e-3, "cm/s": 1e-2,
    "km/h": 1 / 3.6, "kph": 1 / 3.6, "kmh": 1 / 3.6, "kmph": 1 / 3.6,
    "mph": 0.44704, "mi/h": 0.44704, "kn": 1852 / 3600, "kt": 1852 / 3600, "knots": 1852 / 3600,
}  # fmt: skip
_RADIANS = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180, "degree": math.pi / 180, "°": math.pi / 180}
_RADIANS_PER_SECOND = {f"{angle}/{s}": factor for angle, factor in _RADIANS.items() for s in ("s", "sec")}
_REVOLUTIONS = {
    "rpm": math.tau / 60, "1/min": math.tau / 60, "min-1": math.tau / 60, "r/min": math.tau / 60,
    "rps": math.tau, "1/s": math.tau, "hz": math.tau,
}  # fmt: skip
_METRES = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "dm": 0.1, "km": 1e3, "ft": 0.3048, "mi": 1609.344}
_PASCALS = {"pa": 1.0, "hpa": 100.0, "mbar": 100.0, "kpa": 1e3, "bar": 1e5}

_FACTORS: dict[str, tuple[str, dict[str, float]]] = {
    "speed": ("m/s", _METRES_PER_SECOND),
    "wheel_speed": ("m/s", _METRES_PER_SECOND),
    "yaw_rate": ("rad/s", _RADIANS_PER_SECOND),
    "heading": ("rad", _RADIANS),
    "distance": ("m", _METRES),
    "motor_speed": ("rad/s", _RADIANS_PER_SECOND | _REVOLUTIONS),
    "range": ("m", _METRES),
    "clearance": ("m", _METRES),
    "altitude": ("m", _METRES),
    "pressure": ("Pa", _PASCALS),
}

MEASURES = tuple(_FACTORS)
"""What a signal may measure."""

_TOLERANCE = 0.005


def si_unit(measures: str) -> str:
    """Return the SI unit of what is measured: ``m/s``."""
    return _FACTORS[measures][0]


def factor(measures: str, unit: str) -> float | None:
    """Return the factor from ``unit`` to SI, ``None`` where the text is no unit of what is measured.

    Signs of degree and case do not matter; ``deg/s`` and ``°/s`` are the same.
    """
    return _FACTORS[measures][1].get(unit.strip().lower().replace(" ", "").replace("degrees", "deg"))


def contradicts(measures: str, unit: str, scale: float) -> float | None:
    """Return the factor that ``unit`` asks for where ``scale`` is another one, else ``None``; signs are free."""
    expected = factor(measures, unit)
    if expected is None or abs(abs(scale) - expected) <= _TOLERANCE * expected:
        return None
    return expected
