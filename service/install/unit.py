"""The systemd unit: how the daemon runs, what it may do, and what it may not."""

from __future__ import annotations

import grp
import re
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from string import Template

from service.config import Configuration

USER = "beliefd"
"""The account of the service; it owns nothing but its state and its cache."""

SERIAL_GROUP = "dialout"
"""Who may open serial lines, where the distribution has such a group."""

_RESIDENT_BYTES = 768 * 2**20
"""What the processes may hold together before a particle is allocated; twice what is measured."""

_PARTICLE_BYTES = 256
"""What a particle may take: float32 columns, doubled, with weights, noise and the output predictor."""


@dataclass(frozen=True)
class Names:
    """What one installation is called and where its parts lie."""

    unit: str

    @staticmethod
    def of(name: str | None) -> Names:
        """Return the names of the only installation (None), or of one of several.

        Raises
        ------
        ValueError
            The name cannot be part of a unit's name.
        """
        if name is None:
            return Names("beliefd")
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]{0,40}", name):
            raise ValueError(f"--name {name}: needs letters, digits, - and _ only, at most 41")
        return Names(f"beliefd-{name}")

    @property
    def service(self) -> str:
        """Return the unit as systemctl takes it."""
        return f"{self.unit}.service"

    @property
    def unit_file(self) -> Path:
        """Return where the unit is written."""
        return Path("/etc/systemd/system", self.service)

    @property
    def configuration(self) -> Path:
        """Return where the service reads its configuration."""
        return Path("/etc/beliefd", f"{self.unit}.toml")


def _group_exists(name: str) -> bool:
    try:
        grp.getgrnam(name)
    except KeyError:
        return False
    return True


def _state(directory: str) -> tuple[str, str]:
    """Return StateDirectory= and a line for what lies elsewhere than /var/lib."""
    path = Path(directory)
    if path.is_relative_to("/var/lib") and path != Path("/var/lib"):
        return str(path.relative_to("/var/lib")), ""
    return "beliefd", f"ReadWritePaths={directory}"


def memory_limit(configuration: Configuration) -> int:
    """Return MemoryMax= in bytes: well above what the daemon needs, so that only a leak meets it."""
    return _RESIDENT_BYTES + _PARTICLE_BYTES * configuration.budget.particles_max


def render(names: Names, configuration: Configuration, executable: Path) -> str:
    """Return the text of the unit for a configuration.

    Parameters
    ----------
    names : Names
        Of this installation.
    configuration : Configuration
        As the service will read it.
    executable : Path
        The ``beliefd`` script of the environment to run.
    """
    state, writable = _state(configuration.state.directory)
    template = Template(files("service.install").joinpath("beliefd.service").read_text(encoding="utf-8"))
    text = template.substitute(
        unit=names.unit,
        vehicle=configuration.vehicle.name,
        documentation=names.configuration,
        executable=executable,
        configuration=names.configuration,
        user=USER,
        groups=f"SupplementaryGroups={SERIAL_GROUP}" if _group_exists(SERIAL_GROUP) else "",
        state=state,
        writable=writable,
        priority=configuration.loop.priority,
        ordinary="no" if configuration.loop.priority else "yes",
        memory=f"{memory_limit(configuration) // 2**20}M",
    )
    return re.sub(r"\n\n\n+", "\n\n", text)
