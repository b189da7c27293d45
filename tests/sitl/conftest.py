"""Recordings made by others; they are no part of the project, and tests on them skip where they are absent."""

from __future__ import annotations

from pathlib import Path

import pytest

RECORDINGS = Path(__file__).parents[2].parent / "shared" / "data"


@pytest.fixture
def recording(request: pytest.FixtureRequest) -> Path:
    """Path of the recording that the test names by ``@pytest.mark.parametrize(..., indirect=True)`` or its param."""
    path = RECORDINGS / str(request.param)
    if not path.is_file():
        pytest.skip(f"the recording {path.name} is not in ../shared/data")
    return path
