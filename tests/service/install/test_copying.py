from __future__ import annotations

import os
from pathlib import Path

import pytest

from service.install.copying import copied, hidden
from service.install.system import InstallError, as_user, call

LEAST = '[vehicle]\nname = "mower"\n[[link]]\nname = "a"\nkind = "mavlink"\nurl = "udpin:127.0.0.1:1"\n'
as_root = pytest.mark.skipif(os.getuid() != 0, reason="giving files to root needs root")


def source(folder: Path, key: str = "") -> Path:
    path = folder / "robot.toml"
    path.write_text(LEAST + (f'signing_key_file = "{key}"\n' if key else ""))
    return path


@as_root
def test_what_is_named_by_a_relative_path_goes_along(tmp_path: Path) -> None:
    (tmp_path / "keys").mkdir()
    (tmp_path / "keys" / "signing.key").write_text("0" * 64)
    target = tmp_path / "etc" / "beliefd.toml"
    made = copied(source(tmp_path, "keys/signing.key"), target, "root")
    assert made == [target, tmp_path / "etc" / "keys" / "signing.key"]
    assert made[1].read_text() == "0" * 64
    assert all(path.stat().st_mode & 0o777 == 0o640 for path in made)


@as_root
def test_a_configuration_that_is_there_already_stays(tmp_path: Path) -> None:
    path = source(tmp_path)
    assert copied(path, path, "root") == [path]
    assert path.read_text() == LEAST


@pytest.mark.parametrize(
    ("key", "reason"),
    [
        ("/root/signing.key", "the service cannot see /root/signing.key; keep it under /etc/beliefd"),
        ("/home/me/signing.key", "the service cannot see"),
        ("../signing.key", "leads out of its folder; name it by an absolute path"),
    ],
)
def test_what_the_service_could_not_read_is_refused_before_anything_is_written(
    tmp_path: Path, key: str, reason: str
) -> None:
    target = tmp_path / "etc" / "beliefd.toml"
    with pytest.raises(InstallError, match=reason):
        copied(source(tmp_path, key), target, "root")
    assert not target.exists()


def test_homes_and_temporary_folders_are_hidden_from_the_service() -> None:
    assert all(
        hidden(Path(place)) for place in ("/root/.venv/bin/beliefd", "/home/a/x", "/tmp/x", "/run/user/1/x")
    )
    assert not any(hidden(Path(place)) for place in ("/opt/venv/bin/beliefd", "/etc/x", "/homestead/x"))


def test_a_program_that_fails_says_which_and_what_it_said() -> None:
    with pytest.raises(InstallError, match=r"^sh -c echo no >&2; exit 3: exit 3: no$"):
        call("sh", "-c", "echo no >&2; exit 3")


def test_a_program_that_is_absent_is_named() -> None:
    with pytest.raises(InstallError, match="no-such-program is not on this machine"):
        call("no-such-program")


@as_root
def test_a_command_as_another_user_has_only_its_own_environment() -> None:
    said = call(*as_user("nobody", "sh", "-c", "id -un; env", CACHE_DIRECTORY="/x"))
    lines = said.splitlines()
    assert lines[0] == "nobody"
    assert "CACHE_DIRECTORY=/x" in lines
    assert not any(line.startswith("HOME=") for line in lines)
