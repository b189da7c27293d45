"""``beacons``: wheels, a gyro, ranges, no satellites: do four beacons keep a dead-reckoning rover found."""

from __future__ import annotations

from sim_vehicle.chance import stream
from sim_vehicle.clock import BoardClock
from sim_vehicle.rover import SkidRover
from sim_vehicle.scenario import Scenario, SensorFacts
from sim_vehicle.scenarios import yard
from sim_vehicle.sensors import Cadence, InertialSettings, RangerSettings, WheelSettings
from sim_vehicle.wire import WireSettings

DESCRIPTION = "skid rover in a yard, 180 s: wheel odometry and gyro with bias, ranges to 4 beacons, GNSS off"
TRACK = 0.5
RANGE_SIGMA = 0.3


def draw(seed: int) -> Scenario:
    """Return the scenario with course, beacons, biases, scales and clocks drawn from the seed."""
    chance = stream(seed, "scenario beacons")
    course, start = yard.course(chance)
    sites = yard.corner_beacons(chance)
    scale, imbalance = 1.0 + 0.02 * chance.standard_normal(), 0.005 * chance.standard_normal()
    bias = 0.006 * chance.standard_normal(3)
    return Scenario(
        name="beacons",
        description=DESCRIPTION,
        seconds=180.0,
        origin=yard.ORIGIN,
        rover=SkidRover(track=TRACK),
        track=TRACK,
        course=course,
        start=start,
        belief=yard.told(start, 0.5, 0.1, chance),
        clock=BoardClock(
            uptime=float(chance.uniform(20.0, 600.0)), drift=20e-6 * float(chance.standard_normal())
        ),
        mavlink=WireSettings(latency=0.002, jitter=0.004, loss=0.001),
        wheels=WheelSettings(
            Cadence(50.0, phase=0.004, latency=0.002),
            scale=float(scale),
            imbalance=float(imbalance),
            slip=0.03,
            slip_correlation=1.0,
            burst_interval=60.0,
            burst_length=1.0,
            burst_slip=0.2,
        ),
        inertial=InertialSettings(
            Cadence(100.0, phase=0.001, latency=0.001),
            gyro_bias=(float(bias[0]), float(bias[1]), float(bias[2])),
            gyro_bias_walk=1e-4,
            gyro_noise=2e-4,
            accelerometer_noise=2e-3,
        ),
        ranger=RangerSettings(
            Cadence(20.0, phase=0.01, latency=0.01, jitter=0.005, dropout=0.02),
            beacons=sites,
            sigma=RANGE_SIGMA,
            outliers=0.02,
            outlier_mean=4.0,
        ),
        facts=(SensorFacts("range", "autopilot", sigma=RANGE_SIGMA, outliers=0.02),),
        motion={
            # slip of 3 % for a second at a time, and now and then a burst, at the yard's 1 to 2 m/s
            "speed_noise": 0.06,
            "slip_noise": 0.02,
            # the gyro has 2e-4: by the default of the configuration it would be a hundred times as much, and five
            # minutes of dead reckoning teach nobody better
            "yaw_rate_noise": 0.005,
            "turn_noise": 0.005,
            "gyro_bias_walk": 1e-4,
            "gyro_bias_sigma": 0.006,
            "odometry_scale_sigma": 0.02,
        },
    )
