"""The whole vehicle: order, independence of its parts, faults."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import replace
from typing import Any

import pytest
from pymavlink.dialects.v20 import all as mavlink

from sim_vehicle import scenarios
from sim_vehicle.faults import Fault, Kind, Window
from sim_vehicle.scenario import Scenario
from sim_vehicle.vehicle import Frames, Vehicle
from sim_vehicle.world import Truth


def driven(scenario: Scenario, seconds: float = 5.0, seed: int = 3) -> tuple[Vehicle, Frames]:
    vehicle = Vehicle(scenario, seed, 1_700_000_000.0)
    return vehicle, vehicle.advance(seconds)


def messages(frames: Frames) -> dict[str, list[Any]]:
    parser = mavlink.MAVLink(None)
    parser.robust_parsing = True
    by_type: defaultdict[str, list[Any]] = defaultdict(list)
    for arrival in frames.mavlink:
        for message in parser.parse_buffer(arrival.frame) or []:
            by_type[message.get_type()].append(message)
    return by_type


def test_frames_arrive_in_order_by_the_time_asked_for_however_it_is_cut() -> None:
    _, whole = driven(scenarios.draw("demo", 3))
    vehicle = Vehicle(scenarios.draw("demo", 3), 3, 1_700_000_000.0)
    cut = Frames()
    for count in range(1, 501):
        part = vehicle.advance(count / 100.0)
        assert all(arrival.time <= count / 100.0 for arrival in (*part.mavlink, *part.can))
        cut.mavlink += part.mavlink
        cut.can += part.can
    assert cut == whole
    times = [arrival.time for arrival in whole.mavlink]
    assert times == sorted(times)


def test_switching_a_sensor_off_leaves_the_noise_of_the_others() -> None:
    scenario = scenarios.draw("demo", 3)
    _, with_compass = driven(scenario)
    _, without = driven(replace(scenario, compass=None, barometer=None, wheels=None))
    for kind, fields in {"HIGHRES_IMU": ("xgyro", "zgyro", "xacc"), "RANGING_BEACON": ("range",)}.items():
        first, second = (
            {
                message.time_usec: [getattr(message, name) for name in fields]
                for message in messages(frames)[kind]
            }
            for frames in (with_compass, without)
        )
        common = first.keys() & second.keys()
        assert len(common) > 0.9 * len(first)
        assert all(first[stamp] == second[stamp] for stamp in common)


def test_the_truth_does_not_depend_on_who_watches() -> None:
    rows: list[Truth] = []
    watched = Vehicle(scenarios.draw("beacons", 4), 4, 0.0)
    watched.watch(50.0, rows.append)
    watched.advance(10.0)
    alone = Vehicle(replace(scenarios.draw("beacons", 4), wheels=None, inertial=None, ranger=None), 4, 0.0)
    assert [row.time for row in rows] == pytest.approx([count / 50.0 for count in range(501)])
    assert watched.world.at(10.0) == alone.world.at(10.0)


def test_messages_agree_with_the_truth_within_their_scaling_and_noise() -> None:
    scenario = scenarios.draw("beacons", 5)
    assert scenario.ranger is not None
    assert scenario.wheels is not None
    rows: dict[int, Truth] = {}
    vehicle = Vehicle(scenario, 5, 1_700_000_000.0)
    vehicle.watch(1000.0, lambda truth: rows.__setitem__(round(truth.time * 1000), truth))
    heard = messages(vehicle.advance(20.0))
    sites = {site.id: site for site in scenario.ranger.beacons}
    errors = []
    for message in heard["RANGING_BEACON"]:
        time = message.time_usec / 1e6 - scenario.clock.uptime
        truth, site = rows[round(time * 1000)], sites[message.beacon_id]
        distance = ((truth.north - site.north) ** 2 + (truth.east - site.east) ** 2 + site.down**2) ** 0.5
        errors.append(message.range / 1e3 - distance)
    errors.sort()
    # 2 % come long; a quarter of the errors lies above 0.67 sigma, 0.2 m: wide bounds for 380 ranges.
    assert len(errors) > 350
    assert abs(errors[len(errors) // 2]) < 0.1
    assert 0.1 < errors[3 * len(errors) // 4] < 0.3
    last = heard["WHEEL_DISTANCE"][-1]
    truth = rows[round((last.time_usec / 1e6 - scenario.clock.uptime) * 1000)]
    assert 0.5 * sum(last.distance) == pytest.approx(0.5 * (truth.left + truth.right), rel=0.1)


def test_a_link_fault_drops_only_in_its_window() -> None:
    fault = Fault("mavlink", Kind.DROP, Window(1.0, 3.0))
    vehicle, frames = driven(replace(scenarios.draw("beacons", 3), faults=(fault,)))
    seconds = Counter(int(arrival.time) for arrival in frames.mavlink)
    assert seconds[0] > 50
    assert seconds[1] < 20, "only what was on the way already"
    assert seconds[2] == 0
    assert vehicle.mavlink.faults.counts[Kind.DROP] > 200


def test_a_corrupted_link_loses_messages_and_leaves_no_false_ones() -> None:
    scenario = replace(scenarios.draw("beacons", 3), faults=(Fault("mavlink", Kind.CORRUPT, share=0.1),))
    vehicle, frames = driven(scenario)
    corrupted = vehicle.mavlink.faults.counts[Kind.CORRUPT]
    understood = sum(len(found) for kind, found in messages(frames).items() if kind != "BAD_DATA")
    assert corrupted > 30
    assert understood <= len(frames.mavlink) - 0.9 * corrupted


def test_a_sensor_fault_silences_that_sensor_alone() -> None:
    scenario = replace(scenarios.draw("beacons", 3), faults=(Fault("beacons", Kind.DROP),))
    heard = messages(driven(scenario)[1])
    assert "RANGING_BEACON" not in heard
    assert len(heard["HIGHRES_IMU"]) > 200


def test_a_delayed_sensor_says_the_same_later() -> None:
    scenario = scenarios.draw("beacons", 3)
    late = replace(scenario, faults=(Fault("beacons", Kind.DELAY, delay=0.2),))
    prompt, delayed = (messages(driven(drawn)[1])["RANGING_BEACON"] for drawn in (scenario, late))
    assert [message.range for message in delayed] == [message.range for message in prompt[: len(delayed)]]
    assert 2 <= len(prompt) - len(delayed) <= 6
