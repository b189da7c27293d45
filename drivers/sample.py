"""The language between the rooms: what a driver says after it has understood some bytes.

A :class:`Sample` is an envelope (when, from where) around one :data:`Reading` (what). Everything inside is in SI
units and radians, north-east-down for the world and forward-right-down for the body, on the host's monotonic clock
in nanoseconds. Conversion from what the wire says happens once, in the driver; what is unknown is ``None``, never a
zero, a sentinel or a NaN.

Samples cross process borders as MessagePack in datagrams (:func:`encode`, :func:`decode`) and come in from other
Zenoh sessions as JSON of the same readings (:mod:`drivers.zenoh`).
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

SECOND = 1_000_000_000
"""Nanoseconds in a second, on every clock here."""

Vector = tuple[float, float, float]


class Reading(
    msgspec.Struct, frozen=True, gc=False, omit_defaults=True, forbid_unknown_fields=True, tag_field="kind"
):
    """What was measured or commanded; each subclass is one kind, named by its tag."""


class GeodeticPosition(Reading, frozen=True, gc=False, tag="geodetic_position"):
    """Where a receiver says it is: GNSS, or a node that speaks latitude and longitude.

    Angles in radians (WGS 84), ``altitude`` above mean sea level in metres, sigmas in metres (one standard
    deviation per axis). Drivers emit it only for a fix of at least two dimensions.
    """

    latitude: float
    longitude: float
    altitude: float | None = None
    sigma_horizontal: float | None = None
    sigma_vertical: float | None = None
    satellites: int | None = None


class LocalPosition(Reading, frozen=True, gc=False, tag="local_position"):
    """A position in the vehicle's own local frame, metres north, east and down of the origin."""

    north: float
    east: float
    down: float | None = None
    sigma_horizontal: float | None = None
    sigma_vertical: float | None = None


class Velocity(Reading, frozen=True, gc=False, tag="velocity"):
    """Velocity over ground, metres per second north, east and down."""

    north: float
    east: float
    down: float | None = None
    sigma: float | None = None


class Speed(Reading, frozen=True, gc=False, tag="speed"):
    """Forward speed along the body's axis, metres per second; negative is backwards."""

    speed: float
    sigma: float | None = None


class Odometer(Reading, frozen=True, gc=False, tag="odometer"):
    """Distance that each wheel has rolled, metres, growing from the start of ``epoch``.

    A total rather than an increment: a lost datagram then costs resolution, not distance. ``epoch`` changes when the
    counter started anew (reboot, reconnection); a difference is valid only within one epoch.
    """

    distance: tuple[float, ...]
    epoch: int = 0


class Inertial(Reading, frozen=True, gc=False, tag="inertial"):
    """One inertial unit, body frame: rad/s, m/s² (specific force), tesla. ``None``: not measured by this message."""

    angular_velocity: Vector | None = None
    specific_force: Vector | None = None
    magnetic_field: Vector | None = None


class Rotation(Reading, frozen=True, gc=False, tag="rotation"):
    """Yaw rate of the body about down, rad/s, positive clockwise seen from above."""

    yaw_rate: float
    sigma: float | None = None


class Attitude(Reading, frozen=True, gc=False, tag="attitude"):
    """The autopilot's own attitude, radians, and body rates, rad/s. It comes from a filter: not independent."""

    roll: float
    pitch: float
    yaw: float
    angular_velocity: Vector | None = None


class Heading(Reading, frozen=True, gc=False, tag="heading"):
    """Direction of the body's forward axis, radians clockwise from true north."""

    heading: float
    sigma: float | None = None


class Range(Reading, frozen=True, gc=False, tag="range"):
    """Distance to a beacon, metres; where the beacon says so, also where it stands (radians, metres above sea)."""

    beacon: int
    distance: float
    sigma: float | None = None
    latitude: float | None = None
    longitude: float | None = None
    altitude: float | None = None


class BeaconPlace(Reading, frozen=True, gc=False, tag="beacon_place"):
    """Where a beacon stands, metres north, east and down of the vehicle's origin, as its own system has it surveyed."""

    beacon: int
    north: float
    east: float
    down: float


class Bearing(Reading, frozen=True, gc=False, tag="bearing"):
    """Direction to a landmark, radians clockwise from the nose; ``landmark``: which one, where the sensor knows."""

    bearing: float
    landmark: int | None = None
    sigma: float | None = None


class RangeBearing(Reading, frozen=True, gc=False, tag="range_bearing"):
    """Distance (metres) and direction (radians clockwise from the nose) of a landmark, known by its number or not."""

    distance: float
    bearing: float
    landmark: int | None = None
    sigma_distance: float | None = None
    sigma_bearing: float | None = None


class Clearance(Reading, frozen=True, gc=False, tag="clearance"):
    """A range finder, metres along its axis; ``orientation`` is the MAV_SENSOR_ORIENTATION (25: down)."""

    distance: float
    orientation: int
    sigma: float | None = None


class Pressure(Reading, frozen=True, gc=False, tag="pressure"):
    """Air pressure, pascal; ``temperature`` in kelvin."""

    absolute: float
    differential: float | None = None
    temperature: float | None = None


class Altitude(Reading, frozen=True, gc=False, tag="altitude"):
    """Altitude above mean sea level, metres, from other than a GNSS receiver."""

    altitude: float
    sigma: float | None = None


class MotorSpeed(Reading, frozen=True, gc=False, tag="motor_speed"):
    """Angular speed of one motor or wheel, rad/s."""

    index: int
    angular_speed: float


class Origin(Reading, frozen=True, gc=False, tag="origin"):
    """The vehicle's local origin: radians, metres above mean sea level."""

    latitude: float
    longitude: float
    altitude: float


class Presence(Reading, frozen=True, gc=False, tag="presence"):
    """A component says that it is there: MAVLink's numbers for its type, autopilot and state."""

    type: int
    autopilot: int
    armed: bool
    system_status: int


class MotionCommand(Reading, frozen=True, gc=False, tag="motion_command"):
    """Commanded motion: velocity (m/s, NED, or FRD when ``body``), yaw rate (rad/s). ``None``: not commanded."""

    velocity: Vector | None = None
    yaw_rate: float | None = None
    body: bool = False


class ActuatorCommand(Reading, frozen=True, gc=False, tag="actuator_command"):
    """Commands to actuators by channel, calibrated to -1…1; ``None``: the channel is off or not used."""

    channels: tuple[float | None, ...]


AnyReading = (
    GeodeticPosition
    | LocalPosition
    | Velocity
    | Speed
    | Odometer
    | Inertial
    | Rotation
    | Attitude
    | Heading
    | Range
    | BeaconPlace
    | Bearing
    | RangeBearing
    | Clearance
    | Pressure
    | Altitude
    | MotorSpeed
    | Origin
    | Presence
    | MotionCommand
    | ActuatorCommand
)


class Sample(msgspec.Struct, frozen=True, gc=False, array_like=True):
    """One reading with its time and its source.

    Attributes
    ----------
    time : int
        When it was measured, nanoseconds on the host's monotonic clock (in a replay: on the log's receive clock).
    received : int
        When its bytes arrived, on the same clock. ``time <= received`` but for a clock mapping still settling.
    link : str
        Name of the link it came by, as in the configuration.
    source : str
        Who said it, as the wire names it: ``GPS_RAW_INT``, ``gnss.Fix2``, ``sample/uwb``.
    reading : AnyReading
        What was measured.
    """

    time: int
    received: int
    link: str
    source: str
    reading: AnyReading


class LinkReport(msgspec.Struct, frozen=True, gc=False, omit_defaults=True, tag="link_report"):
    """How a link is, said once a second by its process. All counts are totals since the process started.

    Attributes
    ----------
    state : str
        ``opening``, ``up``, ``silent`` (open, but nothing arrives) or ``retrying`` (``reason`` says why).
    messages, samples : int
        Messages understood, samples made of them.
    malformed : dict[str, int]
        What was broken and refused, by kind: ``bad_checksum``, ``GPS_RAW_INT.latitude``,
        ``truncated_transfer`` …
    unusable : dict[str, int]
        Well-formed readings that say nothing usable, by field: no fix, out of range, a sensor not fitted.
    ignored : int
        Messages that are well-formed but not wanted (other system, component or kind).
    dropped : int
        Samples that the loop's queue had no room for.
    lost : int or None
        Messages of the vehicle that never arrived, by the gaps in its senders' numbering; ``None`` where
        messages bear no numbers (CAN, Zenoh).
    offset, jitter : float or None
        Of the clock mapping, seconds: sensor clock to host clock, and the spread of arrival about it.
    """

    link: str
    state: str
    reason: str = ""
    messages: int = 0
    samples: int = 0
    malformed: dict[str, int] = {}
    unusable: dict[str, int] = {}
    ignored: int = 0
    dropped: int = 0
    lost: int | None = None
    opened: int = 0
    clock: str = ""
    offset: float | None = None
    jitter: float | None = None


class SampleBatch(msgspec.Struct, frozen=True, gc=False, tag="samples"):
    """The samples of one wake-up of a link, in the order of their arrival."""

    samples: list[Sample]


Datagram = SampleBatch | LinkReport

_encoder = msgspec.msgpack.Encoder()
_decoder = msgspec.msgpack.Decoder(Datagram)


def encode(datagram: SampleBatch | LinkReport) -> bytes:
    """Encode what a link says to the loop as one datagram (MessagePack)."""
    return _encoder.encode(datagram)


def decode(data: bytes | memoryview) -> SampleBatch | LinkReport:
    """Decode one datagram of :func:`encode`.

    Raises
    ------
    msgspec.MsgspecError
        The bytes are not a datagram of this version.
    """
    return _decoder.decode(data)


def batches(samples: Sequence[Sample], largest: int = 64) -> list[SampleBatch]:
    """Cut a sequence of samples into datagrams of at most ``largest`` samples."""
    return [SampleBatch(list(samples[i : i + largest])) for i in range(0, len(samples), largest)]
