"""The standard atmosphere against its published table."""

from __future__ import annotations

import pytest

from service.atmosphere import pressure_altitude


@pytest.mark.parametrize(
    ("pascal", "metres"),
    [(101_325.0, 0.0), (89_874.6, 1000.0), (70_108.5, 3000.0), (26_436.3, 10_000.0), (107_477.7, -500.0)],
)
def test_it_is_the_standards_table(pascal: float, metres: float) -> None:
    """U.S. Standard Atmosphere, 1976, table I, by geopotential altitude; its pressures have six digits."""
    assert pressure_altitude(pascal) == pytest.approx(metres, abs=0.1)
