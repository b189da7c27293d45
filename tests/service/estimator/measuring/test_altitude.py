"""Altitudes through the whole estimator: in the particles, and beside them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest

from drivers.sample import Altitude, AnyReading, LocalPosition, Odometer, Pressure, Rotation, Sample
from service.config import Configuration, validated
from service.estimate import Estimate
from service.estimator import Estimator
from service.estimator.shadow import Shadow

SECOND = 1_000_000_000


def configuration(model: str, sensors: list[dict[str, Any]], **sections: Any) -> Configuration:
    file: dict[str, Any] = {
        "vehicle": {"name": "craft", "motion": model},
        "origin": {"latitude": 47.0, "longitude": 8.0, "altitude": 500.0},
        "start": {"position": [0.0, 0.0, 0.0], "heading": 0.0, "sigma": [0.5, 0.5, 1.0]},
        "loop": {"rate": 20.0, "horizon_ms": 100.0},
        "budget": {"particles_max": 2000},
        "link": [{"name": "l", "kind": "mavlink", "url": "udpin:127.0.0.1:0"}],
        "sensor": sensors,
    }
    return validated(file | sections, Configuration, "craft.toml")


def pascal(altitude: float) -> float:
    """Pressure at an altitude, by the barometric formula written the other way about."""
    return 101_325.0 * (1.0 - altitude / 44_330.77) ** 5.255876


Said = Callable[[float], Iterable[tuple[str, AnyReading]]]


def run(estimator: Estimator, said: Said, seconds: float, since: float = 0.0) -> Estimate:
    last: Estimate | None = None
    for tick in range(round(since * 20) + 1, round((since + seconds) * 20) + 1):
        now = tick * SECOND // 20
        readings = said(tick / 20.0)
        estimator.ingest([Sample(now, now, "l", source, reading) for source, reading in readings])
        last = estimator.tick(now, now, 2000)
    assert last is not None
    return last


def sigma(variance: float | None) -> float:
    assert variance is not None
    return math.sqrt(variance)


WEATHER = -38.0


@pytest.mark.parametrize("dimensions", [2, 3])
def test_a_barometer_keeps_the_height_when_the_fixes_end(dimensions: int) -> None:
    """20 s of fixes while it climbs at 0.5 m/s, then 20 s without: in three dimensions in the particles, on the plane
    beside them. Height and weather lie within 3.5 standard deviations, and the height is known to 1 m."""
    rng = np.random.default_rng(3)

    def said(t: float) -> Iterable[tuple[str, AnyReading]]:
        up = 0.5 * t
        if t <= 20.0 and round(t * 20) % 4 == 0:
            north, east, down = rng.normal(0.0, 0.5, 3)
            yield "FIX", LocalPosition(north, east, -up + down, 0.5, 0.5)
        yield "SCALED_PRESSURE", Pressure(pascal(500.0 + up + WEATHER + 0.2 * rng.normal()))

    sensors = [{"kind": "position"}, {"kind": "altitude", "sigma": 0.2, "estimate": ["bias"]}]
    craft = configuration(
        "constant_velocity", sensors, motion={"dimensions": dimensions, "acceleration_noise": 0.1}
    )
    estimator = Estimator(craft, seed=1)
    shadow = estimator.accompany(Shadow)
    run(estimator, said, 20.0)
    shadow.at(20 * SECOND)
    last = run(estimator, said, 20.0, 20.0)
    spread = sigma(last.position_covariance[5])
    assert last.position[2] == pytest.approx(-20.0, abs=3.5 * spread)
    assert spread < 1.0
    weather, of_weather = last.biases["altitude_bias"]
    assert weather == pytest.approx(WEATHER, abs=3.5 * of_weather)
    assert of_weather < 1.0
    assert not shadow.unsupported
    assert not shadow.failure


def test_a_rover_climbs_a_hill_by_its_barometer() -> None:
    """No fix at all: up 10 m in 40 s from a given height, by pressure alone; the other barometer, 3 m off, is not heard
    beside the one that spoke first, whatever their names."""

    def said(t: float) -> Iterable[tuple[str, AnyReading]]:
        up = 0.25 * t
        yield "GYRO", Rotation(0.0)
        yield "WHEEL_DISTANCE", Odometer((2.0 * t,))
        yield "SCALED_PRESSURE2", Pressure(pascal(500.0 + up + WEATHER))
        yield "SCALED_PRESSURE", Pressure(pascal(500.0 + up + WEATHER + 3.0))

    sensors = [{"kind": "altitude", "sigma": 0.2, "estimate": ["bias"]}]
    estimator = Estimator(configuration("unicycle", sensors), seed=1)
    last = run(estimator, said, 40.0)
    assert last.position[2] == pytest.approx(-10.0, abs=2.5)
    assert last.altitude == pytest.approx(510.0, abs=2.5)
    assert last.biases["altitude_bias"][0] == pytest.approx(WEATHER, abs=2.5)
    status = next(status for status in estimator.sensors(0) if status.name == "altitude/l")
    assert status.accepted > 700
    assert not status.refused


def test_without_a_bias_a_pressure_says_nothing_and_an_altitude_does() -> None:
    def said(t: float) -> Iterable[tuple[str, AnyReading]]:
        yield "GYRO", Rotation(0.0)
        yield "WHEEL_DISTANCE", Odometer((2.0 * t,))
        yield "SCALED_PRESSURE", Pressure(pascal(540.0))
        yield "VFR_HUD", Altitude(503.0, 0.3)

    sensors = [{"kind": "altitude", "source": "VFR_HUD"}, {"kind": "altitude"}]
    estimator = Estimator(configuration("unicycle", sensors), seed=1)
    last = run(estimator, said, 20.0)
    assert last.position[2] == pytest.approx(-3.0, abs=0.5)
    fates = {status.name: status for status in estimator.sensors(0)}
    assert fates["altitude/l/VFR_HUD"].accepted > 300
    assert set(fates["altitude/l"].refused) == {"pressure_needs_estimate_bias"}


def test_indoors_it_counts_from_where_it_began() -> None:
    """No origin: heights are from the start, whatever the sea is doing."""

    def said(t: float) -> Iterable[tuple[str, AnyReading]]:
        yield "SCALED_PRESSURE", Pressure(pascal(1600.0 + 0.25 * t))

    sensors = [{"kind": "altitude", "sigma": 0.2, "estimate": ["bias"]}]
    indoors = configuration("constant_velocity", sensors, motion={"dimensions": 3, "vertical_noise": 0.1})
    indoors = indoors.model_copy(update={"origin": None})
    last = run(Estimator(indoors, seed=1), said, 20.0)
    assert last.position[2] == pytest.approx(-5.0, abs=3.5 * sigma(last.position_covariance[5]))
    assert last.altitude is None


def test_an_altitude_above_the_sea_needs_to_know_where_that_is() -> None:
    sensors = [{"kind": "altitude"}]
    lost = configuration("unicycle", sensors).model_copy(update={"origin": None})
    estimator = Estimator(lost, seed=1)
    run(estimator, lambda t: [("VFR_HUD", Altitude(503.0)), ("GYRO", Rotation(0.0))], 2.0)
    status = next(status for status in estimator.sensors(0) if status.name == "altitude/l")
    assert set(status.refused) == {"no_origin"}
