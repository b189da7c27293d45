"""Readings that other programs send as JSON: the format, and what is refused.

The payload is one JSON object of at most 4,096 bytes: a reading of :mod:`drivers.sample` with its tag and
fields, in SI units and radians, and optionally when it was measured::

    {"kind": "range", "beacon": 5, "distance": 12.3, "sigma": 0.3, "time": 1700000010.25}
    {"kind": "velocity", "north": 1.2, "east": -0.4, "sigma": 0.05}
    {"kind": "geodetic_position", "latitude": 0.7058, "longitude": -1.3951, "sigma_horizontal": 1.5}

``kind``
    The tag of the reading: ``geodetic_position``, ``local_position``, ``velocity``, ``speed``, ``odometer``,
    ``inertial``, ``rotation``, ``attitude``, ``heading``, ``range``, ``clearance``, ``pressure``,
    ``altitude``, ``motor_speed``, ``origin``, ``presence``, ``motion_command``, ``actuator_command``.
``time``
    Unix seconds; absent or null: when it arrives. Mapped to the host's monotonic clock by what both clocks
    read at arrival. More than a second ahead or a minute behind is refused: the sender's clock is not set.

Fields that are not known may be left out or null where the reading allows it. A field too many, a missing
one, a wrong type, a string for a number, or a value that cannot be true (:mod:`drivers.plausibility`) refuses
the sample; what was wrong is counted as ``sample/<sensor>.<kind of damage>``: ``bad_json``, ``invalid``,
``oversize``, ``time``, or the field.
"""

from __future__ import annotations

import msgspec

from drivers.plausibility import implausible
from drivers.sample import AnyReading

LARGEST_PAYLOAD = 4096

_AHEAD = 1.0
_BEHIND = 60.0

_readings = msgspec.json.Decoder(AnyReading)
_objects = msgspec.json.Decoder(dict[str, msgspec.Raw])
_times = msgspec.json.Decoder(float | None)


class MalformedSample(ValueError):  # noqa: N818  it names what arrived, and is always caught as such
    """A payload that is no sample; the text is the kind of damage."""


def decode(payload: bytes) -> tuple[AnyReading, float | None]:
    """Return the reading of a foreign payload, and its Unix time if it has one.

    Raises
    ------
    MalformedSample
        ``oversize``, ``bad_json``, ``invalid``, ``time``, or the field that cannot be true.
    """
    if len(payload) > LARGEST_PAYLOAD:
        raise MalformedSample("oversize")
    try:
        fields = _objects.decode(payload)
        stamp = fields.pop("time", None)
        unix = None if stamp is None else _times.decode(stamp)
        reading = _readings.decode(msgspec.json.encode(fields))
    except msgspec.ValidationError as error:
        raise MalformedSample("invalid") from error
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise MalformedSample("bad_json") from error
    field = implausible(reading)
    if field is not None:
        raise MalformedSample(field)
    return reading, unix


def host_time(unix: float | None, unix_now: float, now_ns: int) -> int:
    """Return a foreign Unix time on the host's monotonic clock, nanoseconds, never after ``now_ns``.

    Parameters
    ----------
    unix : float or None
        What the sender says, seconds; ``None``: now.
    unix_now, now_ns : float, int
        The wall clock (seconds) and the monotonic clock (nanoseconds) at arrival.

    Raises
    ------
    MalformedSample
        ``time``: the two wall clocks cannot both be right.
    """
    if unix is None:
        return now_ns
    age = unix_now - unix
    if not -_AHEAD <= age <= _BEHIND:
        raise MalformedSample("time")
    return now_ns - max(0, int(age * 1e9))
