"""From MAVLink messages to samples: who is believed, which handler reads what, what is counted.

To add a message: write its handler beside its relatives (:mod:`~drivers.mavlink.inertial`,
:mod:`~drivers.mavlink.gnss`, …) and name it in :func:`handlers_of`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from drivers.clock import DeviceClocks
from drivers.mavlink.air import Hud, altitude, global_position, scaled_pressure
from drivers.mavlink.control import Servos, heartbeat, position_target
from drivers.mavlink.dialect import IDENTIFIERS, Message
from drivers.mavlink.gnss import Receiver, global_origin
from drivers.mavlink.inertial import attitude, highres_imu, raw_imu, scaled_imu
from drivers.mavlink.moment import Handler, Moment
from drivers.mavlink.ranging import Beacons, distance_sensor
from drivers.mavlink.settings import MavlinkSettings
from drivers.mavlink.wheels import Odometry, Tachometers
from drivers.plausibility import implausible
from drivers.sample import Sample

NO_AUTOPILOT = 8  # MAV_AUTOPILOT_INVALID: what a ground station, a gimbal or a companion says
GIMBALS = frozenset({154, *range(171, 176)})
CAMERAS = frozenset(range(100, 106))


def handlers_of(settings: MavlinkSettings) -> dict[str, Callable[[], Handler]]:
    """Return what makes a handler for each message that these settings want, by message name.

    Each sender gets a handler of its own, so one that remembers (a receiver, a wheel controller) remembers
    one.
    """
    handlers: dict[str, Callable[[], Handler]] = {
        "HEARTBEAT": lambda: heartbeat,
        "HIGHRES_IMU": lambda: highres_imu,
        "RAW_IMU": lambda: raw_imu,
        "SCALED_IMU": lambda: scaled_imu,
        "SCALED_IMU2": lambda: scaled_imu,
        "SCALED_IMU3": lambda: scaled_imu,
        "ATTITUDE": lambda: attitude,
        "GPS_RAW_INT": Receiver,
        "GPS2_RAW": Receiver,
        "GPS_GLOBAL_ORIGIN": lambda: global_origin,
        "WHEEL_DISTANCE": Odometry,
        "RPM": Tachometers,
        "RANGING_BEACON": lambda: Beacons(settings.geoid_height),
        "DISTANCE_SENSOR": lambda: distance_sensor,
        "SCALED_PRESSURE": lambda: scaled_pressure,
        "SCALED_PRESSURE2": lambda: scaled_pressure,
        "SCALED_PRESSURE3": lambda: scaled_pressure,
        "POSITION_TARGET_LOCAL_NED": lambda: position_target,
    }
    if settings.servos:
        handlers["SERVO_OUTPUT_RAW"] = lambda: Servos(settings.servos)
    if settings.hud:
        handlers["VFR_HUD"] = lambda: Hud(settings.hud)
    if "ALTITUDE" in settings.altitudes:
        handlers["ALTITUDE"] = lambda: altitude
    if "GLOBAL_POSITION_INT" in settings.altitudes:
        handlers["GLOBAL_POSITION_INT"] = lambda: global_position
    return handlers


class Decoder:
    """Turns the messages of one link into samples.

    Parameters
    ----------
    link_name : str
        As in the configuration; goes into every sample.
    settings : MavlinkSettings
        Whom to believe and what to want.

    Attributes
    ----------
    wanted : frozenset[int]
        Ids of the messages that it can use; others need not be decoded.
    malformed : Counter[str]
        Fields that were refused as broken, by ``MESSAGE.field``.
    unusable : Counter[str]
        Fields by which a sound message said that it has nothing usable, by ``MESSAGE.field``.
    ignored : Counter[str]
        Well-formed messages from others than the vehicle, by message.
    messages, samples : int
        Messages believed, samples made of them.
    vehicle : int or None
        The vehicle's system id, once known.
    autopilot : int or None
        MAV_AUTOPILOT of the vehicle's last heartbeat.
    """

    def __init__(self, link_name: str, settings: MavlinkSettings) -> None:
        self._link = link_name
        self._settings = settings
        self._makers = handlers_of(settings)
        self._handlers: dict[tuple[str, int, int], Handler] = {}
        self._clocks: dict[tuple[int, int], DeviceClocks] = {}
        self._autopilot_at: tuple[int, int] | None = None
        self.wanted = frozenset(IDENTIFIERS[name] for name in self._makers)
        self.malformed: Counter[str] = Counter()
        self.unusable: Counter[str] = Counter()
        self.ignored: Counter[str] = Counter()
        self.messages = 0
        self.samples = 0
        self.vehicle: int | None = settings.system
        self.autopilot: int | None = None

    def decode(self, message: Message, received_ns: int) -> list[Sample]:
        """Return the samples in one message; none when it is not from the vehicle or says nothing usable.

        Parameters
        ----------
        message : Message
            As :meth:`drivers.mavlink.frames.Frame.message` gives it.
        received_ns : int
            When its bytes arrived, nanoseconds on the clock that the samples shall have.
        """
        name, system, component, fields = message
        maker = self._makers.get(name)
        if maker is None or not self._believed(message):
            self.ignored[name] += 1
            return []
        self.messages += 1
        handler = self._handlers.get((name, system, component))
        if handler is None:
            handler = self._handlers[name, system, component] = maker()
        clocks = self.clocks(system, component)
        moment = Moment(name, received_ns, clocks, self.autopilot, self.malformed, self.unusable)
        samples: list[Sample] = []
        for time, reading in handler(fields, moment):
            wrong = implausible(reading)
            if wrong is None:
                samples.append(Sample(time, received_ns, self._link, name, reading))
            else:
                moment.refuse(wrong)
        self.samples += len(samples)
        return samples

    def clocks(self, system: int, component: int) -> DeviceClocks:
        """Return the clocks of one component."""
        clocks = self._clocks.get((system, component))
        if clocks is None:
            clocks = self._clocks[system, component] = DeviceClocks()
        return clocks

    @property
    def autopilot_address(self) -> tuple[int, int] | None:
        """System and component of the autopilot, once its heartbeat was heard."""
        return self._autopilot_at

    @property
    def main_clocks(self) -> DeviceClocks | None:
        """The clocks to report: the autopilot's, else those of whoever spoke first."""
        if self._autopilot_at is not None:
            return self._clocks.get(self._autopilot_at)
        return next(iter(self._clocks.values()), None)

    def is_of_vehicle(self, system: int, component: int) -> bool:
        """Whether this sender is of the vehicle, as far as its address tells."""
        components = self._settings.components
        if components is None:
            if component in GIMBALS or component in CAMERAS:
                return False
        elif component not in components:
            return False
        return self.vehicle is None or system == self.vehicle

    def _believed(self, message: Message) -> bool:
        """Whether the message is from the vehicle.

        Where no system is named, the first autopilot that is heard says who that is; until then every system
        is believed, so that a log without heartbeats can be read.
        """
        if not self.is_of_vehicle(message.system, message.component):
            return False
        if message.name != "HEARTBEAT":
            return True
        if message.fields.autopilot == NO_AUTOPILOT:
            return False
        self.vehicle = message.system
        self.autopilot = message.fields.autopilot
        self._autopilot_at = (message.system, message.component)
        return True
