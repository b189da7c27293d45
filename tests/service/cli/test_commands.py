"""The command line from outside: a process, its exit status, what it says and where."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from service.cli.application import application

ROOT = Path(__file__).parents[3]
LEAST = """
[vehicle]
name = "mower"
[[link]]
name = "bus"
kind = "can"
channel = "vcan_that_is_not_there"
"""


def beliefd(*arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", "from service.cli import main; main()", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        cwd=ROOT,
        env={**os.environ, "COLUMNS": "160", "NO_COLOR": "1", "TERM": "dumb"} | environment,
    )


@pytest.fixture
def configuration(tmp_path: Path) -> Path:
    path = tmp_path / "robot.toml"
    path.write_text(LEAST)
    return path


@pytest.mark.parametrize(
    ("command", "words"),
    [("replay", "beliefd[view]"), ("scenario", "[honesty]"), ("run", "beliefd[record]"), ("send", "[start]")],
)
def test_what_stands_in_brackets_is_text_and_no_markup(command: str, words: str) -> None:
    assert words in beliefd(command, "--help").stdout


def test_a_check_names_every_key_that_is_published(configuration: Path) -> None:
    said = "".join(beliefd("check", configuration).stdout.replace("│", " ").split())
    for key in ("estimate/slow", "hypotheses", "health", "@rpc/reinitialize", "@rpc/density", "@live"):
        assert key in said


COMMANDS = ["demo", "run", "check", "sim", "listen", "send", "replay", "scenario", "textbook", "service"]


def test_help_names_every_command_and_hides_what_is_not_for_users() -> None:
    done = beliefd("--help")
    assert done.returncode == 0
    for command in COMMANDS:
        assert f" {command} " in done.stdout
    assert " warm " not in done.stdout


@pytest.mark.parametrize(
    "command", [*COMMANDS, "warm", "service install", "service status", "service uninstall"]
)
def test_every_command_explains_itself(command: str) -> None:
    said = CliRunner().invoke(application, [*command.split(), "--help"], prog_name="beliefd", color=False)
    assert said.exit_code == 0
    assert f"Usage: beliefd {command}" in said.output


def test_help_loads_neither_the_compiler_nor_zenoh() -> None:
    code = (
        "import sys, service.cli; print(sorted({'numba', 'zenoh', 'pymavlink', 'numpy'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == "[]"


def test_the_version_is_the_distributions() -> None:
    done = beliefd("--version")
    assert (done.returncode, done.stdout) == (0, "beliefd 0.1.0\n")


@pytest.mark.parametrize(
    "wrong", [["bogus"], ["run"], ["check", "a", "b"], ["replay"], ["demo", "--seconds", "x"]]
)
def test_wrong_use_is_2(wrong: list[str]) -> None:
    done = beliefd(*wrong)
    assert done.returncode == 2
    assert "Usage:" in done.stderr


def test_check_prints_what_would_run(configuration: Path) -> None:
    done = beliefd("check", configuration)
    assert done.returncode == 0, done.stderr
    for expected in (
        "mower",
        "unicycle",
        "socketcan:vcan_that_is_not_there",
        "dronecan",
        "4 ms per tick",
        "20 %",
    ):
        assert expected in done.stdout
    assert "beliefd/v1/mower/" in done.stdout
    assert 'note: link "bus": there is no interface vcan_that_is_not_there here now' in done.stdout
    assert "note: no [[sensor]]: the belief is dead reckoning only" in done.stdout
    assert "note: start: first_fix waits for a [[sensor]] of kind position" in done.stdout
    assert done.stdout.endswith("robot.toml: usable\n")


@pytest.mark.parametrize("content", ["{mode: ", '{modus: "peer"}'])
def test_check_reads_the_zenoh_file_that_is_named(configuration: Path, content: str) -> None:
    configuration.with_name("zenoh.json5").write_text(content)
    configuration.write_text(LEAST + '[publish]\nzenoh = "zenoh.json5"\n')
    done = beliefd("check", configuration)
    assert done.returncode == 2
    assert "publish.zenoh" in done.stderr
    configuration.with_name("zenoh.json5").write_text('{mode: "peer"}')
    assert beliefd("check", configuration).returncode == 0


def test_check_shows_links_sensors_and_limits_of_the_example() -> None:
    done = beliefd("check", "beliefd.example.toml")
    assert done.returncode == 0
    for expected in (
        "udpin:127.0.0.1:14550",
        "range",
        "scale",
        "200 to 100,000",
        "90 ms",
        "tcp/127.0.0.1:7447",
    ):
        assert expected in done.stdout


@pytest.mark.parametrize("command", [("check",), ("run",), ("service", "install")])
def test_a_wrong_configuration_is_2_with_every_error_on_standard_error(
    command: tuple[str, ...], configuration: Path
) -> None:
    configuration.write_text(LEAST.replace("channel", "chanel") + "[loop]\nrate = 0\n")
    done = beliefd(*command, configuration)
    if command[0] == "service" and "must be root" in done.stderr + done.stdout:
        pytest.skip("installing says first that it needs root")
    if command[0] == "service" and "systemd is not running" in done.stderr:
        pytest.skip("installing says first that it needs systemd; tests/system shows it where that runs")
    assert done.returncode == 2
    assert done.stdout == ""
    lines = done.stderr.splitlines()
    assert lines[0] == "robot.toml: loop, rate: needs at least 1, got 0"
    assert lines[1].startswith('robot.toml: link "bus" (link 1), channel: is missing')
    assert lines[2] == 'robot.toml: link "bus" (link 1), chanel: unknown key; did you mean "channel"?'
    assert lines[3] == "3 errors in the configuration; docs/configuration.md has every key"
    assert len(lines) == 4


@pytest.mark.parametrize("command", ["check", "run"])
def test_an_absent_configuration_is_2(command: str, tmp_path: Path) -> None:
    done = beliefd(command, tmp_path / "absent.toml")
    assert done.returncode == 2
    assert "absent.toml: cannot be read: No such file or directory" in done.stderr


def test_sim_passes_everything_through_to_the_simulator(tmp_path: Path) -> None:
    stem = tmp_path / "drive"
    done = beliefd("sim", "beacons", "--write", stem, "--seconds", "1", "--seed", "3")
    assert done.returncode == 0, done.stderr
    assert stem.with_suffix(".tlog").stat().st_size > 1000
    assert beliefd("sim", "no-such-scenario", "--write", stem).returncode == 2


def test_scenario_without_a_name_lists_them() -> None:
    done = beliefd("scenario")
    assert done.returncode == 0, done.stderr
    assert "beacons" in done.stdout


def test_status_of_what_is_not_installed_is_1() -> None:
    done = beliefd("service", "status", "--name", "not-installed-here")
    assert done.returncode == 1
    assert "there is no /etc/systemd/system/beliefd-not-installed-here.service" in done.stderr


def test_a_name_that_no_unit_can_have_is_2() -> None:
    done = beliefd("service", "status", "--name", "a/b")
    assert done.returncode == 2
    assert "needs letters, digits" in done.stderr


def test_uninstalling_what_is_not_there_is_1() -> None:
    done = beliefd("service", "uninstall", "--name", "not-installed-here")
    assert done.returncode == 1
    assert "nothing to remove" in done.stderr or "must be root" in done.stderr
