"""What a scenario is: everything about a vehicle, its site, its sensors and its misfortunes, as data."""

from __future__ import annotations

from dataclasses import dataclass, field

from sim_vehicle.clock import BoardClock
from sim_vehicle.course import Course
from sim_vehicle.faults import Fault
from sim_vehicle.fitting import BusSettings
from sim_vehicle.geodesy import Origin
from sim_vehicle.rover import Rover
from sim_vehicle.sensors import (
    BarometerSettings,
    CompassSettings,
    GnssSettings,
    InertialSettings,
    RangerSettings,
    WheelSettings,
)
from sim_vehicle.wire import WireSettings
from sim_vehicle.world import Pose


@dataclass(frozen=True, slots=True)
class StartBelief:
    """What an operator would tell the daemon about the start: wrong by as much as its sigmas say."""

    position: tuple[float, float, float]
    heading: float
    sigma: tuple[float, float, float]
    sigma_heading: float


@dataclass(frozen=True, slots=True)
class SensorFacts:
    """One ``[[sensor]]`` of the configuration that goes with the drive; the names are the configuration's.

    Without a ``sigma`` the daemon goes by what the readings claim.
    """

    kind: str
    link: str
    sigma: float | None
    outliers: float = 0.0
    delay_ms: float = 0.0
    declination_deg: float = 0.0
    source: str = ""
    estimate: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Event:
    """Something that a scorer wants to know the time of: seconds since the drive began, and a word."""

    time: float
    name: str


@dataclass(frozen=True, slots=True)
class Scenario:
    """One vehicle on one drive, with every parameter already drawn.

    Attributes
    ----------
    name, description : str
        What it is called; one line.
    seconds : float
        How long the drive is unless told otherwise.
    start, belief : Pose, StartBelief
        Where it stands in truth, and what is said about that.
    wheels, inertial, compass, barometer, ranger, gnss
        The autopilot's sensors; ``None``: not fitted.
    bus : BusSettings or None
        What is on the CAN bus.
    facts : tuple[SensorFacts, ...]
        True-to-life sigmas for the configuration.
    events : tuple[Event, ...]
        What befalls the drive, in order of time: when a fault begins, when a sensor is honest again.
    """

    name: str
    description: str
    seconds: float
    origin: Origin
    rover: Rover
    track: float
    course: Course
    start: Pose
    belief: StartBelief
    clock: BoardClock
    mavlink: WireSettings
    wheels: WheelSettings | None = None
    inertial: InertialSettings | None = None
    compass: CompassSettings | None = None
    barometer: BarometerSettings | None = None
    ranger: RangerSettings | None = None
    gnss: GnssSettings | None = None
    bus: BusSettings | None = None
    facts: tuple[SensorFacts, ...] = ()
    motion: dict[str, float] = field(default_factory=dict[str, float])
    faults: tuple[Fault, ...] = ()
    events: tuple[Event, ...] = ()
