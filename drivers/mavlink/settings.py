"""What a MAVLink link may be told: where it listens, whom it believes, what it asks for."""

from __future__ import annotations

from typing import Literal

import msgspec

ONBOARD_COMPONENT = 197

DEFAULT_RATES: dict[str, float] = {
    "HEARTBEAT": 1.0,
    "HIGHRES_IMU": 50.0,
    "ATTITUDE": 50.0,
    "GPS_RAW_INT": 10.0,
    "GPS2_RAW": 10.0,
    "WHEEL_DISTANCE": 25.0,
    "RPM": 10.0,
    "RANGING_BEACON": 20.0,
    "DISTANCE_SENSOR": 20.0,
    "SCALED_PRESSURE": 10.0,
    "GPS_GLOBAL_ORIGIN": 1.0,
    "POSITION_TARGET_LOCAL_NED": 20.0,
    "SERVO_OUTPUT_RAW": 20.0,
}


class ServoCalibration(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One servo output: pulse widths (µs) at -1, 0 and 1.

    Attributes
    ----------
    channel : int
        As the autopilot counts: 1 is SERVO1.
    reversed : bool
        The longer pulse means -1.
    """

    channel: int
    minimum: int = 1100
    trim: int = 1500
    maximum: int = 1900
    reversed: bool = False

    def __post_init__(self) -> None:
        if not 1 <= self.channel <= 32:
            raise ValueError(f"servo channel {self.channel}: must be 1 to 32")
        if not self.minimum < self.maximum or not self.minimum <= self.trim <= self.maximum:
            raise ValueError(
                f"servo channel {self.channel}: needs minimum <= trim <= maximum, "
                f"got {self.minimum}, {self.trim}, {self.maximum}"
            )


class MavlinkSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of one MAVLink link.

    Attributes
    ----------
    url : str
        As pymavlink writes it: ``udpin:host:port``, ``udpout:…``, ``tcp:…``, ``tcpin:…``,
        ``/dev/ttyS1,57600``. Empty for a log.
    system : int or None
        The vehicle's system id; ``None``: the first system whose autopilot sends a heartbeat.
    components : frozenset of int or None
        The vehicle's components to believe; ``None``: all but gimbals and cameras, whose attitude is not the
        vehicle's.
    rates : dict[str, float]
        Messages to ask for, by name, in hertz.
    servos : tuple of ServoCalibration
        Without any, SERVO_OUTPUT_RAW is not used.
    hud : frozenset
        What to take from VFR_HUD. Empty by default: it repeats what GNSS and the autopilot's filter said.
    altitudes : frozenset
        Messages whose altitude is taken: what the autopilot's filter made of its barometer and GNSS. Empty by default.
    geoid_height : float or None
        Metres of the geoid (mean sea level) above the WGS 84 ellipsoid here; without it the altitude of a
        beacon that is given above the ellipsoid stays unknown.
    own_component : int
        The component id that the link sends as.
    signing_key_file : str
        When set, a file of 32 bytes (or 64 hexadecimal digits); what is not signed with it is refused.
    """

    url: str
    system: int | None = None
    components: frozenset[int] | None = None
    rates: dict[str, float] = msgspec.field(default_factory=lambda: dict(DEFAULT_RATES))
    servos: tuple[ServoCalibration, ...] = ()
    hud: frozenset[Literal["groundspeed", "altitude", "heading"]] = frozenset()
    altitudes: frozenset[Literal["ALTITUDE", "GLOBAL_POSITION_INT"]] = frozenset()
    geoid_height: float | None = None
    own_component: int = ONBOARD_COMPONENT
    signing_key_file: str = ""
