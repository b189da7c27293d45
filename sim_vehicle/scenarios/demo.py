"""``demo``: the whole rover on both links, whose satellites fail after 20 s."""

from __future__ import annotations

import math
from dataclasses import replace

from sim_vehicle.chance import stream
from sim_vehicle.clock import BoardClock
from sim_vehicle.faults import Window
from sim_vehicle.fitting import BusSettings
from sim_vehicle.scenario import Scenario, SensorFacts
from sim_vehicle.scenarios import beacons
from sim_vehicle.sensors import BarometerSettings, Cadence, CompassSettings, GnssSettings
from sim_vehicle.wire import WireSettings

DESCRIPTION = (
    "rover with wheels, gyro, compass and 4 beacons by MAVLink, GNSS by DroneCAN that is lost after 20 s"
)
GNSS_LOST_AFTER = 20.0
_DECLINATION = math.radians(1.9)


def draw(seed: int) -> Scenario:
    """Return the scenario: the rover and the yard of ``beacons``, with compass, barometer and a CAN bus."""
    chance = stream(seed, "scenario demo")
    horizontal = 19.6e-6
    gnss = GnssSettings(
        Cadence(8.0, phase=0.03, latency=0.004, jitter=0.002),
        delay=0.09,
        outages=(Window(start=GNSS_LOST_AFTER),),
    )
    return replace(
        beacons.draw(seed),
        name="demo",
        description=DESCRIPTION,
        seconds=60.0,
        compass=CompassSettings(
            Cadence(25.0, phase=0.003, latency=0.002),
            earth=(horizontal * math.cos(_DECLINATION), horizontal * math.sin(_DECLINATION), 45.0e-6),
            noise=0.3e-6,
            disturbance=math.radians(1.5),
            disturbance_correlation=15.0,
        ),
        barometer=BarometerSettings(Cadence(10.0, phase=0.005, latency=0.005), noise=3.0, drift=10.0),
        bus=BusSettings(
            wire=WireSettings(latency=0.0005, jitter=0.0003, spacing=0.00013),
            clock=BoardClock(float(chance.uniform(5.0, 300.0)), 20e-6 * float(chance.standard_normal())),
            gnss=gnss,
            barometer=BarometerSettings(Cadence(10.0, phase=0.007, latency=0.005), noise=3.0, drift=10.0),
            motor_rate=20.0,
            clearance_rate=10.0,
        ),
        facts=(
            *beacons.draw(seed).facts,
            SensorFacts("position", "bus", sigma=round(gnss.sigma, 3), outliers=0.02, delay_ms=90.0),
            SensorFacts("velocity", "bus", sigma=gnss.velocity_noise, outliers=0.02, delay_ms=90.0),
            # The needle's error lasts for many readings; told larger, they count as if independent.
            SensorFacts(
                "heading",
                "autopilot",
                sigma=0.1,
                outliers=0.02,
                declination_deg=round(math.degrees(_DECLINATION), 3),
            ),
        ),
    )
