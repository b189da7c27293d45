"""The configuration and the files it names, copied to where the service may read them."""

from __future__ import annotations

import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path, PurePath
from typing import Any

from service.config.checks import FILES, entries
from service.install.system import InstallError

_HIDDEN = ("/home", "/root", "/run/user", "/tmp", "/var/tmp")
"""What ProtectHome= and PrivateTmp= keep from the service."""

_READABLE = 0o640


def hidden(path: Path) -> bool:
    """Tell whether the service cannot see ``path``, whatever its permissions."""
    return any(path.is_relative_to(place) for place in _HIDDEN)


def _named(raw: dict[str, Any]) -> Iterator[str]:
    for table, key in FILES:
        for _, entry in entries(raw, table):
            value = entry.get(key)
            if isinstance(value, str) and value:
                yield value


def copied(source: Path, target: Path, group: str) -> list[Path]:
    """Copy a configuration to ``target``, and what it names by relative paths beside it.

    Returns
    -------
    list[Path]
        What was written. The files belong to root and are readable by ``group`` only.

    Raises
    ------
    InstallError
        The file names something that the service will not be able to see.
    """
    raw = tomllib.loads(source.read_text(encoding="utf-8"))
    pairs = [(source, target)]
    for name in _named(raw):
        if PurePath(name).is_absolute():
            if hidden(Path(name)):
                raise InstallError(
                    f"{source.name}: the service cannot see {name}; keep it under /etc/beliefd"
                )
        elif ".." in PurePath(name).parts:
            raise InstallError(f"{source.name}: {name} leads out of its folder; name it by an absolute path")
        else:
            pairs.append((source.parent / name, target.parent / name))
    for origin, copy in pairs:
        copy.parent.mkdir(parents=True, exist_ok=True)
        if origin.resolve() != copy.resolve():
            shutil.copyfile(origin, copy)
        shutil.chown(copy, "root", group)
        copy.chmod(_READABLE)
    return [copy for _, copy in pairs]
