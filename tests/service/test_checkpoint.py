"""The checkpoint: what is written is read again, what is old, damaged or another's is refused with the reason."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from service.channels import Outlet, pair
from service.checkpoint import MAGIC, OLDEST, CheckpointError, Checkpoints, Kept, Writer, read
from service.config import Configuration, validated
from service.keeper import path_of

SECOND = 1_000_000_000
NAMES = ("north", "east", "heading")
KEPT = Kept(
    5 * SECOND,
    NAMES,
    np.arange(12, dtype=np.float32).reshape(3, 4),
    (1.5, 0.25),
    (0.9, 0.1, 30.0),
    7,
    "tracking",
)


def configuration(folder: Path, north: float = 0.0) -> Configuration:
    file = {
        "vehicle": {"name": "mower"},
        "start": {"position": [north, 0.0, 0.0]},
        "link": [{"name": "l", "kind": "mavlink", "url": "udpin:127.0.0.1:0"}],
        "state": {"directory": str(folder)},
    }
    return validated(file, Configuration, "test.toml")


def write(settings: Configuration, unix: int = 1000 * SECOND) -> Path:
    path = path_of(settings)
    path.write_bytes(Writer(settings).encode(KEPT, unix))
    return path


def _nothing(_data: bytes) -> bytes:
    return b""


def _other(data: bytes) -> bytes:
    return b"x" + data


def _shorter(data: bytes) -> bytes:
    return data[:-1]


def _empty(_data: bytes) -> bytes:
    return MAGIC + b"\0\0\0\0"


def test_what_is_kept_comes_back_with_its_time(tmp_path: Path) -> None:
    settings = configuration(tmp_path)
    write(settings)
    kept = read(settings, 8 * SECOND, 4)
    assert kept is not None
    assert kept.columns.tolist() == KEPT.columns.tolist()
    assert kept._replace(columns=KEPT.columns) == KEPT


def test_none_where_nothing_was_kept(tmp_path: Path) -> None:
    assert read(configuration(tmp_path), 0, 0) is None


def test_a_step_of_the_wall_clock_does_not_change_its_age(tmp_path: Path) -> None:
    """Since the same start of the computer the monotonic clock counts; after another one, Unix time."""
    settings = configuration(tmp_path)
    path = write(settings)
    year = 365 * 86400 * SECOND
    for unix in (1002 * SECOND - year, 1002 * SECOND + year):
        kept = read(settings, 7 * SECOND, unix)
        assert kept is not None
        assert kept.time == 5 * SECOND
    writer = Writer(settings)
    writer._boot = "another"  # pyright: ignore[reportPrivateUsage]
    path.write_bytes(writer.encode(KEPT, 1000 * SECOND))
    kept = read(settings, SECOND, 1003 * SECOND)
    assert kept is not None
    assert kept.time == SECOND - 3 * SECOND


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (_nothing, "no checkpoint"),
        (_other, "no checkpoint"),
        (_shorter, "damaged"),
        (_empty, "damaged"),
    ],
)
def test_a_damaged_file_is_refused(tmp_path: Path, damage: Callable[[bytes], bytes], reason: str) -> None:
    settings = configuration(tmp_path)
    path = write(settings)
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(CheckpointError, match=reason) as refused:
        read(settings, 6 * SECOND, 0)
    assert str(path) in str(refused.value)


def test_every_bit_that_flips_is_found(tmp_path: Path) -> None:
    settings = configuration(tmp_path)
    path = write(settings)
    data = path.read_bytes()
    for place in range(0, len(data), 7):
        path.write_bytes(data[:place] + bytes([data[place] ^ (1 << place % 8)]) + data[place + 1 :])
        with pytest.raises(CheckpointError):
            read(settings, 6 * SECOND, 0)


def test_one_that_is_old_from_the_future_or_of_another_start_is_refused(tmp_path: Path) -> None:
    settings = configuration(tmp_path)
    write(settings)
    with pytest.raises(CheckpointError, match="s old"):
        read(settings, 6 * SECOND + round(OLDEST * SECOND), 0)
    with pytest.raises(CheckpointError, match="future"):
        read(settings, 2 * SECOND, 0)
    with pytest.raises(CheckpointError, match="another configuration"):
        read(configuration(tmp_path, north=5.0), 6 * SECOND, 0)


def test_a_directory_in_its_place_is_named(tmp_path: Path) -> None:
    settings = configuration(tmp_path)
    path_of(settings).mkdir()
    with pytest.raises(CheckpointError, match="cannot be read"):
        read(settings, 0, 0)


def test_the_loop_sends_what_there_is_to_keep(tmp_path: Path) -> None:
    settings = configuration(tmp_path)
    queue = pair(1 << 19)
    offered: list[Kept | None] = [None, KEPT]
    checkpoints = Checkpoints(settings, Outlet(queue.outlet), lambda: offered.pop(0))
    checkpoints.send(6 * SECOND, 1000 * SECOND)
    checkpoints.send(6 * SECOND, 1000 * SECOND)
    path_of(settings).write_bytes(queue.inlet.recv(1 << 18))
    with pytest.raises(BlockingIOError):
        queue.inlet.recv(1)
    assert read(settings, 7 * SECOND, 0) is not None
    assert checkpoints.dropped == 0
    queue.close()
