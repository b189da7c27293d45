"""A number that another thread writes is seen, and one that nobody writes is not waited for."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from filters.kernels.waiting import changed


@pytest.mark.interpreted
def test_what_has_changed_already_is_seen_at_once() -> None:
    numbers = np.array([0, 5, 0])
    assert changed(numbers, 1, 4, 1, 0)
    assert changed(numbers, 1, 4, 1, 1000)


@pytest.mark.interpreted
def test_patience_ends() -> None:
    assert not changed(np.array([3]), 0, 3, 1000, 0)
    assert not changed(np.array([3]), 0, 4, 0, 0)


def test_another_thread_writes() -> None:
    """The kernel holds no lock: the other thread runs while it looks."""
    numbers = np.zeros(1, np.int64)
    writer = threading.Timer(0.01, lambda: numbers.__setitem__(0, 1))
    writer.start()
    assert changed(numbers, 0, 0, 20_000_000_000, 10)
    writer.join()
