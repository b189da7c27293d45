"""Which readings cannot be true, whoever says them: the one place for the limits of what a driver lets in.

A reading from outside is refused when a number is not finite or lies where physics, the Earth or the unit
does not allow it. The limits are wide: they catch degrees where radians belong, sentinels and bit errors, not
bad sensors, which the filter judges.
"""

from __future__ import annotations

import math
from typing import cast

import msgspec

from drivers.sample import AnyReading

_HALF_TURN = math.pi * (1.0 + 1e-12)
_TURN = 2.0 * _HALF_TURN
_TINY = 1e-9

# Inclusive limits by field name, in the field's unit (m, m/s, rad, rad/s, m/s², T, Pa, K); a name means the
# same in every reading. Local distances end where single precision loses the decimetre.
_LIMITS: dict[str, tuple[float, float]] = {
    "latitude": (-_HALF_TURN / 2.0, _HALF_TURN / 2.0),
    "longitude": (-_HALF_TURN, _HALF_TURN),
    "altitude": (-12_000.0, 100_000.0),
    "north": (-1e6, 1e6),
    "east": (-1e6, 1e6),
    "down": (-1e6, 1e6),
    "velocity": (-1e4, 1e4),
    "speed": (-1e4, 1e4),
    "sigma": (_TINY, 1e6),
    "sigma_horizontal": (_TINY, 1e6),
    "sigma_vertical": (_TINY, 1e6),
    "satellites": (0, 255),
    "angular_velocity": (-1e3, 1e3),
    "specific_force": (-1e4, 1e4),
    "magnetic_field": (-1.0, 1.0),
    "yaw_rate": (-1e3, 1e3),
    "roll": (-_TURN, _TURN),
    "pitch": (-_TURN, _TURN),
    "yaw": (-_TURN, _TURN),
    "heading": (-_TURN, _TURN),
    "beacon": (0, 2**31 - 1),
    "landmark": (0, 2**31 - 1),
    "bearing": (-_TURN, _TURN),
    "sigma_distance": (_TINY, 1e6),
    "sigma_bearing": (_TINY, 1e6),
    "orientation": (0, 255),
    "absolute": (1.0, 1e9),
    "differential": (-1e9, 1e9),
    "temperature": (_TINY, 5_000.0),
    "index": (0, 255),
    "angular_speed": (-1e5, 1e5),
    "channels": (-1.0, 1.0),
    "epoch": (0, 2**63 - 1),
    "type": (0, 255),
    "autopilot": (0, 255),
    "system_status": (0, 255),
}
_DISTANCES: dict[str, tuple[float, float]] = {
    "range": (0.0, 1e6),
    "range_bearing": (0.0, 1e6),
    "clearance": (0.0, 1e6),
    "odometer": (-1e9, 1e9),
}
_ANYTHING = (-1e18, 1e18)  # an integer of JSON may be larger than any number that goes on to the loop
_LONGEST = 256

Bounds = tuple[tuple[str, float, float], ...]


def _checks(reading: type[AnyReading]) -> Bounds:
    config = msgspec.structs.fields(reading)
    kind = str(reading.__struct_config__.tag)
    limits = {**_LIMITS, "distance": _DISTANCES.get(kind, _ANYTHING)}
    return tuple((field.name, *limits.get(field.name, _ANYTHING)) for field in config)


_CHECKS: dict[type[AnyReading], Bounds] = {}


def implausible(reading: AnyReading) -> str | None:
    """Return the name of the first field that cannot be true, or ``None`` when the reading may be used.

    Every bound is finite, so what is not lies outside.
    """
    kind = type(reading)
    checks = _CHECKS.get(kind)
    if checks is None:
        checks = _CHECKS[kind] = _checks(kind)
    for name, low, high in checks:
        value = getattr(reading, name)
        if value is None or isinstance(value, bool | str):
            continue
        if isinstance(value, tuple):
            sound = _all_within(cast("tuple[float | None, ...]", value), low, high)
        else:
            sound = low <= value <= high
        if not sound:
            return name
    return None


def _all_within(values: tuple[float | None, ...], low: float, high: float) -> bool:
    """Whether a vector is short enough and none of its numbers lies outside; those that are absent do not."""
    if len(values) > _LONGEST:
        return False
    for value in values:  # noqa: SIM110  a generator would take twice as long
        if value is not None and not low <= value <= high:
            return False
    return True
