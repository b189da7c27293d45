"""Trim a recording to what a replay needs of it: ``python tests/sitl/trim.py RECORDING.tlog ... --out FOLDER``.

Frames are kept or left out whole, stamp and bytes as recorded. Kept are the messages that the estimate is made of, the
ones that set the clocks and the origin, and the first of every other kind: that a log holds a simulator's messages says
how late its fixes are. A wheel's counter tells totals, so where the copy would be larger than 2 MB, only every second
(third, ...) of its messages is kept. What is left out shows in a replay as lost on the way: sequence numbers are kept.
"""

from __future__ import annotations

import argparse
import shutil
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from drivers.mavlink.dialect import LAYOUTS
from drivers.mavlink.frames import Frame, frame_at

MOST_BYTES = 2_000_000
STAMP = 8
USED = frozenset({"HEARTBEAT", "HIGHRES_IMU", "GPS_RAW_INT", "GPS_GLOBAL_ORIGIN", "SYSTEM_TIME", "TIMESYNC"})
COUNTED = "WHEEL_DISTANCE"


def entries(data: bytes) -> Iterator[tuple[str, bytes]]:
    """Yield the kind and the bytes, stamp included, of every entry of an undamaged .tlog."""
    at = 0
    while at < len(data):
        frame = frame_at(data, at + STAMP)
        if not isinstance(frame, Frame) or frame.layout is None:
            raise ValueError(f"byte {at}: not a known frame; trim an undamaged log")
        end = at + STAMP + len(frame.raw)
        yield LAYOUTS[frame.identifier].name, data[at:end]
        at = end


def trimmed(data: bytes, every: int) -> bytes:
    """Return the entries that are used, and every ``every``-th of the wheels'."""
    met: Counter[str] = Counter()
    kept: list[bytes] = []
    for kind, entry in entries(data):
        if kind in USED or met[kind] == 0 or (kind == COUNTED and met[kind] % every == 0):
            kept.append(entry)
        met[kind] += 1
    return b"".join(kept)


def trim(log: Path, folder: Path) -> Path:
    """Write a trimmed copy of ``log`` with the files beside it, and return its path."""
    data = log.read_bytes()
    every = 1
    while len(copy := trimmed(data, every)) > MOST_BYTES:
        every += 1
        if every > 5:
            raise ValueError(f"{log}: {len(copy)} bytes are left, {MOST_BYTES} are allowed")
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / log.name
    path.write_bytes(copy)
    for ending in (".toml", "_truth.csv"):
        shutil.copyfile(log.with_name(log.stem + ending), folder / (log.stem + ending))
    return path


def main() -> None:
    """Run as a program."""
    parser = argparse.ArgumentParser(description="Trim recordings to the messages that a replay uses.")
    parser.add_argument("logs", nargs="+", type=Path, metavar="RECORDING.tlog")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "data")
    options = parser.parse_args()
    for log in options.logs:
        path = trim(log, options.out)
        print(f"{path}: {path.stat().st_size} of {log.stat().st_size} bytes")  # noqa: T201


if __name__ == "__main__":
    main()
