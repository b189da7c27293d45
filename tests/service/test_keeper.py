"""The keeper: always a whole file, the newest; a disk that refuses is said once, and tried again."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from service.channels import pair
from service.keeper import Keeper


def test_the_newest_takes_the_place_of_the_one_before(tmp_path: Path) -> None:
    queue = pair(1 << 19)
    keeper = Keeper(tmp_path / "a.checkpoint", queue.inlet)
    keeper.step(0)
    assert keeper.written == 0
    for data in (b"one", b"two", b"three" * 5000):
        queue.outlet.send(data)
    keeper.step(0)
    assert keeper.written == 1
    assert (tmp_path / "a.checkpoint").read_bytes() == b"three" * 5000
    queue.outlet.send(b"four")
    keeper.step(0)
    assert (tmp_path / "a.checkpoint").read_bytes() == b"four"
    assert [path.name for path in tmp_path.iterdir()] == ["a.checkpoint"]
    queue.close()


def test_a_disk_that_refuses_is_said_once_and_tried_again(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    queue = pair(1 << 19)
    folder = tmp_path / "gone"
    keeper = Keeper(folder / "a.checkpoint", queue.inlet)
    with caplog.at_level(logging.INFO):
        for _ in range(3):
            queue.outlet.send(b"one")
            keeper.step(0)
        assert len(caplog.records) == 1
        assert "a.checkpoint" in caplog.text
        folder.mkdir()
        queue.outlet.send(b"two")
        keeper.step(0)
    assert (folder / "a.checkpoint").read_bytes() == b"two"
    assert "written again" in caplog.records[-1].message
    queue.close()
