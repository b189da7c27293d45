"""The walk of a slow state, number by number."""

from __future__ import annotations

import numpy as np
import pytest

from filters.motion.slow import diffuse

pytestmark = pytest.mark.interpreted


def test_noise_is_added_to_one_column_within_the_block() -> None:
    columns = np.arange(12, dtype=np.float32).reshape(2, 6)
    noise = np.array([[9.0, 9.0, 9.0], [1.0, -2.0, 0.5]], np.float32)
    expected = columns.copy()
    expected[1, 2:5] += 0.25 * noise[1]
    diffuse(columns, 1, 2, 5, noise, 1, 0.25)
    np.testing.assert_allclose(columns, expected, rtol=1e-6)
