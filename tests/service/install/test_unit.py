from __future__ import annotations

import configparser
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from service.config import Configuration, validated
from service.install.unit import Names, memory_limit, render

EXPOSURE = 2.5

needs_systemd_analyze = pytest.mark.skipif(
    shutil.which("systemd-analyze") is None, reason="systemd-analyze is not on this machine"
)


def configuration(**sections: Any) -> Configuration:
    least = {
        "vehicle": {"name": "mower"},
        "link": [{"name": "bus", "kind": "can", "channel": "vcan0"}],
    }
    return validated(least | sections, Configuration, "robot.toml")


def rendered(name: str | None = None, **sections: Any) -> str:
    return render(Names.of(name), configuration(**sections), Path(sys.executable))


def parsed(text: str) -> dict[str, list[str]]:
    """Read a unit with an independent reader: every value of every key of [Service]."""
    keys: dict[str, list[str]] = {}

    class Collecting(dict[str, Any]):
        pass

    reader = configparser.RawConfigParser(strict=False, dict_type=Collecting, comment_prefixes="#")
    reader.optionxform = str  # type: ignore[assignment,method-assign]
    reader.read_string(text)
    for line in text.partition("[Service]")[2].partition("\n[Install]")[0].splitlines():
        if "=" in line and not line.startswith("#"):
            key, _, value = line.partition("=")
            keys.setdefault(key, []).append(value)
    assert set(reader["Service"]) == set(keys)
    return keys


def written(folder: Path, text: str) -> Path:
    path = folder / "beliefd.service"
    path.write_text(text)
    return path


@needs_systemd_analyze
@pytest.mark.parametrize("priority", [0, 50])
def test_systemd_finds_nothing_wrong(tmp_path: Path, priority: int) -> None:
    path = written(tmp_path, rendered(loop={"priority": priority}))
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(path)], capture_output=True, text=True, check=False
    )
    # it exits 0 on an unknown key: what it prints is what counts
    assert (done.returncode, done.stdout + done.stderr) == (0, "")


@needs_systemd_analyze
def test_verify_would_see_an_unknown_key(tmp_path: Path) -> None:
    path = written(tmp_path, rendered().replace("NoNewPrivileges=", "NoNewPriviliges="))
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(path)], capture_output=True, text=True, check=False
    )
    assert "NoNewPriviliges" in done.stderr


@needs_systemd_analyze
@pytest.mark.parametrize("priority", [0, 50])
def test_exposure_is_small(tmp_path: Path, priority: int) -> None:
    path = written(tmp_path, rendered(loop={"priority": priority}))
    done = subprocess.run(
        [
            "systemd-analyze",
            "security",
            "--offline=true",
            "--no-pager",
            f"--threshold={EXPOSURE * 10:.0f}",
            str(path),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    found = re.search(r"Overall exposure level.*?: ([\d.]+)", done.stdout)
    assert found
    assert float(found[1]) <= EXPOSURE


def test_it_is_watched_and_restarted() -> None:
    keys = parsed(rendered())
    assert keys["Type"] == ["notify"]
    assert keys["NotifyAccess"] == ["main"]
    assert 2 <= int(keys["WatchdogSec"][0]) <= 5
    assert keys["Restart"] == ["on-failure"]
    assert keys["RestartPreventExitStatus"] == ["2"]
    assert int(keys["TimeoutStopSec"][0]) >= 20


def test_it_has_the_address_families_of_its_links() -> None:
    families = set(parsed(rendered())["RestrictAddressFamilies"][0].split())
    assert families == {"AF_UNIX", "AF_INET", "AF_INET6", "AF_CAN", "AF_NETLINK"}


@pytest.mark.parametrize(("priority", "limit", "ordinary"), [(0, "0", "yes"), (50, "50", "no")])
def test_real_time_is_allowed_as_far_as_it_is_asked_for(priority: int, limit: str, ordinary: str) -> None:
    keys = parsed(rendered(loop={"priority": priority}))
    assert keys["LimitRTPRIO"] == [limit]
    assert keys["RestrictRealtime"] == [ordinary]
    assert keys["CapabilityBoundingSet"] == keys["AmbientCapabilities"] == [""]


def test_memory_is_bounded_by_what_the_particles_need() -> None:
    few = configuration(budget={"particles_max": 1000})
    many = configuration(budget={"particles_max": 1_000_000})
    assert memory_limit(many) - memory_limit(few) == 999_000 * 256
    assert 400 * 2**20 < memory_limit(few) < 2**30
    assert parsed(rendered(budget={"particles_max": 1_000_000}))["MemoryMax"] == ["1012M"]


def test_state_elsewhere_is_made_writable() -> None:
    assert "ReadWritePaths" not in parsed(rendered())
    assert parsed(rendered(state={"directory": "/var/lib/fleet/mower"}))["StateDirectory"] == ["fleet/mower"]
    elsewhere = parsed(rendered(state={"directory": "/srv/mower"}))
    assert elsewhere["ReadWritePaths"] == ["/srv/mower"]


def test_several_installations_have_their_own_unit_and_configuration() -> None:
    names = Names.of("boat")
    assert str(names.unit_file) == "/etc/systemd/system/beliefd-boat.service"
    assert str(names.configuration) == "/etc/beliefd/beliefd-boat.toml"
    assert " run /etc/beliefd/beliefd-boat.toml" in parsed(rendered("boat"))["ExecStart"][0]
    assert parsed(rendered("boat"))["RuntimeDirectory"] == ["beliefd-boat"]


@pytest.mark.parametrize("name", ["", "a b", "../x", "-x", "x" * 50, "a.b"])
def test_a_name_that_no_unit_can_have_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="needs letters, digits"):
        Names.of(name)


def test_nothing_of_the_template_is_left_over() -> None:
    text = rendered()
    assert "$MAINPID" in text
    assert text.count("$") == 1
