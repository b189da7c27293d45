"""The running quantile against numpy on the same window."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.quantile import RunningQuantile

VALUES = st.lists(st.floats(0.0, 1e6) | st.sampled_from([0.0, 1.0, 2.0]), min_size=1, max_size=200)


@given(VALUES, st.integers(1, 80), st.floats(0.01, 1.0))
def test_equals_numpy_on_the_window(values: list[float], window: int, probability: float) -> None:
    quantile = RunningQuantile(window, probability)
    for value in values:
        quantile.add(value)
    expected = np.quantile(values[-window:], probability, method="inverted_cdf")
    assert quantile.value == expected
    assert len(quantile) == min(window, len(values))


def test_empty_is_zero() -> None:
    assert RunningQuantile(4, 0.5).value == 0.0


@pytest.mark.parametrize(("window", "probability"), [(0, 0.5), (4, 0.0), (4, 1.1)])
def test_refuses_what_is_no_quantile(window: int, probability: float) -> None:
    with pytest.raises(ValueError, match="window >= 1"):
        RunningQuantile(window, probability)
