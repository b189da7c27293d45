"""Which durations are let through."""

from __future__ import annotations

import math

import pytest

from filters.duration import require_duration


@pytest.mark.parametrize("duration", [0.0, -0.0, 5e-324, 0.02, 1e300])
def test_a_duration_is_finite_and_not_negative(duration: float) -> None:
    require_duration("predict", duration)


@pytest.mark.parametrize("duration", [-1e-9, -math.inf, math.inf, math.nan])
def test_what_is_none_is_named_with_its_place(duration: float) -> None:
    with pytest.raises(
        ValueError, match=f"^predict: duration must be finite and not negative, got {duration} s$"
    ):
        require_duration("predict", duration)
