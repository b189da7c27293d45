"""The elementary functions against float64, every float32 of their ranges: python docs/filters/kernels.py.

Writes the tables of kernels.md (some minutes). python docs/figures.py kernels draws the page's figure, from every
1009th float.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numba
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from filters.kernels import elementary
from filters.kernels.compile import KERNEL_FLAGS
from service.textbook.style import BLUE, ORANGE

CHUNK = 1 << 20
STRIDE = 1009
TWO_PI = 2.0 * math.pi
compiled: Any = numba.njit(fastmath=set(KERNEL_FLAGS), error_model="numpy")
exact: Any = numba.njit(error_model="numpy")


@compiled
def sincos_sine(x: np.float32) -> np.float32:
    return elementary.sincos(x)[0]


@compiled
def sincos_cosine(x: np.float32) -> np.float32:
    return elementary.sincos(x)[1]


@exact
def turns_off(x: float) -> float:
    return x - TWO_PI * np.round(x / TWO_PI)


class Function(NamedTuple):
    """A function of ours, the one it approximates, and the ranges (least, largest) it is measured over."""

    name: str
    ours: Any
    reference: Any
    ranges: tuple[tuple[float, float], ...]


HALF_PI = 0.5 * math.pi
SMALLEST = float(np.finfo(np.float32).smallest_normal)
LARGEST = float(np.finfo(np.float32).max)
FUNCTIONS = (
    Function("exp", elementary.exp, math.exp, ((-1.0, 1.0), (-10.0, 10.0), (-87.0, 88.0))),
    Function("log", elementary.log, math.log, ((0.5, 2.0), (SMALLEST, LARGEST))),
    Function("log1p", elementary.log1p, math.log1p, ((0.0, 1.0),)),
    Function("sine", elementary.sine, math.sin, ((-HALF_PI, HALF_PI),)),
    Function("cosine", elementary.cosine, math.cos, ((-1.5, 1.5), (-HALF_PI, HALF_PI))),
    Function("sincos, sine", sincos_sine, math.sin, ((-3.0, 3.0), (-100.0, 100.0), (-1e4, 1e4))),
    Function("sincos, cosine", sincos_cosine, math.cos, ((-1.5, 1.5), (-100.0, 100.0), (-1e4, 1e4))),
    Function("wrapped", elementary.wrapped, turns_off, ((-TWO_PI, TWO_PI), (-100.0, 100.0))),
)


class Worst(NamedTuple):
    """Of a range: how many floats, the worst error in ulp and where, its root mean square, the worst absolute one."""

    floats: int
    ulp: float
    at: float
    rms: float
    absolute: float


def measurer(function: Function) -> Callable[[Any, Any, Any, Any], None]:
    """Compile the comparison of one function: errors, absolute and in units in the last place, of every argument."""
    ours, reference, circular = function.ours, function.reference, function.name == "wrapped"

    @compiled
    def evaluate(x: Any, y: Any) -> None:
        for i in range(x.size):
            y[i] = ours(x[i])

    @exact
    def compare(x: Any, y: Any, absolute: Any, ulp: Any) -> None:
        for i in range(x.size):
            truth = reference(np.float64(x[i]))
            error = np.float64(y[i]) - truth
            if circular:
                error -= TWO_PI * np.round(error / TWO_PI)
            exponent = max(np.int64(np.float32(truth).view(np.int32) >> 23) & 255, 1)
            absolute[i] = error
            ulp[i] = error * np.int64((1023 + 150 - exponent) << 52).view(
                np.float64
            )  # over 2^(exponent - 150)

    def both(x: Any, y: Any, absolute: Any, ulp: Any) -> None:
        evaluate(x, y)
        compare(x, y, absolute, ulp)

    return both


def floats(least: float, largest: float, stride: int = 1) -> Iterator[NDArray[np.float32]]:
    """Every ``stride``-th float32 of a range, negative ones first, in chunks."""

    def bits(value: float) -> int:
        return int(np.float32(value).view(np.uint32)) & 0x7FFFFFFF

    halves: list[tuple[int, int, int]] = []
    if least < 0.0:
        halves.append((bits(largest) if largest < 0.0 else 0, bits(least), 0x80000000))
    if largest >= 0.0:
        halves.append((bits(least) if least > 0.0 else 0, bits(largest), 0))
    for low, high, sign in halves:
        for start in range(low, high + 1, CHUNK * stride):
            stop = min(start + CHUNK * stride, high + 1)
            values = np.arange(start, stop, stride, np.uint32) | np.uint32(sign)
            yield values.view(np.float32)


def measure(function: Function) -> list[Worst]:
    """Compare every float32 of each range; the ranges lie within each other, and no float is compared twice."""
    both = measurer(function)
    found: list[Worst] = []
    inner = (math.inf, -math.inf)
    for least, largest in function.ranges:
        if not found:
            parts = [scan(both, least, largest)]
        else:
            below = float(np.nextafter(np.float32(inner[0]), np.float32(-math.inf)))
            above = float(np.nextafter(np.float32(inner[1]), np.float32(math.inf)))
            parts = [found[-1], scan(both, above, largest)]
            if below > least:
                parts.append(scan(both, least, below))
        inner = (least, largest)
        worst = max(parts, key=lambda part: part.ulp)
        count = sum(part.floats for part in parts)
        squares = sum(part.rms**2 * part.floats for part in parts)
        largest_absolute = max(part.absolute for part in parts)
        found.append(Worst(count, worst.ulp, worst.at, math.sqrt(squares / count), largest_absolute))
    return found


def scan(both: Callable[[Any, Any, Any, Any], None], least: float, largest: float) -> Worst:
    """Compare every float32 between two, both included."""
    y = np.zeros(CHUNK, np.float32)
    absolute, ulp = np.zeros(CHUNK), np.zeros(CHUNK)
    count, worst, at, squares, largest_absolute = 0, 0.0, 0.0, 0.0, 0.0
    for x in floats(least, largest):
        size = x.size
        both(x, y[:size], absolute[:size], ulp[:size])
        count += size
        squares += float(np.dot(ulp[:size], ulp[:size]))
        largest_absolute = max(largest_absolute, float(absolute[:size].max()), -float(absolute[:size].min()))
        for k in (int(ulp[:size].argmax()), int(ulp[:size].argmin())):
            if abs(ulp[k]) > worst:
                worst, at = abs(float(ulp[k])), float(x[k])
    return Worst(count, worst, at, math.sqrt(squares / max(count, 1)), largest_absolute)


def accuracy() -> str:
    """The table of errors, over every float32 of each range."""
    rows = [
        "| function | range | floats | worst, ulp | at | rms, ulp | worst, absolute |",
        "|---|---|---:|---:|---:|---:|---:|",
    ]
    for function in FUNCTIONS:
        for (least, largest), worst in zip(function.ranges, measure(function), strict=True):
            print(function.name, least, largest, worst, flush=True)
            ulp = f"{worst.ulp:.2f}" if worst.ulp < 1e4 else f"{worst.ulp:.1e}"
            rms = f"{worst.rms:.2f}" if worst.rms < 1e4 else f"{worst.rms:.1e}"
            rows.append(
                f"| `{function.name}` | {least:.5g} to {largest:.5g} | {worst.floats:,} | {ulp} | {worst.at:.7g} "
                f"| {rms} | {worst.absolute:.1e} |"
            )
    return "\n".join(rows)


EDGES: dict[str, tuple[float, ...]] = {
    "exp": (0.0, 1e-40, -87.0, -87.00001, -math.inf, 88.0, 88.7, 89.0, 100.0, math.inf, math.nan),
    "log": (1.0, SMALLEST, LARGEST, 1e-40, 0.0, -0.0, -1.0, math.inf, math.nan),
    "log1p": (0.0, 1e-40, 1.0, 1.5, 4.0, math.inf, math.nan),
    "sincos, sine": (0.0, 1e-40, 1e4, 1e5, 1e6, 1e7, 1e9, math.inf, math.nan),
    "sincos, cosine": (0.0, 1e-40, 1e4, 1e5, 1e6, 1e7, 1e9, math.inf, math.nan),
    "wrapped": (0.0, 1e-40, 1e4, 1e6, 2e7, 3e7, math.inf, math.nan),
}


def true_value(function: Function, x: float) -> float:
    """What float64 says, infinities and NaN where there is no number."""
    with np.errstate(all="ignore"):
        if function.name == "wrapped":
            return math.remainder(x, TWO_PI) if math.isfinite(x) else math.nan
        name = {"sincos, sine": "sin", "sincos, cosine": "cos"}.get(function.name, function.name)
        return float(getattr(np, name)(np.float64(np.float32(x))))


def edges() -> str:
    """The table of what comes out at and beyond the ends of the ranges."""
    rows = ["| function | argument | result | float64 |", "|---|---:|---:|---:|"]
    for function in FUNCTIONS:
        for x in EDGES.get(function.name, ()):
            y = np.zeros(1, np.float32)
            measurer_of(function)(np.array([x], np.float32), y)
            rows.append(f"| `{function.name}` | {x:.7g} | {y[0]:.7g} | {true_value(function, x):.7g} |")
    return "\n".join(rows)


def measurer_of(function: Function) -> Callable[[Any, Any], None]:
    """Compile one function over an array."""
    ours = function.ours

    @compiled
    def evaluate(x: Any, y: Any) -> None:
        for i in range(x.size):
            y[i] = ours(x[i])

    return evaluate


def errors() -> Figure:
    """Draw the worst and root mean square error over the ranges."""
    panels = (
        (FUNCTIONS[0], (-87.0, 88.0), lambda x: x, "exp, argument", "ulp"),
        (FUNCTIONS[1], (SMALLEST, LARGEST), np.log10, "log, log₁₀ of the argument", "ulp"),
        (FUNCTIONS[5], (-12.0, 12.0), lambda x: x, "sincos, argument, rad", "2⁻²⁴"),
        (FUNCTIONS[5], (1e-3, 1e4), np.log10, "sincos, log₁₀ of the argument, rad", "2⁻²⁴"),
    )
    figure, axes = plt.subplots(2, 2, figsize=(8.2, 5.0), layout="constrained")
    for axis, (function, (least, largest), place, label, unit) in zip(axes.flat, panels, strict=True):
        x = np.concatenate(list(floats(least, largest, STRIDE)))
        if place is not np.log10:  # floats are dense about zero: even ones show more
            x = np.linspace(least, largest, 2_000_001).astype(np.float32)
        y, absolute, ulp = np.zeros_like(x), np.zeros(x.size), np.zeros(x.size)
        measurer(function)(x, y, absolute, ulp)
        error = np.abs(ulp if unit == "ulp" else absolute * 2.0**24)
        ends = np.linspace(place(np.float64(least)), place(np.float64(largest)), 161)
        bins = np.clip(np.digitize(place(x.astype(np.float64)), ends) - 1, 0, 159)
        worst, square, number = np.zeros(160), np.zeros(160), np.zeros(160)
        np.maximum.at(worst, bins, error)
        np.add.at(square, bins, error**2)
        np.add.at(number, bins, 1.0)
        axis.stairs(worst, ends, color=BLUE, linewidth=1.1, label="worst")
        axis.stairs(np.sqrt(square / np.maximum(number, 1)), ends, color=ORANGE, label="root mean square")
        axis.set_xlabel(label)
        axis.set_ylabel(f"error, {unit}")
        axis.set_ylim(0, None)
    axes[0, 0].set_ylim(0, 95)
    axes[0, 0].legend(loc="upper center", ncols=2)
    return figure


def replaced(page: str, name: str, table: str) -> str:
    """Put a table between its two markers."""
    pattern = rf"(<!-- {name} -->\n).*?(\n<!-- end {name} -->)"
    return re.sub(pattern, lambda match: match[1] + table + match[2], page, flags=re.DOTALL)


FIGURES = {"errors": errors}

if __name__ == "__main__":
    here = Path(__file__).parent
    tables = {"edges": edges(), "accuracy": accuracy()}
    text = (here / "kernels.md").read_text(encoding="utf-8")
    for name, table in tables.items():
        text = replaced(text, name, table)
    (here / "kernels.md").write_text(text, encoding="utf-8")
