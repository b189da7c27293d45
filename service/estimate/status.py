"""How the service is: its processes, what it published, and the last of everything else."""

from __future__ import annotations

import msgspec

from service.estimate.budget import Budget, StageCost
from service.estimate.health import Health
from service.estimate.sensors import Sensors


class ProcessStatus(msgspec.Struct, frozen=True, gc=False):
    """One process of the service.

    Attributes
    ----------
    name : str
        ``supervisor``, ``loop``, ``publisher``, ``link autopilot`` …
    pid : int or None
        Its number while it runs.
    state, reason : str
        ``starting``, ``running``, ``waiting`` (to be started again), ``stopping`` or ``stopped``; how it
        ended last.
    restarts : int
        How often it was started again.
    resident_bytes : int or None
        Memory that it holds.
    """

    name: str
    pid: int | None
    state: str
    restarts: int
    reason: str
    resident_bytes: int | None


class Publishing(msgspec.Struct, frozen=True, gc=False):
    """What the publishing process did with what the loop gave it; counts since that process started.

    Attributes
    ----------
    session : str
        How the Zenoh session stands: ``listening on tcp/127.0.0.1:7447``, ``connected to …``.
    opened : int
        How often a session was opened.
    published : dict[str, int]
        Values put, by topic.
    superseded : dict[str, int]
        Values never put because a newer one of the topic was there already: the process was behind.
    unsent : dict[str, int]
        Values that had no session to go to, or whose put failed. Changes of ``health`` are made good as soon
        as a session is open.
    malformed : dict[str, int]
        Datagrams that were none, by kind: ``unknown_tag``, ``broken_cloud``, ``large_cloud`` …
    put_ms : StageCost or None
        Milliseconds that one put took, over the last thousand.
    """

    session: str
    opened: int
    published: dict[str, int]
    superseded: dict[str, int]
    unsent: dict[str, int]
    malformed: dict[str, int]
    put_ms: StageCost | None


class Status(msgspec.Struct, frozen=True, gc=False):
    """The answer to ``@rpc/status``.

    Attributes
    ----------
    vehicle, version : str
        Whose daemon it is, and which.
    started : float
        When the publishing process started, Unix seconds.
    health, budget, sensors : Health, Budget, Sensors or None
        The last of each; ``null`` while there was none.
    processes : list[ProcessStatus]
        All of the service.
    publishing : Publishing or None
        What the publishing process did and dropped.
    """

    vehicle: str
    version: str
    started: float
    health: Health | None
    budget: Budget | None
    sensors: Sensors | None
    processes: list[ProcessStatus]
    publishing: Publishing | None = None
