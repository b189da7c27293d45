"""Elementary functions against float64, over the ranges that they are made for."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, cast

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from filters.kernels import elementary as functions
from filters.kernels.compile import KERNEL_FLAGS, Float32Array

# Not cached: numba would not notice that a function called here has changed.
compiled = cast(Callable[[Any], Any], numba.njit(fastmath=set(KERNEL_FLAGS), error_model="numpy"))


@compiled
def evaluate(x: Float32Array, out: Float32Array) -> None:
    for i in range(x.size):
        out[0, i], out[1, i] = functions.sincos(x[i])
        out[2, i] = functions.wrapped(x[i])
        out[3, i] = functions.exp(x[i])
        out[4, i] = functions.from_order(functions.order(x[i]))
        out[5, i] = functions.nearest(x[i])


@compiled
def evaluate_positive(x: Float32Array, out: Float32Array) -> None:
    for i in range(x.size):
        out[0, i] = functions.log(x[i])
        out[1, i] = functions.log1p(x[i])


@compiled
def evaluate_mixture(x: Float32Array, log_inlier: float, log_outlier: float, out: Float32Array) -> None:
    for i in range(x.size):
        out[i] = functions.log_mixture(x[i], log_inlier, log_outlier)


def over(values: NDArray[np.float64], function: Callable[..., Any], rows: int) -> tuple[Any, Any]:
    """Run a kernel; return its rows and its argument as float64."""
    x = values.astype(np.float32)
    out = np.zeros((rows, x.size), np.float32)
    function(x, out)
    return out, x.astype(np.float64)


@pytest.mark.parametrize(("limit", "tolerance"), [(math.pi, 2.5e-7), (100.0, 3e-7), (10_000.0, 4e-6)])
def test_sine_and_cosine(limit: float, tolerance: float) -> None:
    out, x = over(np.linspace(-limit, limit, 400_001), evaluate, 6)
    assert np.abs(out[0] - np.sin(x)).max() < tolerance
    assert np.abs(out[1] - np.cos(x)).max() < tolerance


@pytest.mark.interpreted
def test_sine_and_cosine_are_exact_at_zero() -> None:
    out, _ = over(np.zeros(9), evaluate, 6)
    assert (out[0] == 0.0).all()
    assert (out[1] == 1.0).all()


def test_wrapped_is_the_same_angle_within_half_a_turn() -> None:
    out, x = over(np.linspace(-50.0, 50.0, 200_001), evaluate, 6)
    assert np.abs(out[2]).max() <= np.float32(math.pi) + 4e-6
    assert np.abs(np.exp(1j * out[2].astype(float)) - np.exp(1j * x)).max() < 8e-6


def test_exp_has_a_few_units_in_the_last_place() -> None:
    out, x = over(np.linspace(-87.0, 88.0, 400_001), evaluate, 6)
    x = np.maximum(x, -87.0)
    exact = np.exp(x)
    bound = 2.5e-7 + 1.2e-7 * np.abs(x)  # the argument's own rounding when it is scaled to a power of two
    assert (np.abs(out[3] / exact - 1.0) < bound).all()


@pytest.mark.interpreted
def test_exp_is_zero_where_float32_ends() -> None:
    out, _ = over(np.array([-87.5, -1e4, -3e38, -np.inf]), evaluate, 6)
    assert (out[3] == 0.0).all()


def test_log() -> None:
    x = np.concatenate([np.geomspace(1.2e-38, 3e38, 300_001), np.linspace(0.5, 2.0, 300_001)])
    out, x = over(x, evaluate_positive, 2)
    exact = np.log(x)
    assert (np.abs(out[0] - exact) < 1.5e-7 + 1.2e-7 * np.abs(exact)).all()
    assert over(np.ones(1), evaluate_positive, 2)[0][0, 0] == 0.0


def test_log1p() -> None:
    out, x = over(np.linspace(0.0, 1.0, 300_001), evaluate_positive, 2)
    assert np.abs(out[1][1:] - np.log1p(x[1:])).max() < 2e-7


def test_order_is_that_of_the_floats() -> None:
    rng = np.random.default_rng(1)
    x = np.sort(np.concatenate([rng.normal(0, 1e3, 999), [-np.inf, -3e38, -1e-38, 0.0, 1e-38, 3e38, np.inf]]))
    out, x = over(x, evaluate, 6)
    assert np.array_equal(out[4], x.astype(np.float32))
    bits = x.astype(np.float32).view(np.int32)
    ordered = bits ^ ((bits >> 31) & 0x7FFFFFFF)
    assert (np.diff(ordered) >= 0).all()


def test_nearest() -> None:
    x = np.random.default_rng(2).uniform(-4e6, 4e6, 100_000)
    out, x = over(x, evaluate, 6)
    assert np.abs(out[5] - x).max() <= 0.5


@pytest.mark.parametrize("log_outlier", [-0.5, -3.0, -12.0, -60.0, -3e38])
def test_log_mixture(log_outlier: float) -> None:
    x = np.geomspace(1e-6, 1e6, 100_001).astype(np.float32)
    out = np.zeros_like(x)
    evaluate_mixture(x, np.float32(-0.05), np.float32(log_outlier), out)
    exact = np.logaddexp(-0.05 - x.astype(np.float64), log_outlier)
    assert (np.abs(out - exact) < 3e-7 + 2e-7 * np.abs(exact)).all()


@pytest.mark.interpreted
def test_log_mixture_of_an_infinite_residual_is_the_outlier_part() -> None:
    out = np.zeros(1, np.float32)
    evaluate_mixture(np.array([np.inf], np.float32), np.float32(-0.05), np.float32(-3.0), out)
    assert out[0] == pytest.approx(-3.0)


# ---- errors in units in the last place, as docs/filters/kernels.md has them, on a dense sample of all floats


@compiled
def sines_and_cosines(x: Float32Array, out: Float32Array) -> None:
    for i in range(x.size):
        out[0, i] = functions.sine(x[i])
        out[1, i] = functions.cosine(x[i])


def some_floats(least: float, largest: float, stride: int = 4999) -> NDArray[np.float32]:
    """Every ``stride``-th float32 of a range that does not cross zero, and its ends."""
    low, high = sorted(int(np.float32(abs(end)).view(np.uint32)) for end in (least, largest))
    bits = np.append(np.arange(low, high, stride, np.uint32), np.uint32(high))
    return np.copysign(bits.view(np.float32), np.float32(-1.0 if least < 0.0 else 1.0))


def ulps(ours: NDArray[np.float32], truth: NDArray[np.float64]) -> float:
    """Worst error in units in the last place of the true value."""
    _, exponent = np.frexp(np.maximum(np.abs(truth), np.finfo(np.float32).smallest_normal))
    return float((np.abs(ours - truth) / np.ldexp(1.0, exponent - 24)).max())


@pytest.mark.parametrize(
    ("least", "largest", "limit"), [(-1.0, 1.0, 2.7), (-10.0, 10.0, 9.0), (-87.0, 88.0, 65.0)]
)
def test_ulps_of_exp(least: float, largest: float, limit: float) -> None:
    for end in (least, largest):
        x = some_floats(math.copysign(1e-30, end), end) if end > 0 else some_floats(end, -1e-30)
        out = np.zeros((6, x.size), np.float32)
        evaluate(x, out)
        assert ulps(out[3], np.exp(x.astype(np.float64))) < limit


def test_ulps_of_log_and_log1p() -> None:
    x = np.concatenate([some_floats(1.1754944e-38, 3.4028235e38), some_floats(0.5, 2.0, 13)])
    out = np.zeros((2, x.size), np.float32)
    evaluate_positive(x, out)
    assert ulps(out[0][x != 1.0], np.log(x.astype(np.float64))[x != 1.0]) < 13.6
    y = some_floats(1e-37, 1.0)
    out = np.zeros((2, y.size), np.float32)
    evaluate_positive(y, out)
    assert ulps(out[1], np.log1p(y.astype(np.float64))) < 61.0


def test_ulps_of_sine_and_cosine() -> None:
    x = some_floats(1e-30, 0.5 * math.pi, 997)
    out = np.zeros((2, x.size), np.float32)
    sines_and_cosines(x, out)
    assert ulps(out[0], np.sin(x.astype(np.float64))) < 2.7
    near = np.abs(x) <= 1.0
    assert ulps(out[1][near], np.cos(x[near].astype(np.float64))) < 3.0


@pytest.mark.interpreted
@pytest.mark.parametrize(
    ("row", "argument", "result"),
    [
        (3, 0.0, 1.0),
        (3, 1e-40, 1.0),
        (3, -math.inf, 0.0),
        (3, math.nan, 0.0),
        (0, 1e-40, 1e-40),
        (1, 1e-40, 1.0),
        (2, 0.0, 0.0),
    ],
)
def test_what_comes_out_at_the_ends(row: int, argument: float, result: float) -> None:
    out, _ = over(np.array([argument]), evaluate, 6)
    assert out[row, 0] == np.float32(result)


@pytest.mark.interpreted
def test_sines_of_what_is_no_angle_are_no_numbers() -> None:
    out, _ = over(np.array([math.inf, -math.inf, math.nan]), evaluate, 6)
    assert not np.isfinite(out[:2]).any()


def test_huge_angles_lose_digits_slowly() -> None:
    """Up to 10⁶ rad as within the range, up to 10⁷ to 1e-4."""
    for limit, tolerance in ((1e6, 1e-5), (1e7, 1e-3)):
        out, x = over(np.linspace(-limit, limit, 100_001), evaluate, 6)
        assert np.abs(out[0] - np.sin(x)).max() < tolerance
        assert np.abs(out[1] - np.cos(x)).max() < tolerance


@pytest.mark.interpreted
def test_log_of_nothing_is_the_least_there_is() -> None:
    """Zero and subnormal numbers: about -88, not minus infinity; log1p of a subnormal number is itself."""
    out, _ = over(np.array([0.0, 1e-40]), evaluate_positive, 2)
    assert (np.abs(out[0] + 88.0) < 0.1).all()
    assert out[1].tolist() == np.array([0.0, 1e-40], np.float32).tolist()
