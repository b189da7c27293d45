"""A map in characters: braille dots for tracks and circles, signs for beacons and the vehicle. North is up.

A braille character holds 2 by 4 dots, and a terminal's cell is about twice as high as wide: the dots are
nearly square, so one scale serves both axes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from rich.text import Text

Point = tuple[float, float]
"""North and east, metres."""

_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
_BLANK = 0x2800
_MARGIN = 1.08
_SMALLEST_SPAN = 4.0
_ARROWS = "↑↗→↘↓↙←↖"


@dataclass(frozen=True)
class Frame:
    """Which part of the plane is drawn on how many characters."""

    north: float
    east: float
    metres_per_dot: float
    columns: int
    rows: int

    def dot(self, point: Point) -> tuple[int, int]:
        """Return the dot (down, right) that a point falls on; it may lie outside."""
        down = self.rows * 2 - (point[0] - self.north) / self.metres_per_dot
        right = self.columns + (point[1] - self.east) / self.metres_per_dot
        return math.floor(down), math.floor(right)


def frame(points: Iterable[Point], columns: int, rows: int) -> Frame:
    """Return the frame that shows all of ``points``, at one scale for both axes."""
    norths, easts = zip(*points, strict=True) if (points := list(points)) else ((0.0,), (0.0,))
    span_north, span_east = max(norths) - min(norths), max(easts) - min(easts)
    scale = max(span_north / (4 * rows), span_east / (2 * columns), _SMALLEST_SPAN / (4 * rows)) * _MARGIN
    return Frame((max(norths) + min(norths)) / 2, (max(easts) + min(easts)) / 2, scale, columns, rows)


def arrow(heading: float | None) -> str:
    """Return the sign for a vehicle that looks this way (radians from north), or that could look any way."""
    return "●" if heading is None else _ARROWS[round(heading / (math.pi / 4)) % 8]


class Canvas:
    """Characters to draw on; what is drawn later lies on top."""

    def __init__(self, frame: Frame) -> None:
        self._frame = frame
        self._dots = [[0] * frame.columns for _ in range(frame.rows)]
        self._signs: list[list[str]] = [[""] * frame.columns for _ in range(frame.rows)]
        self._styles = [[""] * frame.columns for _ in range(frame.rows)]

    def dots(self, points: Iterable[Point], style: str) -> None:
        """Draw a dot for each point."""
        for point in points:
            down, right = self._frame.dot(point)
            if 0 <= down < 4 * self._frame.rows and 0 <= right < 2 * self._frame.columns:
                row, column = down // 4, right // 2
                self._dots[row][column] |= _DOTS[down % 4][right % 2]
                self._styles[row][column] = style

    def circle(self, centre: Point, radius: float, style: str) -> None:
        """Draw a circle of ``radius`` metres."""
        count = max(12, min(720, int(2 * math.pi * radius / self._frame.metres_per_dot)))
        turns = (2 * math.pi * step / count for step in range(count))
        self.dots(
            ((centre[0] + radius * math.cos(t), centre[1] + radius * math.sin(t)) for t in turns), style
        )

    def sign(self, point: Point, character: str, style: str) -> None:
        """Put one character at a point."""
        down, right = self._frame.dot(point)
        row, column = down // 4, right // 2
        if 0 <= row < self._frame.rows and 0 <= column < self._frame.columns:
            self._signs[row][column] = character
            self._styles[row][column] = style

    def text(self) -> Text:
        """Return the lines to print."""
        text = Text(no_wrap=True)
        for row in range(self._frame.rows):
            for column in range(self._frame.columns):
                character = self._signs[row][column] or chr(_BLANK + self._dots[row][column])
                text.append(character, self._styles[row][column])
            if row + 1 < self._frame.rows:
                text.append("\n")
        return text
