"""Which reader a log gets, and what is said when it gets none."""

from __future__ import annotations

from pathlib import Path

import pytest

from drivers.logs.canlog import CanLogReader
from drivers.logs.dataflash import DataflashReader
from drivers.logs.ulog import UlogReader
from service.config import CanLink, Configuration, MavlinkLink, Signal, Vehicle
from service.replay.sources import LogError, kind_of, open_log
from tests.drivers.logs import dataflash, ulog

CONFIGURATION = Configuration(
    vehicle=Vehicle(name="test"),
    link=(
        MavlinkLink(name="autopilot", kind="mavlink", url="udpin:127.0.0.1:1"),
        CanLink(name="bus", kind="can", channel="vcan0"),
    ),
)


def test_an_autopilots_own_log_stands_for_its_link(tmp_path: Path) -> None:
    flight, other = tmp_path / "flight.bin", tmp_path / "flight.ulg"
    flight.write_bytes(dataflash.definitions() + dataflash.imu(1))
    other.write_bytes(ulog.header() + ulog.definitions() + ulog.combined(1))
    assert isinstance(open_log(flight, CONFIGURATION), DataflashReader)
    assert isinstance(open_log(other, CONFIGURATION), UlogReader)
    for path in (flight, other):
        assert [sample.link for sample in open_log(path, CONFIGURATION)] == ["autopilot"]
    assert kind_of(flight).link == "mavlink"


@pytest.mark.parametrize("ending", [".log", ".asc", ".blf", ".trc"])
def test_a_recording_of_a_bus(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"drive{ending}"
    path.write_bytes(b"")
    assert isinstance(open_log(path, CONFIGURATION), CanLogReader)
    assert kind_of(path).link == "can"


def test_what_is_no_log(tmp_path: Path) -> None:
    path = tmp_path / "song.mp3"
    path.write_bytes(b"ID3")
    with pytest.raises(LogError, match=r"song\.mp3: cannot tell what log this is.*\.bin \(DataFlash log\)"):
        kind_of(path)
    with pytest.raises(LogError, match="no such file"):
        kind_of(tmp_path / "absent.bin")
    path.write_bytes(b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n")
    with pytest.raises(LogError, match=r"as text; replay the \.bin that it was made from"):
        kind_of(path)


def test_a_log_that_no_link_would_have_heard(tmp_path: Path) -> None:
    path = tmp_path / "drive.blf"
    path.write_bytes(b"LOGG")
    alone = CONFIGURATION.model_copy(update={"link": CONFIGURATION.link[:1]})
    with pytest.raises(
        LogError, match=r"is a Vector \.blf log, and the configuration has no link of kind can"
    ):
        open_log(path, alone)


def test_a_dbc_file_that_has_gone(tmp_path: Path) -> None:
    path = tmp_path / "drive.log"
    path.write_bytes(b"")
    signals = (Signal(signal="A.B", measures="speed"),)
    link = CanLink(
        name="car",
        kind="can",
        channel="can0",
        protocol="dbc",
        dbc=str(tmp_path / "absent.dbc"),
        signal=signals,
    )
    with pytest.raises(LogError, match=r'link "car": .*absent\.dbc: cannot be read'):
        open_log(path, CONFIGURATION.model_copy(update={"link": (link,)}))
