"""Which processes a configuration asks for, and what a change of it renews."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from service.config import ConfigurationError, load
from service.wiring import Wiring, configuration_from

TOML = """
[vehicle]
name = "rover"
[start]
position = [1.0, 2.0, 0.0]
heading = 0.5
[loop]
rate = {rate}
[[link]]
name = "autopilot"
kind = "mavlink"
url = "{url}"
rates = {{ RAW_IMU = 50.0 }}
{more}
[[sensor]]
kind = "range"
estimate = ["scale"]
[[beacon]]
id = 3
latitude = 40.0
longitude = -80.0
altitude = 300.0
"""
DESCRIPTORS = (
    *("--configuration", "--heart", "--publisher", "--link", "--samples", "--estimates"),
    *("--orders", "--checkpoints"),
)
BUS = """
[[link]]
name = "bus"
kind = "can"
channel = "vcan7"
options = { sleep_after_open = 0.0 }
"""


def write(path: Path, rate: float = 50.0, url: str = "udpin:127.0.0.1:0", more: str = BUS) -> Path:
    path.write_text(TOML.format(rate=rate, url=url, more=more))
    return path


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return write(tmp_path / "rover.toml")


@pytest.fixture
def wiring(file: Path) -> Iterator[Wiring]:
    made = Wiring(file)
    yield made
    made.close()


def settings(wiring: Wiring) -> dict[str, str]:
    return {program.name: program.settings for program in wiring.programs()}


def test_one_process_for_each_link_one_loop_one_publisher(wiring: Wiring) -> None:
    programs = wiring.programs()
    assert [program.name for program in programs] == ["loop", "publisher", "link autopilot", "link bus"]
    assert [program.name for program in programs if program.vital] == ["loop"]
    assert [program.heart is not None for program in programs] == [True, False, True, True]


def test_everybody_reads_the_configuration_that_was_found_right(wiring: Wiring, file: Path) -> None:
    """Through a sealed file in memory: what becomes of the file on disk does not matter."""
    expected = load(file)
    file.write_text("broken [")
    for program in wiring.programs():
        words = list(program.command)
        descriptor = int(words[words.index("--configuration") + 1])
        assert descriptor in program.descriptors
        assert configuration_from(descriptor) == expected
        with pytest.raises(PermissionError):
            os.write(descriptor, b"x")


def test_descriptors_are_all_that_the_command_names(wiring: Wiring) -> None:
    for program in wiring.programs():
        words = list(program.command)
        named = {int(word.rpartition("=")[2]) for option, word in pairwise(words) if option in DESCRIPTORS}
        assert named == set(program.descriptors)


def test_a_heart_must_beat_at_least_every_20_ticks(tmp_path: Path) -> None:
    wiring = Wiring(write(tmp_path / "slow.toml", rate=1.0))
    patience = next(program.patience for program in wiring.programs() if program.vital)
    wiring.close()
    assert patience == 20.0


def test_a_wrong_file_changes_nothing(wiring: Wiring, file: Path) -> None:
    before = wiring.programs()
    write(file, rate=-1.0, url="")
    with pytest.raises(ConfigurationError) as caught:
        wiring.reload()
    assert len(caught.value.errors) == 2
    assert wiring.programs() == before


def test_the_same_file_renews_nobody(wiring: Wiring) -> None:
    before = settings(wiring)
    wiring.reload()
    assert settings(wiring) == before


def test_another_rate_renews_loop_and_publisher_but_no_link(wiring: Wiring, file: Path) -> None:
    before = settings(wiring)
    write(file, rate=20.0)
    wiring.reload()
    after = settings(wiring)
    assert {name for name in after if after[name] != before[name]} == {"loop", "publisher"}
    assert all(configuration_from(program.descriptors[0]).loop.rate == 20.0 for program in wiring.programs())


def test_another_address_renews_that_link_but_not_the_other(wiring: Wiring, file: Path) -> None:
    before = settings(wiring)
    write(file, url="udpin:127.0.0.1:14999")
    wiring.reload()
    after = settings(wiring)
    assert {name for name in after if after[name] != before[name]} == {"loop", "publisher", "link autopilot"}


def test_a_link_may_go_and_come_back(wiring: Wiring, file: Path) -> None:
    write(file, more="")
    wiring.reload()
    assert "link bus" not in settings(wiring)
    write(file)
    wiring.reload()
    descriptors = wiring.programs()[-1].descriptors
    assert all(os.fstat(descriptor) for descriptor in descriptors)


def test_queues_outlive_a_reload(wiring: Wiring, file: Path) -> None:
    """A link that goes on must find its queue where it was."""
    before = {program.name: program.descriptors[1:] for program in wiring.programs()}
    write(file, rate=20.0)
    wiring.reload()
    assert {program.name: program.descriptors[1:] for program in wiring.programs()} == before


def test_nothing_is_left_open(file: Path) -> None:
    before = len(list(Path("/proc/self/fd").iterdir()))
    wiring = Wiring(file)
    wiring.programs()
    wiring.reload()
    wiring.close()
    assert len(list(Path("/proc/self/fd").iterdir())) == before


def test_a_recorder_runs_where_a_decision_log_is_asked_for(file: Path, tmp_path: Path) -> None:
    """It and the loop get the two ends of one queue, and nobody gets them otherwise."""
    with contextlib.closing(Wiring(file, tmp_path / "log.csv")) as wiring:
        programs = {program.name: program for program in wiring.programs()}
    recorder, loop = programs["recorder"], programs["loop"]
    assert str(tmp_path / "log.csv") in recorder.command
    assert int(loop.command[loop.command.index("--records") + 1]) in loop.descriptors
    assert int(recorder.command[recorder.command.index("--records") + 1]) in recorder.descriptors
    with contextlib.closing(Wiring(file)) as wiring:
        assert "recorder" not in {program.name for program in wiring.programs()}


def test_a_keeper_where_there_is_a_folder_for_it_and_none_where_there_is_not(file: Path) -> None:
    """The folder is not made: whoever installs decides whether a restart goes on or begins anew."""
    folder = file.parent / "state"
    file.write_text(file.read_text() + f'[state]\ndirectory = "{folder}"\n')
    with contextlib.closing(Wiring(file)) as wiring:
        assert "keeper" not in settings(wiring)
        folder.mkdir()
        wiring.reload()
        programs = {program.name: program for program in wiring.programs()}
        ends = [programs[name].command for name in ("keeper", "loop")]
        assert all("--checkpoints" in command for command in ends)
        assert str(folder / "rover.checkpoint") in programs["keeper"].command
        before = settings(wiring)
        file.write_text(file.read_text().replace('name = "rover"', 'name = "boat"'))
        wiring.reload()
        assert settings(wiring)["keeper"] != before["keeper"]  # it writes another file now
