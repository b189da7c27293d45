"""What a log is: by its content, and by its name where that says nothing."""

from __future__ import annotations

import gzip
from pathlib import Path

import pytest

from drivers.logs.recognise import Format, recognise
from tests.drivers.logs import dataflash, ulog
from tests.drivers.mavlink.wire import heartbeat

STAMP = (1_700_000_000_000_000).to_bytes(8, "big")
CONTENTS = {
    Format.TLOG: STAMP + heartbeat(),
    Format.DATAFLASH: dataflash.definitions(),
    Format.DATAFLASH_TEXT: b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n",
    Format.ULOG: ulog.header(),
    Format.CANDUMP: b"(1700000000.123456) can0 1004042A#80E6C547003CC7\n",
    Format.ASC: b"date Sat Sep 30 10:06:13.191 PM 2017\nbase hex  timestamps absolute\n",
    Format.BLF: b"LOGG" + bytes(140),
    Format.TRC: b";$FILEVERSION=1.1\n",
    Format.RECORDING: b"\x89MCAP0\r\n",
}


@pytest.mark.parametrize("form", Format)
def test_the_content_goes_before_the_name(tmp_path: Path, form: Format) -> None:
    for name in ("renamed.tlog", "without_an_ending"):
        path = tmp_path / name
        path.write_bytes(CONTENTS[form])
        assert recognise(path) is form


@pytest.mark.parametrize("form", [Format.CANDUMP, Format.ASC, Format.TRC])
def test_through_the_compression(tmp_path: Path, form: Format) -> None:
    path = tmp_path / "log.gz"
    path.write_bytes(gzip.compress(CONTENTS[form]))
    assert recognise(path) is form


@pytest.mark.parametrize(
    ("name", "form"),
    [
        ("a.tlog", Format.TLOG), ("A.BIN", Format.DATAFLASH), ("a.ulg", Format.ULOG), ("a.log.gz", Format.CANDUMP),
        ("a.candump", Format.CANDUMP), ("a.asc", Format.ASC), ("a.blf", Format.BLF), ("a.trc.gz", Format.TRC),
        ("a.mp3", None),
    ],
)  # fmt: skip
@pytest.mark.parametrize("content", [b"", b"\0" * 100, b"\x1f\x8bdamaged"])
def test_a_damaged_head_leaves_the_name(
    tmp_path: Path, name: str, form: Format | None, content: bytes
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    assert recognise(path) is form
