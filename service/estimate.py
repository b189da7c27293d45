"""The values on the wire: what the daemon says about its belief, its budget, its sensors and its health.

One set of typed structs serves every consumer: JSON on Zenoh, JSON Schema on request (``@rpc/schema``), rows
of a replay. SI units, radians, north-east-down. A figure that is not known is ``null``, never a zero or NaN.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import msgspec
from msgspec import Meta

Metres = Annotated[float, Meta(description="m")]
Triple = tuple[float | None, float | None, float | None]
Triangle = tuple[float | None, float | None, float | None, float | None, float | None, float | None]


class HealthState(StrEnum):
    """What the belief is worth; each state is defined in docs/operating.md."""

    WAITING = "waiting"
    CONVERGING = "converging"
    TRACKING = "tracking"
    AMBIGUOUS = "ambiguous"
    DEAD_RECKONING = "dead_reckoning"
    LOST = "lost"
    STARVED = "starved"


class MotionMode(StrEnum):
    """How a vehicle moves: it stands, it moves as its wheels say, or its wheels slip."""

    STILL = "still"
    MOVING = "moving"
    SLIPPING = "slipping"


class Estimate(msgspec.Struct, frozen=True, gc=False):
    """The belief at one tick, predicted to the tick's own time.

    Attributes
    ----------
    sequence : int
        Counts ticks from the start of the loop; a gap means that values were dropped on the way, never
        reordered.
    time : float
        Unix time of validity, seconds.
    monotonic_ns : int
        The same on the host's monotonic clock, nanoseconds.
    health, reason : HealthState, str
        What the belief is worth, and why.
    level : int
        Degradation of this tick: 0 full, 1 fewer particles than demanded, 2 measurements thinned, 3
        extraction beyond the Gaussian skipped, 4 the shadow Kalman filter speaks, 5 prediction only.
    position, velocity : Triple
        North, east, down; m and m/s. ``null`` where unknown (all of it while ``waiting``). Of several hypotheses the
        leading one's, never a mean between them; ``hypotheses`` has them all.
    heading : float or None
        Radians clockwise from true north, in (-pi, pi].
    position_covariance, velocity_covariance : Triangle
        Upper triangle nn, ne, nd, ee, ed, dd; m² and (m/s)². Honest for the whole belief: the mean square of its
        differences from ``position``, other hypotheses included.
    heading_variance : float or None
        rad²; circular, so at most (pi²)/3 for a heading that could be any.
    latitude, longitude, altitude : float or None
        WGS 84 degrees and metres above mean sea level; ``null`` without an origin.
    radius95 : float or None
        Radius of the circle about ``position`` that holds the truth with 95 %, metres, horizontal: 95 % of the
        whole belief, other hypotheses included.
    hypotheses : int
        How many distinct places the belief holds; 0 while ``waiting``. Each has a weight of its own in the value of
        ``hypotheses``.
    particles, demanded, afforded : int
        In use (none at level 4); needed by the belief's spread (KLD bound); affordable inside the budget.
    effective_sample_size : float or None
        Equation 4.36's inverse: 1 / sum of squared weights; none at level 4.
    reset_counter : int
        Steps once when the position jumps for another reason than motion: the belief began anew elsewhere, or another
        hypothesis leads.
    biases : dict[str, tuple[float, float]]
        Slow states: name to value and sigma.
    level_reason : str
        What this tick gave up, and for what; empty at level 0.
    mode : MotionMode or None
        How the vehicle moves; ``null`` where that is not estimated.
    """

    sequence: int
    time: float
    monotonic_ns: int
    health: HealthState
    reason: str
    level: int
    position: Triple
    velocity: Triple
    heading: float | None
    position_covariance: Triangle
    velocity_covariance: Triangle
    heading_variance: float | None
    latitude: float | None
    longitude: float | None
    altitude: float | None
    radius95: float | None
    hypotheses: int
    particles: int
    demanded: int
    afforded: int
    effective_sample_size: float | None
    reset_counter: int
    biases: dict[str, tuple[float, float]]
    level_reason: str = ""
    mode: MotionMode | None = None


class Hypothesis(msgspec.Struct, frozen=True, gc=False):
    """One of the distinct places that the belief holds, predicted to the same time as the estimate.

    Attributes
    ----------
    name : int
        Which one: the same hypothesis keeps its name, whatever its weight. A name is never given again.
    weight : float
        Its share of the belief, 0 to 1.
    position : Triple
        Its own mean: north, east, down; m.
    position_covariance : Triangle
        Its own, about its own mean: upper triangle nn, ne, nd, ee, ed, dd; m².
    heading, heading_variance : float or None
        Its own; radians, rad².
    """

    name: int
    weight: float
    position: Triple
    position_covariance: Triangle
    heading: float | None
    heading_variance: float | None


class Hypotheses(msgspec.Struct, frozen=True, gc=False):
    """The distinct places that the belief holds: modes of its density with a valley of little density between them.

    Attributes
    ----------
    time : float
        Of validity, Unix seconds.
    hypotheses : list[Hypothesis]
        One to eight: first the leader, whose position is that of the estimate, then by weight.
    elsewhere : float
        Share of the belief that belongs to none of them.
    """

    time: float
    hypotheses: list[Hypothesis]
    elsewhere: float = 0.0


class Health(msgspec.Struct, frozen=True, gc=False):
    """What the belief is worth: published when the state has changed or the position has jumped.

    Attributes
    ----------
    time : float
        Of the tick that found it, Unix seconds.
    state, reason : HealthState, str
        What it is now, and why.
    since : float
        When the state was entered, Unix seconds; a new reason does not change it.
    reset_counter : int
        How many jumps of the position so far, for other reasons than motion.
    """

    time: float
    state: HealthState
    reason: str
    since: float
    reset_counter: int


class StageCost(msgspec.Struct, frozen=True, gc=False):
    """Milliseconds that one stage took per tick, since the last value.

    Attributes
    ----------
    median, p99, worst : float
        Half of the ticks took no more than the median, 99 of 100 no more than ``p99``, none more than the
        worst.
    """

    median: float
    p99: float
    worst: float


class Distribution(msgspec.Struct, frozen=True, gc=False):
    """A time in every tick of the whole run, in bins of equal ratio, ten to the octave; milliseconds.

    Attributes
    ----------
    ticks : int
        How many values there are.
    median, p99, p999, p9999, worst : float
        Half of the values, 99 %, 99.9 % and 99.99 % are no more than this; the upper edge of a bin, so at most
        7 % too high. ``worst`` is exact.
    bins : list[tuple[float, int]]
        Upper edge and count of each bin that holds anything.
    """

    ticks: int
    median: float
    p99: float
    p999: float
    p9999: float
    worst: float
    bins: list[tuple[float, int]]


class Budget(msgspec.Struct, frozen=True, gc=False):
    """Once a second: what the loop spent and what it gave up.

    Attributes
    ----------
    time : float
        Unix seconds.
    budget_ms, rate : float
        What the configuration grants per tick, and ticks per second.
    stages : dict[str, StageCost]
        ``ingest``, ``motion``, ``sensing``, ``witnesses`` (trust, motion mode, hypotheses), ``resampling``, ``kalman``,
        ``search``, ``extraction``, ``publishing``, ``cloud``, ``other`` and ``tick`` (all of it).
    use : float
        Share of the budget used, median over the ticks.
    demanded, afforded, particles, level : int
        As in :class:`Estimate`, of the last tick.
    ticks, missed_ticks, overruns : int
        Since the start: ticks done, ticks that never ran because an earlier one was late, ticks over the
        budget.
    lateness : StageCost
        Milliseconds from the deadline of a tick to its start.
    queues : dict[str, int]
        Datagrams waiting on each link's queue at the last tick.
    drops : dict[str, int]
        Since the start: what was dropped, by what (``link autopilot``, ``publisher``, ``late``, ``future``
        …).
    rested_ticks : int
        Since the start: ticks left out on purpose, to pay for ticks far over the budget.
    cut_ticks : int
        Since the start: ticks whose weighing was ended because the rest of it would have overrun.
    levels : dict[str, int]
        Since the start: ticks at each level.
    level_reason : str
        As in :class:`Estimate`, of the last tick.
    run_lateness, run_duration : Distribution or None
        From deadline to start, and from start to end, of every tick since the start; wall time.
    page_faults : int
        Minor and major page faults of the loop's process over the last second; none once it has settled.
    """

    time: float
    budget_ms: float
    rate: float
    stages: dict[str, StageCost]
    use: float
    demanded: int
    afforded: int
    particles: int
    level: int
    ticks: int
    missed_ticks: int
    overruns: int
    lateness: StageCost
    queues: dict[str, int]
    drops: dict[str, int]
    rested_ticks: int = 0
    cut_ticks: int = 0
    levels: dict[str, int] = {}
    level_reason: str = ""
    run_lateness: Distribution | None = None
    run_duration: Distribution | None = None
    page_faults: int = 0


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


class Cloud(msgspec.Struct, frozen=True, gc=False):
    """The attachment of ``particles``.

    Attributes
    ----------
    count : int
        How many rows.
    time : float
        Of validity, Unix seconds.
    columns : tuple[str, str, str, str]
        What stands in each row, in this order.
    """

    count: int
    time: float
    columns: tuple[str, str, str, str] = ("north", "east", "heading", "weight")


class Component(msgspec.Struct, frozen=True, gc=False):
    """One Gaussian of a mixture.

    Attributes
    ----------
    weight : float
        They sum to one.
    mean : list[float]
        Of the density's columns.
    covariance : list[list[float]]
        Its own.
    """

    weight: float
    mean: list[float]
    covariance: list[list[float]]


class Cell(msgspec.Struct, frozen=True, gc=False):
    """A box and the probability in it.

    Attributes
    ----------
    north, east : tuple[float, float]
        From and to, m.
    mass : float
        Over its area, the density in it.
    """

    north: tuple[float, float]
    east: tuple[float, float]
    mass: float


class Density(msgspec.Struct, frozen=True, gc=False):
    """The answer to ``@rpc/density``: a density of the last cloud of particles.

    Attributes
    ----------
    extractor : str
        ``gaussian``, ``kmeans``, ``histogram``, ``tree`` or ``kernel``.
    time : float
        Of the cloud, Unix seconds.
    particles : int
        Of how many.
    columns : list[str]
        The density's dimensions: north, east and heading, or north and east.
    mean, covariance : list[float], list[list[float]]
        Of the density, in their order; m and rad.
    components : list[Component] or None
        Of ``kmeans``: the mixture.
    cells : list[Cell] or None
        Of ``histogram`` and ``tree`` all that hold anything; of ``kernel`` a grid, its density at their middles.
    bandwidth : list[float] or None
        Of ``kernel``: north and east, m.
    """

    extractor: str
    time: float
    particles: int
    columns: list[str]
    mean: list[float]
    covariance: list[list[float]]
    components: list[Component] | None = None
    cells: list[Cell] | None = None
    bandwidth: list[float] | None = None


def schema() -> dict[str, object]:
    """Return the JSON Schema of every value on the wire, by name (what ``@rpc/schema`` answers)."""
    values = (Estimate, Hypotheses, Budget, Sensors, Health, Status, Cloud, Density)
    schemas, components = msgspec.json.schema_components(values, ref_template="#/$defs/{name}")
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$defs": components,
        "values": {value.__name__: schema for value, schema in zip(values, schemas, strict=True)},
    }
