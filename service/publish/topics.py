"""The wire surface in one place: which keys a vehicle has, what each carries, and how it travels.

Everything hangs under ``<prefix>/<vehicle>/``. Chunks that begin with ``@`` are *verbatim*: no ``*`` or
``**`` of a subscriber or of a ``get`` ever matches them, so that a wildcard cannot fire a query by accident.
"""

from __future__ import annotations

from dataclasses import dataclass

import zenoh

PREFIX = "beliefd/v1"
"""The default of ``publish.prefix``; the version is that of the values, not of the program."""

HISTORY = 50
"""How many changes of health a late joiner gets."""

CLOUD_BYTES = 48 * 1024
"""Largest particle cloud, bytes: what fits one Zenoh batch goes out whole or not at all, never in pieces."""

JSON = "application/json"


@dataclass(frozen=True)
class Topic:
    """One published key.

    Attributes
    ----------
    key : str
        Below ``<prefix>/<vehicle>/``.
    value : str
        Name of the value in ``@rpc/schema``; for ``particles`` that of the attachment.
    encoding : str
        MIME type and schema, as Zenoh writes them: ``type/subtype;schema``.
    priority : zenoh.Priority
        Which of the transmission queues it uses. Congestion control is always DROP, express always off.
    rate : str
        How often, in words.
    """

    key: str
    value: str
    encoding: str
    priority: zenoh.Priority
    rate: str


ESTIMATE = Topic("estimate", "Estimate", f"{JSON};beliefd.Estimate", zenoh.Priority.REAL_TIME, "every tick")
SLOW = Topic("estimate/slow", "Estimate", f"{JSON};beliefd.Estimate", zenoh.Priority.DATA, "5 Hz")
PARTICLES = Topic(
    "particles", "Cloud", "application/octet-stream;beliefd.Cloud", zenoh.Priority.BACKGROUND, "5 Hz"
)
HYPOTHESES = Topic(
    "hypotheses", "Hypotheses", f"{JSON};beliefd.Hypotheses", zenoh.Priority.DATA_HIGH, "10 Hz"
)
BUDGET = Topic("budget", "Budget", f"{JSON};beliefd.Budget", zenoh.Priority.DATA_LOW, "1 Hz")
SENSORS = Topic("sensors", "Sensors", f"{JSON};beliefd.Sensors", zenoh.Priority.DATA_LOW, "1 Hz")
HEALTH = Topic("health", "Health", f"{JSON};beliefd.Health", zenoh.Priority.INTERACTIVE_HIGH, "on change")

TOPICS = (ESTIMATE, SLOW, HYPOTHESES, PARTICLES, BUDGET, SENSORS, HEALTH)

LATEST = "@rpc/latest"
STATUS = "@rpc/status"
CONFIG = "@rpc/config"
SCHEMA = "@rpc/schema"
QUERIES = (LATEST, STATUS, CONFIG, SCHEMA)

REINITIALIZE = "@rpc/reinitialize"
DENSITY = "@rpc/density"
REQUESTS = (REINITIALIZE, DENSITY)
"""Queries that ask the belief for something."""

LIVE = "@live"


@dataclass(frozen=True)
class Keys:
    """The full keys of one vehicle.

    Raises
    ------
    ValueError
        The prefix or the vehicle's name cannot be part of a Zenoh key.
    """

    prefix: str
    vehicle: str

    def __post_init__(self) -> None:
        if (
            "/" in self.vehicle
            or any(mark in self.vehicle for mark in "*$#?")
            or self.vehicle.startswith("@")
        ):
            raise ValueError(
                f"vehicle {self.vehicle!r}: a name is one chunk of a key, without / * $ # ? or a leading @"
            )
        try:
            zenoh.KeyExpr(f"{self.prefix}/{self.vehicle}")
        except zenoh.ZError as error:
            raise ValueError(f"{self.prefix}/{self.vehicle} is not a Zenoh key: {error}") from error

    def of(self, key: str) -> str:
        """Return the full key of what stands below the vehicle, such as ``estimate`` or ``@rpc/status``."""
        return f"{self.prefix}/{self.vehicle}/{key}"


def live(prefix: str) -> str:
    """Return the expression that every vehicle's liveliness token matches."""
    return f"{prefix}/*/{LIVE}"


def vehicle_of(prefix: str, key: str) -> str:
    """Return whose key this is: the chunk after the prefix."""
    return key.removeprefix(f"{prefix}/").split("/", 1)[0]
