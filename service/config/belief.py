"""The sections about the belief itself: vehicle, origin, start, area, motion, sensors, beacons, map, honesty."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, cast

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from service.config.section import (
    Flag,
    ForwardRight,
    Interval,
    Latitude,
    Longitude,
    Name,
    NorthEastDown,
    NotNegative,
    Number,
    Positive,
    Section,
    SigmaNorthEastDown,
    Whole,
)

MotionModel = Literal["constant_velocity", "unicycle", "drift", "inertial"]
SensorKind = Literal[
    "position",
    "velocity",
    "range",
    "bearing",
    "range_bearing",
    "heading",
    "altitude",
    "terrain",
    "scan",
    "speed",
]
SlowState = Literal["scale", "bias", "delay"]
Association = Literal["known", "unknown"]


class Vehicle(Section):
    """Which vehicle this is and how it moves."""

    name: Name
    """Its name in every key: beliefd/v1/NAME/estimate."""
    motion: MotionModel = "unicycle"
    """Motion model: unicycle for whatever drives with its nose ahead; constant_velocity for a tag without odometry."""


class Origin(Section):
    """Where north = east = down = 0. Without it: learned from the first fix or from GPS_GLOBAL_ORIGIN."""

    latitude: Latitude
    """Degrees, WGS 84."""
    longitude: Longitude
    """Degrees, WGS 84."""
    altitude: Number = 0.0
    """Metres above mean sea level."""


class Start(Section):
    """What is known of the pose when the daemon starts."""

    mode: Literal["given", "global", "first_fix"]
    """given: about position; global: anywhere in [area]; first_fix: where the first position fix says.

    Default: given with a position, first_fix without."""
    position: NorthEastDown | None = None
    """Metres north, east and down of the origin."""
    heading: (
        Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-2 * math.pi, le=2 * math.pi)] | None
    ) = None
    """Radians clockwise from true north; without it: unknown."""
    sigma: SigmaNorthEastDown = (0.5, 0.5, 0.5)
    """Standard deviation of the position, metres north, east, down."""
    sigma_heading: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=math.pi)] | None = None
    """Standard deviation of the heading, rad.

    Default: 0.1 with a heading; without one the heading could be any."""

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        given = dict(cast("dict[str, Any]", data))
        given.setdefault("mode", "given" if given.get("position") is not None else "first_fix")
        if given.get("heading") is not None:
            given.setdefault("sigma_heading", 0.1)
        return given

    @model_validator(mode="after")
    def _consistent(self) -> Start:
        if self.mode == "given" and self.position is None:
            raise PydanticCustomError("start", 'mode = "given" needs a position (north, east, down)')
        if self.mode != "given" and self.position is not None:
            raise PydanticCustomError(
                "start", 'position belongs to mode = "given", and the mode is "{mode}"', {"mode": self.mode}
            )
        if self.heading is None and self.sigma_heading is not None:
            raise PydanticCustomError("start", "sigma_heading needs a heading beside it")
        return self


class Area(Section):
    """Bounds for a global start."""

    north: Interval
    """Lowest and highest north, metres."""
    east: Interval
    """Lowest and highest east, metres."""


class Motion(Section):
    """Process noise of the motion model, and where its inputs come from."""

    speed_noise: NotNegative = 0.1
    """Noise of the speed, m per √s: after t seconds the distance is uncertain by speed_noise·√t metres."""
    yaw_rate_noise: NotNegative = 0.02
    """Noise of the yaw rate, rad per √s: after t seconds the heading is uncertain by yaw_rate_noise·√t."""
    slip_noise: NotNegative = 0.05
    """Noise of the distance in proportion to speed: sigma of the speed is this share of it, per √s."""
    turn_noise: NotNegative = 0.01
    """Noise of the turn in proportion to yaw rate: sigma of the rate is this share of it, per √s."""
    gyro_bias_walk: NotNegative = 1e-4
    """Random walk of the gyro's bias, rad/s per √s."""
    gyro_bias_sigma: NotNegative = 0.01
    """What the gyro's bias may be at the start, rad/s (one standard deviation)."""
    odometry_scale_walk: NotNegative = 1e-4
    """Random walk of the odometry's scale, per √s."""
    odometry_scale_sigma: NotNegative = 0.02
    """What the odometry's scale may be off by at the start (one standard deviation; 0.02 is 2 %)."""
    acceleration_noise: NotNegative = 0.7
    """For constant_velocity: noise of the acceleration, m/s per √s: how fast the velocity wanders."""
    velocity_sigma: NotNegative = 1.0
    """For constant_velocity: what the velocity may be at the start, m/s on each axis (one standard deviation)."""
    timing_sigma: NotNegative = 0.06
    """For constant_velocity: how well the latency of the measurements is known, s; without odometry nothing tells it.

    So many seconds of its way is the published region wider along the velocity."""
    dimensions: Literal[2, 3] = 2
    """For constant_velocity: 2 on the plane, 3 with down and its velocity."""
    vertical_noise: NotNegative | None = None
    """For constant_velocity in 3 dimensions: acceleration_noise of the vertical axis; without it the same."""
    vertical_sigma: NotNegative | None = None
    """For constant_velocity in 3 dimensions: velocity_sigma of the vertical axis; without it the same."""
    speed_from: Annotated[str, Field(min_length=1)] = "auto"
    """Source of the speed: a message name as the wire has it (WHEEL_DISTANCE, esc.Status, …), sensors, or auto.

    sensors: every [[sensor]] of kind speed, weighted by its sigma and brought to the centre from its lever; of auto
    they come after an odometer's distances, before single speeds. A speed that is no part of it is compared with it."""
    yaw_rate_from: Annotated[str, Field(min_length=1)] = "auto"
    """Source of the yaw rate: a message name (RAW_IMU, HIGHRES_IMU, ahrs.RawIMU, …), wheels, or auto."""
    yaw_rate_delay_ms: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=500)] = 0.0
    """By how much a yaw rate of a gyro is older than its stamp, ms: what it is filtered with delays it.

    ArduPilot filters the gyros of rovers and boats at 4 Hz (INS_GYRO_FILTER), which takes 56 ms."""
    wheel_track: Positive | None = None
    """Distance between the left and the right wheels, metres: yaw rate from two wheels that differ."""
    wheel_radius: Positive | None = None
    """Radius of the driven wheels, metres: speed from motor revolutions (esc.Status, RPM)."""
    throttle_channel: Annotated[Whole, Field(ge=1, le=32)] | None = None
    """Actuator that drives, counted from 1: its command is the speed when nothing better is heard."""
    throttle_speed: Positive = 1.0
    """Speed at a command of 1 on throttle_channel, m/s."""


class Sensor(Section):
    """One kind of reading that corrects the belief, and how far it can be trusted."""

    kind: SensorKind
    """What is measured."""
    link: Name | None = None
    """Name of the link it comes by; without it: any."""
    source: Annotated[str, Field(min_length=1)] | None = None
    """Only readings that the wire names so (GPS2_RAW, gnss.Fix2, sample/uwb); without it: any."""
    sigma: Positive | None = None
    """Standard deviation of an honest reading: m, m/s or rad. Without it: what the reading itself says."""
    claims: Flag = True
    """Whether what a reading says of its own standard deviation counts where it is more than sigma."""
    outliers: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, lt=1)] = 0.05
    """Share of readings that mean nothing."""
    estimate: tuple[SlowState, ...] = ()
    """Slow states to estimate with the pose: of ranges and speeds scale and bias, of altitudes bias, of positions and
    velocities delay.

    A receiver's positions and velocities share one delay; it shows only where odometry tells how the vehicle moves."""
    delay_ms: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=10_000)] = 0.0
    """Known latency before the stamp, ms (ArduPilot SITL GPS: 90)."""
    scale_sigma: NotNegative = 0.05
    """What an estimated scale may be off by at the start (one standard deviation)."""
    delay_sigma: NotNegative = 0.1
    """What an estimated delay may be off by at the start, beyond delay_ms, seconds (one standard deviation)."""
    correlation_s: NotNegative | None = None
    """Seconds over which its errors stay alike: readings closer together count as one.

    Default: 1 for position, velocity, heading and altitude, 0.2 for speed, 0 (every reading counts for itself) for all
    others. Of a position
    above 0, what lasts of its error for minutes is learned, or (without odometry, or with an
    unknown delay) added to what is published. Of landmarks it counts for
    each thing seen; without names, for what is seen where the thing seen before is expected."""
    bias_sigma: NotNegative | None = None
    """What an estimated bias may be at the start, in the reading's unit (one standard deviation).

    Default: 0.2 m of a range, where every beacon has its own; 100 m of an altitude, the weather; 0.1 m/s of a speed."""
    bias_walk: NotNegative | None = None
    """Random walk of an estimated bias, in the reading's unit per √s.

    Default: 0.003 of ranges, 0.02 of altitudes, 0.001 of speeds."""
    lever: ForwardRight | None = None
    """Of a speed: where it is measured, metres forward and right of the vehicle's centre.

    A wheel at the side goes slower when the vehicle turns to that side. Default: at the centre."""
    index: Annotated[Whole, Field(ge=0, le=255)] | None = None
    """Of a speed: which wheel or motor of those that one message says, from 0; without it: the mean of all."""
    nlos: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, lt=0.9)] = 0.0
    """Of ranges: share of readings that are too long, because something stands in the way."""
    nlos_length: Positive = 1.0
    """By how much those are too long on average, metres."""
    declination_deg: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-180, le=180)] = 0.0
    """For a magnetic heading: degrees that magnetic north lies east of true north."""
    sigma_bearing: Positive | None = None
    """For range_bearing: standard deviation of the bearing, rad; sigma is that of the distance."""
    association: Association = "known"
    """Of landmarks: known, by the number that the reading says; unknown: any of the map, whatever it says."""
    beacons: tuple[Annotated[Whole, Field(ge=0, le=65535)], ...] | None = None
    """Only ranges to these beacons; without it: to every [[beacon]]."""


class Beacon(Section):
    """One beacon or anchor that ranges are measured to."""

    id: Annotated[Whole, Field(ge=0, le=65535)]
    """Its number on the wire."""
    position: NorthEastDown | None = None
    """Metres north, east and down of the origin."""
    latitude: Latitude | None = None
    """Degrees, WGS 84; instead of position."""
    longitude: Longitude | None = None
    """Degrees, WGS 84; instead of position."""
    altitude: Number | None = None
    """Metres above mean sea level; instead of position."""

    @model_validator(mode="after")
    def _one_place(self) -> Beacon:
        geodetic = (self.latitude, self.longitude, self.altitude)
        given = sum(value is not None for value in geodetic)
        if (self.position is None) == (given == 0) or given not in (0, 3):
            raise PydanticCustomError(
                "beacon",
                "needs either position (north, east, down), or latitude, longitude and altitude",
            )
        return self


class Map(Section):
    """What is known of the surroundings."""

    terrain: str = ""
    """Elevation: .hgt(.zip) or GeoTIFF; a path relative to the configuration file, or absolute."""
    occupancy: str = ""
    """Occupancy grid: ROS map .yaml with its .pgm or .png."""
    landmarks: str = ""
    """Landmarks: CSV with a first line id,north,east, in metres."""


class Honesty(Section):
    """What keeps the belief honest. Each can be switched off, to see what it is worth."""

    hypotheses: bool = True
    """Hold several hypotheses apart while the belief has several modes, and publish each."""
    recovery: bool = True
    """Notice that the belief is lost, and search for the place anew."""
    trust: bool = True
    """Flag a sensor that disagrees with all others, and ignore it until it has earned trust again."""
    noise_learning: bool = True
    """Learn how much of the noise that is stated for motion and sensors there really is.

    What a position's delay_ms is off by is learned, too."""
    lasting_errors: bool = True
    """Learn the part of a receiver's error that lasts for a minute, beside where the vehicle is."""
    motion_mode: bool = True
    """Tell standing still and slipping from moving, and treat the odometry accordingly."""
