"""How every sensor and every link is."""

from __future__ import annotations

import msgspec


class SensorStatus(msgspec.Struct, frozen=True, gc=False):
    """One sensor as the estimator sees it.

    Attributes
    ----------
    name : str
        Kind and link as configured, and the beacon where there is one: ``range/autopilot/5``.
    rate : float
        Readings per second over the last second.
    trust : float or None
        Log odds that the sensor tells the truth; ``null`` while not estimated.
    accepted : int
        Readings used so far.
    refused : dict[str, int]
        Readings not used, by reason: ``late``, ``future``, ``invalid``, ``no_beacon``, ``outlier``, ``thinned`` …
    innovation : float or None
        The last one, measured minus expected, in the sensor's own unit (m, m/s, rad).
    age : float or None
        Seconds since the last reading used; ``null`` when there was none.
    """

    name: str
    rate: float
    trust: float | None
    accepted: int
    refused: dict[str, int]
    innovation: float | None
    age: float | None


class LinkStatus(msgspec.Struct, frozen=True, gc=False):
    """One link as its process reports it; the counts are totals since that process started.

    Attributes
    ----------
    name : str
        As configured.
    state, reason : str
        ``opening``, ``up``, ``silent`` (open, but nothing arrives) or ``retrying``, and why.
    messages, samples : int
        Messages understood, samples made of them.
    malformed : dict[str, int]
        What was broken and refused, by kind: ``bad_checksum``, ``GPS_RAW_INT.latitude`` …
    unusable : dict[str, int]
        Well-formed readings that say nothing usable: no fix, out of range, a sensor not fitted. By field:
        ``GPS_RAW_INT.fix_type`` …
    ignored : int
        Messages that are well-formed but not wanted: another system, component or kind.
    dropped : int
        Samples that the loop's queue had no room for.
    lost : int or None
        Messages of the vehicle that never arrived whole, by the gaps in the numbering of their senders
        (MAVLink); ``null`` where messages bear no numbers. Numbers wrap at 256, so a long outage loses more.
    clock : str
        How the sensor's clock is mapped to the host's: ``timesync``, ``envelope`` …
    offset, jitter : float or None
        Seconds from the sensor's clock to the host's, and the spread of arrival about it.
    age : float or None
        Seconds since the last sample arrived.
    """

    name: str
    state: str
    reason: str
    messages: int
    samples: int
    malformed: dict[str, int]
    unusable: dict[str, int]
    ignored: int
    dropped: int
    lost: int | None
    clock: str
    offset: float | None
    jitter: float | None
    age: float | None


class Sensors(msgspec.Struct, frozen=True, gc=False):
    """Once a second: every sensor and every link.

    Attributes
    ----------
    time : float
        Unix seconds.
    sensors, links : list[SensorStatus], list[LinkStatus]
        All that are configured or were heard.
    """

    time: float
    sensors: list[SensorStatus]
    links: list[LinkStatus]
