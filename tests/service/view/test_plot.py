"""The map: dots where they belong, one scale for both axes, north up."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.view.plot import Canvas, Frame, arrow, frame

BITS = {0: (0, 0), 1: (1, 0), 2: (2, 0), 3: (0, 1), 4: (1, 1), 5: (2, 1), 6: (3, 0), 7: (3, 1)}
"""Unicode's numbering of the eight braille dots: bit to (row, column)."""

coordinates = st.floats(-1e4, 1e4)
points = st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=20)


def dots(canvas: Canvas) -> set[tuple[int, int]]:
    """Return the dots that are set, (down, right), read back from the characters."""
    found: set[tuple[int, int]] = set()
    for row, line in enumerate(canvas.text().plain.split("\n")):
        for column, character in enumerate(line):
            pattern = ord(character) - 0x2800
            found |= {
                (4 * row + BITS[bit][0], 2 * column + BITS[bit][1]) for bit in BITS if pattern >> bit & 1
            }
    return found


def test_one_dot_per_metre_lands_where_it_should() -> None:
    """The origin is dot (8, 10) of 16 by 20; a metre north is a dot up, east a dot right."""
    canvas = Canvas(Frame(north=0.0, east=0.0, metres_per_dot=1.0, columns=10, rows=4))
    canvas.dots([(0.0, 0.0), (3.0, 0.0), (0.0, -4.0), (-5.0, 6.0)], "")
    assert dots(canvas) == {(8, 10), (5, 10), (8, 6), (13, 16)}


def test_what_lies_outside_is_left_out() -> None:
    canvas = Canvas(Frame(north=0.0, east=0.0, metres_per_dot=1.0, columns=10, rows=4))
    canvas.dots([(100.0, 0.0), (0.0, -11.0), (-9.0, 0.0)], "")
    canvas.sign((100.0, 0.0), "x", "")
    assert dots(canvas) == set()


@given(points, st.integers(10, 200), st.integers(3, 60))
def test_every_point_is_inside_its_frame(points: list[tuple[float, float]], columns: int, rows: int) -> None:
    shown = frame(points, columns, rows)
    for point in points:
        down, right = shown.dot(point)
        assert 0 <= down < 4 * rows
        assert 0 <= right < 2 * columns


def test_a_circle_has_its_radius() -> None:
    canvas = Canvas(Frame(north=5.0, east=-3.0, metres_per_dot=0.1, columns=60, rows=30))
    canvas.circle((5.0, -3.0), 4.0, "")
    drawn = dots(canvas)
    assert len(drawn) > 150
    for down, right in drawn:
        radius = math.hypot(60 - down - 0.5, right + 0.5 - 60) * 0.1
        assert radius == pytest.approx(4.0, abs=0.11)


@pytest.mark.parametrize(
    ("heading", "sign"),
    [
        (0.0, "↑"),
        (math.pi / 2, "→"),
        (-math.pi / 2, "←"),
        (math.pi, "↓"),
        (-3.0, "↓"),
        (0.8, "↗"),
        (None, "●"),
    ],
)
def test_the_arrow_points_the_way_it_looks(heading: float | None, sign: str) -> None:
    assert arrow(heading) == sign


def test_a_sign_lies_over_the_dots() -> None:
    canvas = Canvas(Frame(north=0.0, east=0.0, metres_per_dot=1.0, columns=4, rows=2))
    canvas.dots([(0.0, 0.0)], "cyan")
    canvas.sign((0.0, 0.0), "◆", "magenta")
    assert canvas.text().plain.split("\n")[1][2] == "◆"
