"""From a TOML file to a configuration, or to every reason why not, at once."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from service.config.checks import across_sections, resolved
from service.config.complaints import ConfigurationError, complaints
from service.config.configuration import Configuration, Site
from service.config.section import one_line

SiteType = TypeVar("SiteType", Configuration, Site)


def _content(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except tomllib.TOMLDecodeError as error:
        raise ConfigurationError([f"{path.name}: not TOML: {error}"]) from error
    except UnicodeDecodeError as error:
        raise ConfigurationError(
            [f"{path.name}: not UTF-8 text: {error.reason} at byte {error.start}"]
        ) from error
    except ValueError as error:  # tomllib lets Python's own limit on digits through
        raise ConfigurationError([f"{path.name}: not a configuration: {error}"]) from error
    except RecursionError as error:
        raise ConfigurationError([f"{path.name}: not a configuration: nested too deeply"]) from error
    except OSError as error:
        raise ConfigurationError([f"{path}: cannot be read: {error.strerror}"]) from error


def _read(path: Path, model: type[SiteType]) -> SiteType:
    raw = resolved(_content(path), path.resolve().parent)
    return validated(raw, model, path.name)


def validated(raw: dict[str, Any], model: type[SiteType], name: str) -> SiteType:
    """Return the content of a file as ``model``.

    Parameters
    ----------
    raw : dict
        What the TOML says.
    model : type
        :class:`Configuration` or :class:`Site`.
    name : str
        Name of the file, said before each error.

    Raises
    ------
    ConfigurationError
        With every error, each with its place.
    """
    found: list[str] = []
    configuration: SiteType | None = None
    try:
        configuration = model.model_validate(raw)
    except ValidationError as error:
        found += complaints(error, raw, model)
    found += across_sections(raw)
    if configuration is None or found:
        raise ConfigurationError([one_line(f"{name}: {line}") for line in found])
    return configuration


def load(path: str | Path) -> Configuration:
    """Read a configuration file.

    Raises
    ------
    ConfigurationError
        The file cannot be read, is not TOML, or says something wrong: every error, each with its place.
    """
    return _read(Path(path), Configuration)


def site(path: str | Path) -> Site:
    """Read a file that may leave out the vehicle and its links: origin, beacons, start of a recording.

    Raises
    ------
    ConfigurationError
        As :func:`load`.
    """
    return _read(Path(path), Site)
