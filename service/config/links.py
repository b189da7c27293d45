"""The links: where the bytes come from. One process each."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from service.config.section import Flag, Name, Number, Positive, Section, Whole, shown


def _scalar(value: Any) -> Any:
    if not isinstance(value, str | bool | int | float):
        raise PydanticCustomError(
            "scalar", "needs text, a number, true or false, got {got}", {"got": shown(value)}
        )
    return value


Option = Annotated[Any, BeforeValidator(_scalar)]


class ServoCalibration(Section):
    """What the pulse of one servo output means, from -1 to 1."""

    channel: Annotated[Whole, Field(ge=1, le=32)]
    """Output as SERVO_OUTPUT_RAW numbers it, from 1."""
    low: Annotated[Whole, Field(ge=500, le=2500)] = 1100
    """Pulse at -1, µs."""
    trim: Annotated[Whole, Field(ge=500, le=2500)] = 1500
    """Pulse at 0, µs."""
    high: Annotated[Whole, Field(ge=500, le=2500)] = 1900
    """Pulse at 1, µs."""
    reversed: Flag = False
    """The channel turns the other way: the sign is changed."""

    @model_validator(mode="after")
    def _ordered(self) -> ServoCalibration:
        if not self.low <= self.trim <= self.high or self.low == self.high:
            raise PydanticCustomError(
                "servo",
                "needs low <= trim <= high, got {low}, {trim}, {high}",
                {"low": self.low, "trim": self.trim, "high": self.high},
            )
        return self


class MavlinkLink(Section):
    """A MAVLink connection: UDP, TCP or serial."""

    name: Name
    """What sensors, logs and status call this link."""
    kind: Literal["mavlink"]
    """Always "mavlink" for this kind of link."""
    url: Annotated[str, Field(min_length=1)]
    """As pymavlink writes it: udpin:0.0.0.0:14550, udpout:…, tcp:host:port, tcpin:…, /dev/ttyACM0,115200."""
    system: Annotated[Whole, Field(ge=1, le=255)] | None = None
    """Listen only to this MAVLink system; without it: to the first autopilot heard."""
    components: tuple[Annotated[Whole, Field(ge=1, le=255)], ...] = ()
    """Listen only to these MAVLink components; empty: to all of the system."""
    signing_key_file: str = ""
    """File with the signing key, 32 bytes or 64 hexadecimal digits.

    When set, unsigned or badly signed messages are refused and counted."""
    send: Literal["none", "odometry", "gps_input", "global_position_sensor"] = "none"
    """What goes back to the autopilot."""
    rates: dict[str, Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=1000)]] = Field(
        default_factory=dict
    )
    """Messages to ask for beside the usual ones and how often, Hz: { RAW_IMU = 50 }; 0 asks for none."""
    servo: tuple[ServoCalibration, ...] = ()
    """Calibration of SERVO_OUTPUT_RAW, one [[link.servo]] for each output that moves the vehicle."""
    hud: tuple[Literal["groundspeed", "altitude", "heading"], ...] = ()
    """What to take from VFR_HUD, where the vehicle sends nothing better.

    It repeats GNSS and the autopilot's own filter: used beside those it counts twice."""
    altitudes: tuple[Literal["ALTITUDE", "GLOBAL_POSITION_INT"], ...] = ()
    """Messages to take the altitude of, for a sensor of kind altitude that hears no barometer.

    It is what the autopilot's own filter makes of barometer and GNSS: used beside those it counts twice."""
    geoid_height: Annotated[Number, Field(ge=-120, le=120)] | None = None
    """Mean sea level above the WGS 84 ellipsoid at the site, m.

    RANGING_BEACON may give a beacon's altitude above the ellipsoid; without this it stays unknown."""


class Signal(Section):
    """Which signal of a DBC file is what."""

    signal: Annotated[str, Field(pattern=r"^[^.\s]+\.[^.\s]+$")]
    """MESSAGE.SIGNAL as the DBC file names them."""
    measures: Literal[
        "speed",
        "wheel_speed",
        "distance",
        "yaw_rate",
        "heading",
        "motor_speed",
        "range",
        "clearance",
        "altitude",
        "pressure",
    ]
    """What it measures: speed of the vehicle or of one wheel, distance that one wheel has rolled, …

    The wheels of one message are read together."""
    scale: Annotated[float, Field(strict=True, allow_inf_nan=False)] | None = None
    """Factor from the signal's unit to SI (m/s, rad/s, rad, m, Pa): 0.2778 for km/h, 0.0174533 for degrees.

    Default: by the unit that the DBC file gives."""
    offset: Number = 0.0
    """Added last, in SI units."""
    reversed: Flag = False
    """It counts the other way, as a car's yaw rate that is positive to the left: its sign is changed."""
    sigma: Positive | None = None
    """Standard deviation that its readings claim, SI; without it: what the [[sensor]] says."""
    index: Annotated[Whole, Field(ge=0, le=15)] = 0
    """Which wheel or motor, where there are several; of two wheels that give a yaw rate 0 is the left one."""
    beacon: Annotated[Whole, Field(ge=0, le=65535)] | None = None
    """For a range: the id of the beacon that it is measured to."""

    @model_validator(mode="after")
    def _consistent(self) -> Signal:
        if self.measures == "range" and self.beacon is None:
            raise PydanticCustomError("signal", 'measures = "range" needs beacon, the id of a [[beacon]]')
        if self.measures != "range" and self.beacon is not None:
            raise PydanticCustomError(
                "signal",
                'beacon belongs to measures = "range", and this is "{measures}"',
                {"measures": self.measures},
            )
        if self.scale == 0.0:
            raise PydanticCustomError(
                "signal", "scale: needs a number that is not 0: nothing would be left of it"
            )
        return self


class CanLink(Section):
    """A CAN bus: DroneCAN, or a car's bus read with a DBC file."""

    name: Name
    """What sensors, logs and status call this link."""
    kind: Literal["can"]
    """Always "can" for this kind of link."""
    interface: Annotated[str, Field(pattern=r"^[a-z0-9_]+$")] = "socketcan"
    """Any python-can interface (socketcan, slcan, udp_multicast, …), or mcast: ArduPilot SITL's bus."""
    channel: Annotated[str, Field(min_length=1)]
    """Channel of that interface: can0, vcan0, /dev/ttyACM0, 239.74.163.2."""
    protocol: Literal["dronecan", "dbc"] = "dronecan"
    """How the frames are understood."""
    dbc: str = ""
    """The DBC file, for protocol = "dbc"; a path relative to the configuration file, or absolute."""
    bitrate: Annotated[Whole, Field(ge=10_000, le=8_000_000)] | None = None
    """Bit/s, for interfaces that set it themselves (slcan, pcan); SocketCAN's is set by ip link."""
    options: dict[str, Option] = Field(default_factory=dict)
    """Further arguments for python-can's interface.

    For slcan sleep_after_open is 0 here; an adapter that restarts when it is opened needs
    { sleep_after_open = 2.0 }."""
    range_orientation: Annotated[Whole, Field(ge=0, le=101)] = 25
    """Where a range finder looks that does not say it itself, MAV_SENSOR_ORIENTATION: 25 down, 0 forward."""
    signal: tuple[Signal, ...] = ()
    """Which signal is what, one [[link.signal]] each, for protocol = "dbc"."""

    @model_validator(mode="after")
    def _dbc_has_its_facts(self) -> CanLink:
        if self.protocol == "dbc" and not (self.dbc and self.signal):
            raise PydanticCustomError(
                "dbc", 'protocol = "dbc" needs dbc (the file) and at least one [[link.signal]]'
            )
        return self


class ZenohLink(Section):
    """Samples that others publish under PREFIX/VEHICLE/sample/SENSOR."""

    name: Name
    """What sensors, logs and status call this link."""
    kind: Literal["zenoh"]
    """Always "zenoh" for this kind of link."""


Link = Annotated[MavlinkLink | CanLink | ZenohLink, Field(discriminator="kind")]
