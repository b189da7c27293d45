"""What is drawn: thinned without losing its worst moments, and regions that are the published covariance's."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from service.report.series import ellipses, series_of, stretches_of_health, thinned
from service.score import CHI_SQUARE_95

from .traces import OFF, RATE, trace


def test_a_thinned_series_keeps_its_ends_and_its_worst_moment() -> None:
    worst = np.random.default_rng(1).random(60_000)
    worst[43_211] = 7.0
    worst[:100] = np.nan
    kept = thinned(worst, 1000)
    assert 1000 <= kept.size <= 2001
    assert kept[0] == 0
    assert kept[-1] == 59_999
    assert 43_211 in kept
    assert np.all(np.diff(kept) > 0)
    assert np.max(np.diff(kept)) <= 120


def test_a_short_series_is_kept_whole() -> None:
    assert thinned(np.zeros(100), 1000).tolist() == list(range(100))


def test_errors_are_those_of_the_invented_run() -> None:
    series = series_of(*trace(30.0))
    error = series.ticks["error"][series.ticks["time"] > 0.6]
    assert error == pytest.approx(OFF)
    assert series.ticks["shadow_error"][-1] == pytest.approx(2 * OFF)
    # d C^-1 d for d = (0.3, 0) and C = [[.0625, .01], [.01, .0625]]
    assert series.ticks["nees"][-1] == pytest.approx(OFF**2 * 0.0625 / (0.0625**2 - 0.01**2))
    assert np.isnan(series.ticks["error"][0])
    assert series.ticks["time"][0] == 0.0


def test_every_point_of_an_ellipse_is_as_far_as_the_95_percent_quantile() -> None:
    covariance = np.array([[4.0, 1.5], [1.5, 1.0]])
    count = 500
    ticks = {name: np.full(count, value) for name, value in (("nn", 4.0), ("ne", 1.5), ("ee", 1.0))}
    ticks |= {"north": np.linspace(0, 1, count), "east": np.zeros(count)}
    ticks["nn"][:3] = np.nan
    drawn = ellipses(ticks, 50)
    assert 40 <= drawn.north.size <= 50
    for turn in np.linspace(0, 2 * math.pi, 17):
        along, across = 0.5 * drawn.major[0] * math.cos(turn), 0.5 * drawn.minor[0] * math.sin(turn)
        sine, cosine = math.sin(drawn.direction[0]), math.cos(drawn.direction[0])
        point = np.array([along * cosine - across * sine, along * sine + across * cosine])
        assert point @ np.linalg.solve(covariance, point) == pytest.approx(CHI_SQUARE_95)


def test_health_is_told_as_stretches_without_gaps() -> None:
    time, health = np.arange(10.0), np.array([0, 0, 1, 1, 1, 2, 2, 1, 1, 1.0])
    told = stretches_of_health(time, health)
    assert [(s.begin, s.end) for s in told] == [(0.0, 2.0), (2.0, 5.0), (5.0, 7.0), (7.0, 9.0)]
    assert [s.state for s in told] == ["waiting", "converging", "tracking", "converging"]


def test_outliers_survive_thinning() -> None:
    traced, truth = trace(1200.0)
    outliers = {name: int(r.outlier.sum()) for name, r in traced.innovations.items()}
    series = series_of(traced, truth)
    for name, readings in series.innovations.items():
        assert readings.time.size <= 2 * 1500
        assert int(readings.outlier.sum()) == outliers[name]


def test_without_a_truth_there_is_no_error_and_the_widest_moment_is_kept() -> None:
    traced, _ = trace(120.0)
    wide = traced.ticks["radius95"].copy()
    wide[int(77.7 * RATE)] = 9.0
    series = series_of(replace(traced, ticks=traced.ticks | {"radius95": wide}), None)
    assert np.isnan(series.ticks["error"]).all()
    assert series.truth is None
    assert np.nanmax(series.ticks["radius95"]) == 9.0
