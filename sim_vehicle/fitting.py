"""What is fitted on the CAN bus, as data (the nodes themselves are in :mod:`sim_vehicle.bus`)."""

from __future__ import annotations

from dataclasses import dataclass, field

from sim_vehicle.clock import BoardClock
from sim_vehicle.sensors import BarometerSettings, CompassSettings, GnssSettings, InertialSettings
from sim_vehicle.wire import WireSettings


@dataclass(frozen=True, slots=True)
class BusSettings:
    """What is on the bus.

    Attributes
    ----------
    wire : WireSettings
        The bus itself; ``spacing`` is what one frame takes, 0.13 ms at 1 Mbit/s.
    clock : BoardClock
        Of the sensor node.
    gnss, inertial, compass, barometer
        Sensors on the bus, apart from the autopilot's own; ``None``: not fitted.
    motor_rate : float
        esc.Status of both motors, esc.RawCommand and actuator.ArrayCommand, per second; 0: none.
    wheel_radius : float
        Metres; turns rim speed into the motors' revolutions.
    clearance_rate, clearance : float
        Readings per second of a range finder that looks down, and its height, metres; 0: none.
    """

    wire: WireSettings
    clock: BoardClock = field(default_factory=BoardClock)
    gnss: GnssSettings | None = None
    inertial: InertialSettings | None = None
    compass: CompassSettings | None = None
    barometer: BarometerSettings | None = None
    motor_rate: float = 0.0
    wheel_radius: float = 0.12
    clearance_rate: float = 0.0
    clearance: float = 0.35
