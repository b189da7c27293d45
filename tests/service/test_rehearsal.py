"""The rehearsal runs every stage, and the line that it draws is the right one."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.config import load
from service.rehearsal import PARTICLE_STAGES, line, rehearse

TOML = """
[vehicle]
name = "rover"
[budget]
particles_min = 100
particles_max = {most}
[[link]]
name = "bus"
kind = "mavlink"
url = "udpin:127.0.0.1:0"
[[sensor]]
kind = "range"
[[sensor]]
kind = "position"
link = "bus"
source = "GPS_RAW_INT"
[[sensor]]
kind = "velocity"
[[sensor]]
kind = "heading"
[[sensor]]
kind = "speed"
[[sensor]]
kind = "altitude"
estimate = ["bias"]
[[beacon]]
id = 4
position = [10.0, 0.0, 0.0]
"""


@pytest.mark.parametrize("most", [5000, 100])
def test_every_stage_is_run_and_has_a_shape(tmp_path: Path, most: int) -> None:
    path = tmp_path / "rover.toml"
    path.write_text(TOML.format(most=most))
    shapes = rehearse(load(path))
    assert set(shapes) == {*PARTICLE_STAGES, "witnesses", "kalman"}
    assert 0.0 < shapes["witnesses"].slope <= shapes["extraction"].slope
    assert all(shape.slope > 0.0 and shape.constant >= 0.0 for shape in shapes.values())


@given(st.floats(0.0, 1e-2), st.floats(1e-10, 1e-5), st.integers(10, 1000), st.integers(1001, 10**6))
def test_the_line_goes_through_both_points(overhead: float, slope: float, few: int, many: int) -> None:
    found = line(few, overhead + slope * few, many, overhead + slope * many)
    assert found.at(many) == pytest.approx(overhead + slope * many, rel=1e-9)
    assert found.at(few) == pytest.approx(overhead + slope * few, rel=1e-6, abs=1e-9)


@given(st.floats(1e-9, 1e-2), st.floats(1e-9, 1e-2), st.integers(10, 1000), st.integers(0, 10**6))
def test_no_line_falls_or_starts_below_zero(cheap: float, dear: float, few: int, more: int) -> None:
    """Whatever noise did to the two measurements, the line is exact at the larger count or just above."""
    found = line(few, cheap, few + more, dear)
    assert found.slope > 0.0
    assert found.constant >= 0.0
    assert found.at(few + more) == pytest.approx(dear, rel=1e-9, abs=2e-5)
