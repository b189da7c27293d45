from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from service.install import InstallError, install, uninstall
from service.install.installation import executable, owned

EXAMPLE = Path(__file__).parents[3] / "beliefd.example.toml"


def silent(_: str) -> None:
    """Say nothing."""


def test_changing_the_system_needs_root(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    with pytest.raises(
        InstallError, match="install changes the system and must be root: sudo beliefd service install"
    ):
        install(EXAMPLE, None, silent)
    with pytest.raises(InstallError, match="must be root: sudo beliefd service uninstall"):
        uninstall(None, silent)


@pytest.mark.skipif(
    Path("/run/systemd/system").is_dir(), reason="systemd runs here: tests/system installs in earnest"
)
@pytest.mark.skipif(os.getuid() != 0, reason="another user is refused before")
def test_installing_needs_systemd_and_says_what_needs_none() -> None:
    with pytest.raises(
        InstallError, match="systemd is not running on this machine; beliefd run CONFIG needs none"
    ):
        install(EXAMPLE, None, silent)


def test_a_folder_that_others_use_is_not_taken_from_them(tmp_path: Path) -> None:
    """state.directory = "/var/lib" must not shut everybody else out of it."""
    (tmp_path / "theirs").touch()
    before = tmp_path.stat()
    with pytest.raises(InstallError, match=r"is not empty; name a folder of the service's own"):
        owned(tmp_path)
    after = tmp_path.stat()
    assert (after.st_uid, after.st_mode) == (before.st_uid, before.st_mode)


def environment(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    python = folder / "bin" / "python"
    monkeypatch.setattr(sys, "executable", str(python))
    return python.parent / "beliefd"


def test_an_environment_without_the_script_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = environment(tmp_path, monkeypatch)
    with pytest.raises(InstallError, match=f"there is no {script}: install the distribution"):
        executable()


def test_an_environment_that_the_service_cannot_see_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert str(tmp_path).startswith(("/tmp", "/var/tmp")), tmp_path
    script = environment(tmp_path, monkeypatch)
    script.parent.mkdir()
    script.touch()
    with pytest.raises(
        InstallError, match=r"cannot see .*: home directories and /tmp are hidden .*/opt/beliefd"
    ):
        executable()
