"""The estimator without processes or clocks: samples in, estimates out."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import msgspec
import numpy as np
import pytest

from drivers.sample import (
    AnyReading,
    GeodeticPosition,
    Inertial,
    LocalPosition,
    Odometer,
    Origin,
    Range,
    Sample,
)
from service.config import Configuration, validated
from service.estimate import Estimate, HealthState
from service.estimator import Estimator
from service.estimator.records import MOST_RECORDS, OTHERS
from service.geodesy import LocalFrame

SECOND = 1_000_000_000
MS = 1_000_000
BEACONS = {1: (30.0, 30.0, 0.0), 2: (30.0, -30.0, 0.0), 3: (-30.0, 30.0, 0.0), 4: (-30.0, -30.0, 0.0)}
ORIGIN = {"latitude": 51.0, "longitude": 4.0, "altitude": 10.0}


def configuration(**sections: Any) -> Configuration:
    file: dict[str, Any] = {
        "vehicle": {"name": "test"},
        "origin": ORIGIN,
        "start": {"position": [0.0, 0.0, 0.0], "heading": 0.0},
        "link": [{"name": "l", "kind": "mavlink", "url": "udpin:127.0.0.1:0"}],
        "sensor": [{"kind": "range", "sigma": 0.3}],
        "beacon": [{"id": i, "position": list(p)} for i, p in BEACONS.items()],
    }
    file.update(sections)
    file = {name: section for name, section in file.items() if section is not None}
    return validated(file, Configuration, "test.toml")


class Drive:
    """A vehicle on a circle of 10 m radius at 1 m/s, measured by whatever the test asks for."""

    def __init__(self, seed: int, latency: int = 20 * MS) -> None:
        self.random = np.random.default_rng(seed)
        self.latency = latency

    @staticmethod
    def pose(t: float) -> tuple[float, float, float]:
        angle = t / 10.0
        return 10.0 * math.sin(angle), 10.0 - 10.0 * math.cos(angle), math.remainder(angle, math.tau)

    def sample(self, t: float, reading: AnyReading, source: str = "S") -> Sample:
        time = round(t * SECOND)
        return Sample(time, time + self.latency, "l", source, reading)

    def controls(self, t: float) -> list[Sample]:
        return [
            self.sample(t, Odometer((t,)), "WHEEL_DISTANCE"),
            self.sample(t, Inertial(angular_velocity=(0.0, 0.0, 0.1)), "HIGHRES_IMU"),
        ]

    def range_to(self, t: float, beacon: int, sigma: float = 0.3) -> Sample:
        north, east, _ = self.pose(t)
        n, e, _ = BEACONS[beacon]
        return self.sample(t, Range(beacon, math.hypot(north - n, east - e) + sigma * self.random.normal()))


def run(
    estimator: Estimator, samples: list[Sample], seconds: float, rate: float = 50.0
) -> Iterator[Estimate]:
    """Tick ``estimator`` through ``samples``, each taken when it was received."""
    waiting = sorted(samples, key=lambda sample: sample.received)
    index = 0
    for k in range(1, round(seconds * rate) + 1):
        now = round(k * SECOND / rate)
        batch: list[Sample] = []
        while index < len(waiting) and waiting[index].received <= now:
            batch.append(waiting[index])
            index += 1
        estimator.ingest(batch)
        yield estimator.tick(now, now, 2000)


def ranged_drive(seed: int, seconds: float) -> list[Sample]:
    drive = Drive(seed)
    samples: list[Sample] = []
    for k in range(round(seconds * 20)):
        t = k / 20
        samples += drive.controls(t)
        if k % 4 == 0:
            samples.append(drive.range_to(t, k // 4 % 4 + 1))
    return samples


def error(estimate: Estimate) -> float:
    north, east, _ = Drive.pose(estimate.monotonic_ns / SECOND)
    assert estimate.position[0] is not None
    assert estimate.position[1] is not None
    return math.hypot(estimate.position[0] - north, estimate.position[1] - east)


def test_follows_a_circle_by_ranges_within_its_own_region() -> None:
    """Six seeds: RMSE of each below 0.3 m, and nine of ten ticks inside the circle that claims 95 %."""
    for seed in range(6):
        estimates = [
            e for e in run(Estimator(configuration(), seed=seed), ranged_drive(seed, 20), 20) if e.radius95
        ]
        errors = np.array([error(e) for e in estimates])
        inside = np.mean([error(e) <= (e.radius95 or 0) for e in estimates])
        assert len(estimates) > 950
        assert math.sqrt(np.mean(errors**2)) < 0.3
        assert inside > 0.9
        assert estimates[-1].health is HealthState.TRACKING


def test_the_estimate_is_for_now_though_the_filter_is_behind() -> None:
    """Without noise in the ranges, one second of horizon costs nothing but the odometry's noise over it."""
    slow = configuration(loop={"horizon_ms": 1000.0})
    last = list(run(Estimator(slow), ranged_drive(1, 15), 15))[-1]
    assert error(last) < 0.5
    assert last.heading == pytest.approx(Drive.pose(15.0)[2], abs=0.15)
    assert last.velocity[0] == pytest.approx(math.cos(1.5), abs=0.2)
    assert last.velocity[1] == pytest.approx(math.sin(1.5), abs=0.2)


def test_same_samples_and_seed_give_the_same_bytes_and_another_seed_others() -> None:
    def positions(seed: int) -> list[Any]:
        return [e.position for e in run(Estimator(configuration(), seed=seed), ranged_drive(3, 5), 5)]

    assert positions(7) == positions(7)
    assert positions(7) != positions(8)


def test_order_of_arrival_does_not_matter_within_the_horizon() -> None:
    """Ranges that arrive up to 180 ms late and shuffled give the same belief as ranges in order."""
    samples = ranged_drive(4, 8)
    random = np.random.default_rng(0)
    shuffled = [
        Sample(s.time, s.time + round(random.uniform(10, 180) * MS), s.link, s.source, s.reading)
        if isinstance(s.reading, Range)
        else s
        for s in samples
    ]
    assert [s.time for s in sorted(shuffled, key=lambda s: s.received)] != sorted(s.time for s in samples)
    ordered_last = list(run(Estimator(configuration()), samples, 8))[-1]
    shuffled_last = list(run(Estimator(configuration()), shuffled, 8))[-1]
    assert ordered_last.position == shuffled_last.position


def test_what_comes_seconds_late_is_fused_where_the_particles_were() -> None:
    """Ranges of the first four seconds come at the fifth: the belief then knows nearly what it knew with them in order.

    Without them it has only what wheels and gyro say of a start that was told with 0.5 m.
    """
    samples = ranged_drive(5, 8)
    held = [
        msgspec.structs.replace(s, received=5 * SECOND)
        if isinstance(s.reading, Range) and s.time < 4 * SECOND
        else s
        for s in samples
        if not isinstance(s.reading, Range) or s.time < 4 * SECOND
    ]
    late, never = Estimator(configuration()), Estimator(configuration(loop={"late_s": 0.0}))
    fused, blind = list(run(late, held, 8))[-1], list(run(never, held, 8))[-1]
    counts = {status.name: status for status in late.sensors(8 * SECOND)}
    assert late.caught_up >= 15
    assert late.drops.get("late", 0) == 0
    assert sum(status.accepted for status in counts.values()) >= 0.9 * late.caught_up
    assert never.drops["late"] == late.caught_up
    assert fused.radius95 < 0.6 * blind.radius95


def test_late_and_future_samples_are_counted_and_harmless() -> None:
    estimator = Estimator(configuration(loop={"late_s": 0.0}))
    good = list(run(estimator, ranged_drive(5, 6), 6))[-1]
    drive = Drive(0)
    late = drive.range_to(1.0, 1)
    future = Sample(100 * SECOND, 6 * SECOND, "l", "S", Range(1, 5.0))
    estimator.ingest([Sample(late.time, 6 * SECOND, "l", "S", Range(1, 5.0)), future])
    after = estimator.tick(6 * SECOND + 20 * MS, 6 * SECOND + 20 * MS, 2000)
    assert estimator.drops["late"] == 1
    assert estimator.drops["future"] == 1
    assert after.position[0] == pytest.approx(good.position[0], abs=0.1)


def test_waits_and_names_what_is_missing() -> None:
    estimator = Estimator(configuration())
    estimate = estimator.tick(SECOND, SECOND, 2000)
    assert estimate.health is HealthState.WAITING
    for word in ("odometry", "yaw rate", "range"):
        assert word in estimate.reason
    assert estimate.position == (None, None, None)
    assert estimate.radius95 is None
    assert estimator.cloud(100).shape == (0, 4)


def test_starts_at_the_first_fix_and_learns_its_origin_there() -> None:
    without_origin = configuration(
        origin=None, start={"mode": "first_fix"}, sensor=[{"kind": "position", "sigma": 1.0}], beacon=[]
    )
    estimator = Estimator(without_origin)
    drive = Drive(2)
    frame = LocalFrame.from_degrees(51.0, 4.0, 10.0)
    samples: list[Sample] = []
    for k in range(200):
        t = 1.0 + k / 20
        samples += drive.controls(t)
        north, east, _ = drive.pose(t)
        point = frame.geodetic_from_ned(north, east, 0.0)
        samples.append(drive.sample(t, GeodeticPosition(*point, sigma_horizontal=0.3)))
    estimates = list(run(estimator, samples, 11))
    assert estimates[0].health is HealthState.WAITING
    last = estimates[-1]
    north, east, _ = drive.pose(11.0)
    assert last.latitude is not None
    assert last.longitude is not None
    back = frame.ned_from_geodetic(math.radians(last.latitude), math.radians(last.longitude), 10.0)
    assert math.hypot(back[0] - north, back[1] - east) < 1.5
    assert last.altitude == pytest.approx(10.0, abs=2.0)


def test_a_configured_origin_is_not_overruled_by_a_message() -> None:
    estimator = Estimator(configuration(sensor=[{"kind": "position", "sigma": 1.0}]))
    drive = Drive(1)
    estimator.ingest([drive.sample(0.0, Origin(0.0, 0.0, 0.0))])
    estimates = list(run(estimator, [s for k in range(40) for s in drive.controls(k / 20)], 2))
    assert estimates[-1].latitude == pytest.approx(51.0, abs=1e-3)


def test_a_global_start_spreads_over_the_area_and_says_so() -> None:
    spread = configuration(start={"mode": "global"}, area={"north": [-100.0, 100.0], "east": [-50.0, 50.0]})
    drive = Drive(0)
    estimate = list(run(Estimator(spread), [s for k in range(10) for s in drive.controls(k / 20)], 0.6))[-1]
    assert estimate.position_covariance[0] == pytest.approx(200**2 / 12, rel=0.15)
    assert estimate.position_covariance[3] == pytest.approx(100**2 / 12, rel=0.15)
    assert estimate.heading_variance == pytest.approx(math.pi**2 / 3, rel=0.15)


def test_height_is_null_until_something_says_it() -> None:
    unknown = configuration(start={"mode": "global"}, area={"north": [-10.0, 10.0], "east": [-10.0, 10.0]})
    drive = Drive(0)
    estimate = list(run(Estimator(unknown), [s for k in range(10) for s in drive.controls(k / 20)], 0.6))[-1]
    assert estimate.position[2] is None
    assert estimate.position_covariance[5] is None


def test_without_odometry_the_region_grows_as_fast_as_it_might_have_moved() -> None:
    estimator = Estimator(configuration())
    estimates = list(run(estimator, ranged_drive(6, 5), 12))
    radii = [e.radius95 or 0.0 for e in estimates]
    assert radii[-1] > radii[round(5.0 * 50)] + 3.0
    assert estimates[-1].health is HealthState.DEAD_RECKONING


def test_the_count_never_exceeds_what_is_afforded() -> None:
    estimator = Estimator(configuration())
    samples = ranged_drive(7, 4)
    list(run(estimator, samples, 2))
    estimate = estimator.tick(2 * SECOND + 20 * MS, 0, 300)
    assert estimate.particles <= 300
    assert estimate.afforded == 300
    assert estimate.level == 1


def test_slow_states_come_out_with_their_sigma() -> None:
    """Odometry that reads 3 % short is found out by ranges."""
    drive = Drive(11)
    samples: list[Sample] = []
    for k in range(40 * 20):
        t = k / 20
        samples.append(drive.sample(t, Odometer((t / 1.03,)), "WHEEL_DISTANCE"))
        samples.append(drive.sample(t, Inertial(angular_velocity=(0.0, 0.0, 0.11)), "HIGHRES_IMU"))
        samples.append(drive.range_to(t, k % 4 + 1, 0.1))
    sensor = [{"kind": "range", "sigma": 0.1}]
    last = list(run(Estimator(configuration(sensor=sensor)), samples, 40))[-1]
    scale, sigma = last.biases["odometry_scale"]
    assert scale == pytest.approx(1.03, abs=max(4 * sigma, 0.005))
    bias, sigma = last.biases["gyro_bias"]
    assert bias == pytest.approx(0.01, abs=max(4 * sigma, 0.003))


def test_local_positions_of_others_are_fused() -> None:
    drive = Drive(8)
    samples: list[Sample] = []
    for k in range(100):
        t = k / 20
        samples += drive.controls(t)
        north, east, _ = drive.pose(t)
        samples.append(drive.sample(t, LocalPosition(north, east, -2.0, sigma_horizontal=0.2), "sample/uwb"))
    last = list(run(Estimator(configuration(sensor=[{"kind": "position"}])), samples, 5))[-1]
    assert error(last) < 0.4
    assert last.position[2] == pytest.approx(-2.0, abs=0.5)


def test_one_fix_said_twice_is_one_fix() -> None:
    """Two receivers with one stamp, or one heard by two links, make the belief no surer than one does."""

    def variance(sources: tuple[str, ...]) -> float:
        drive = Drive(8)
        samples: list[Sample] = []
        for k in range(100):
            t = k / 20
            samples += drive.controls(t)
            north, east, _ = drive.pose(t)
            if k % 20 == 0:
                samples += [drive.sample(t, LocalPosition(north, east, -2.0), name) for name in sources]
        last = list(run(Estimator(configuration(sensor=[{"kind": "position", "sigma": 0.3}])), samples, 5))[
            -1
        ]
        return (last.position_covariance[0] or 0.0) + (last.position_covariance[3] or 0.0)

    assert variance(("a", "b", "c", "d")) == pytest.approx(variance(("a",)), rel=0.15)


def test_a_reading_counts_once_though_two_sensors_ask_for_it() -> None:
    sensor = {"kind": "range", "sigma": 0.3}
    once, twice = (
        list(run(Estimator(configuration(sensor=sensors)), ranged_drive(3, 5), 5))[-1]
        for sensors in ([sensor], [sensor | {"source": "S"}, sensor])
    )
    assert twice.position_covariance == once.position_covariance


def test_the_height_is_no_surer_for_being_told_more_often() -> None:
    """A receiver's errors stay alike over a second: 20 fixes a second tell the height as well as two do."""

    def variance(every: int) -> float:
        drive = Drive(8)
        samples: list[Sample] = []
        for k in range(100):
            t = k / 20
            samples += drive.controls(t)
            if k % every == 0:
                north, east, _ = drive.pose(t)
                samples.append(drive.sample(t, LocalPosition(north, east, -2.0, 1.0, 1.0)))
        start = {"mode": "first_fix"}
        estimator = Estimator(configuration(start=start, sensor=[{"kind": "position"}]))
        return list(run(estimator, samples, 5))[-1].position_covariance[5] or 0.0

    assert variance(1) == pytest.approx(variance(10), rel=0.2)


def test_without_odometry_the_velocity_could_be_any() -> None:
    estimates = list(run(Estimator(configuration()), ranged_drive(6, 3), 6))
    driving, silent = estimates[140], estimates[-1]
    assert math.sqrt(driving.velocity_covariance[0] or 0.0) < 0.2
    assert math.sqrt((silent.velocity_covariance[0] or 0.0) + (silent.velocity_covariance[3] or 0.0)) > 1.9


def test_a_sensor_without_outliers_can_be_wrong_all_the_same() -> None:
    """Ranges that all read 15 m long: nothing fits them, and the belief says that it is lost."""
    drive = Drive(2)
    samples: list[Sample] = []
    for k in range(120):
        t = k / 20
        samples += drive.controls(t)
        north, east, _ = drive.pose(t)
        beacon = k % 4 + 1
        n, e, _ = BEACONS[beacon]
        samples.append(drive.sample(t, Range(beacon, math.hypot(north - n, east - e) + 15.0)))
    sensor = [{"kind": "range", "sigma": 0.3, "outliers": 0.0}]
    last = list(run(Estimator(configuration(sensor=sensor)), samples, 6))[-1]
    assert last.health is HealthState.LOST


def test_a_measurement_from_a_queue_does_not_date_the_start_back() -> None:
    """One range a minute old, kept in a socket while the loop was away: the belief starts now, as sure as told."""
    drive = Drive(0)
    fresh = [s for k in range(20) for s in drive.controls(100.0 + k / 20)]
    stale = Sample(40 * SECOND, 100 * SECOND, "l", "S", Range(1, 42.0))
    estimator = Estimator(configuration())
    estimator.ingest([stale, *fresh])
    estimate = estimator.tick(101 * SECOND, 0, 2000)
    assert estimate.radius95 is not None
    assert estimate.radius95 < 3.0
    assert estimator.drops == {"late": 1}
    assert [s.refused for s in estimator.sensors(101 * SECOND)] == [{"late": 1}]


def test_what_comes_before_the_first_fix_is_counted() -> None:
    sensor = [{"kind": "position"}, {"kind": "range"}]
    estimator = Estimator(configuration(start={"mode": "first_fix"}, sensor=sensor))
    drive = Drive(0)
    samples = [drive.range_to(t / 10, 1) for t in range(5)] + [drive.sample(0.5, LocalPosition(0.0, 0.0))]
    list(run(estimator, samples, 1))
    assert {s.name: s.refused for s in estimator.sensors(SECOND)}["range/l/1"] == {"before_start": 5}


def test_memory_is_bounded_while_it_waits_for_a_fix() -> None:
    """Ten minutes of gyro and wheels before any fix."""
    estimator = Estimator(configuration(start={"mode": "first_fix"}, sensor=[{"kind": "position"}]))
    drive = Drive(0)
    for k in range(0, 600 * 20, 20):
        estimator.ingest([s for j in range(20) for s in drive.controls((k + j) / 20)])
        estimator.tick(round((k + 20) / 20 * SECOND), 0, 100)
    controls = estimator._vehicle.controls
    assert len(controls._turn._times) < 200
    assert len(controls._distance._times) < 200


def test_beacons_without_number_do_not_fill_the_memory() -> None:
    estimator = Estimator(configuration())
    drive = Drive(0)
    samples = [drive.sample(0.1 + k * 1e-4, Range(1000 + k, 3.0)) for k in range(2000)]
    list(run(estimator, samples, 1))
    statuses = {s.name: s for s in estimator.sensors(SECOND)}
    assert len(statuses) == MOST_RECORDS + 1
    assert sum(sum(status.refused.values()) for status in statuses.values()) == 2000
    assert sum(statuses[OTHERS].refused.values()) > 1000


def test_a_reading_that_cannot_be_true_is_counted() -> None:
    estimator = Estimator(configuration(origin=None))
    drive = Drive(0)
    readings = (
        Range(1, math.nan),
        Range(1, 3.0, math.inf),
        Origin(math.nan, 0.0, 0.0),
        Origin(9.0, 0.0, 0.0),
    )
    estimator.ingest([drive.sample(0.1, reading) for reading in readings])
    assert estimator.drops == {"implausible": 4}
    assert "range" in estimator.tick(SECOND, 0, 100).reason


def test_readings_of_unknown_beacons_are_refused_with_a_reason() -> None:
    estimator = Estimator(configuration(origin=None))
    drive = Drive(1)
    samples = ranged_drive(1, 3) + [drive.sample(t / 10, Range(77, 12.0)) for t in range(10, 25)]
    list(run(estimator, samples, 3))
    status = {s.name: s for s in estimator.sensors(3 * SECOND)}
    assert status["range/l/77"].refused["no_beacon"] > 0
    assert status["range/l/1"].accepted > 0
    assert status["range/l/1"].innovation is not None


def test_a_crowd_of_measurements_is_thinned_evenly_and_said() -> None:
    """Five hundred ranges in one tick: sixty-four are weighed, the rest counted, and the estimate stays right."""
    estimator = Estimator(configuration())
    drive = Drive(3)
    samples = ranged_drive(3, 4)
    crowd = [drive.range_to(3.0 + k * 3e-5, k % 4 + 1) for k in range(500)]
    estimates = list(run(estimator, samples + crowd, 4))
    thinned = sum(status.refused.get("thinned", 0) for status in estimator.sensors(4 * SECOND))
    assert 350 <= thinned <= 500
    assert max(estimate.level for estimate in estimates) == 2
    assert error(estimates[-1]) < 0.4


def test_measurements_that_disagree_are_counted_as_outliers() -> None:
    estimator = Estimator(configuration())
    drive = Drive(5)
    samples = ranged_drive(5, 6)
    samples += [drive.sample(t / 10, Range(1, 95.0)) for t in range(20, 50, 5)]
    list(run(estimator, samples, 6))
    status = {s.name: s for s in estimator.sensors(6 * SECOND)}["range/l/1"]
    assert status.refused["outlier"] == 6
    assert status.accepted > 5


def test_a_sensor_that_was_never_heard_is_among_the_sensors() -> None:
    estimator = Estimator(configuration())
    assert [s.name for s in estimator.sensors(0)] == ["range/*"]
