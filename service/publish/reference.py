"""The reference page of the wire surface, made from what is declared: docs/wire.md.

``python -m service.publish.reference > docs/wire.md``; a test fails when the page is out of date.
"""

from __future__ import annotations

import inspect
import itertools
import re
import sys
from collections.abc import Iterator
from typing import cast

import msgspec
from msgspec import inspect as types

from service.estimate import (
    Budget,
    Cell,
    Cloud,
    Component,
    Density,
    Distribution,
    Estimate,
    Health,
    Hypotheses,
    Hypothesis,
    LinkStatus,
    ProcessStatus,
    Publishing,
    Sensors,
    SensorStatus,
    StageCost,
    Status,
)
from service.publish.session import LOOPBACK
from service.publish.topics import (
    CLOUD_BYTES,
    HISTORY,
    LIVE,
    PARTICLES,
    PREFIX,
    QUERIES,
    REQUESTS,
    TOPICS,
    Topic,
)

VALUES = (
    Estimate,
    Hypotheses,
    Hypothesis,
    Health,
    Budget,
    StageCost,
    Distribution,
    Sensors,
    SensorStatus,
    LinkStatus,
    Status,
    ProcessStatus,
    Publishing,
    Cloud,
    Density,
    Component,
    Cell,
)

ANSWERS = {
    "@rpc/latest": "the last `Estimate`",
    "@rpc/status": "`Status`: the last of everything, the processes, and what the publisher dropped",
    "@rpc/config": "the configuration in force, with all defaults",
    "@rpc/density": "with `?extractor=` one of `gaussian`, `kmeans`, `histogram`, `tree` or `kernel`: "
    "a `Density` of the last particle cloud; it takes a second or two",
    "@rpc/reinitialize": "begins anew: the payload is JSON as `[start]` has it, "
    '`{"position": [n, e, d], "heading": radians}` or `{"mode": "global"}`; refused with a reason when wrong, '
    'else `{"accepted": true}`, and `reset_counter` steps',
    "@rpc/schema": 'JSON Schema of every value: `{"$defs": …, "values": {"Estimate": …}}`',
}

_HEAD = f"""\
# The wire: what beliefd says on Zenoh

Everything stands under `{PREFIX}/<vehicle>/` (`publish.prefix` and `vehicle.name` of the configuration).
SI units, radians, WGS 84 degrees; north, east, down. **A figure that is not known is `null`, never a zero
or a NaN.** Fields may be added; a change of meaning changes the version in the prefix.

This page is made from the program: `python -m service.publish.reference > docs/wire.md`.

## Where to connect

Without a file of its own (`publish.zenoh`) the daemon is a Zenoh peer that listens on `{LOOPBACK}`, on this
computer only: no router, no multicast scouting, no shared memory. A second daemon on the same computer
finds the port taken and connects to the first; a client that connects there sees both, and when the first
goes, the second takes the port over within about two seconds. For other computers, TLS, user names or
access control, name a Zenoh JSON5 file: it is taken as it is (time stamps are switched on unless it says
otherwise; the history of `health` needs them).

## Published
"""

_QOS = f"""
No publisher ever blocks: congestion control is DROP, express is off, and what Zenoh cannot send is lost.
A gap in `sequence` tells. When the publishing process is behind, the newest value of each topic goes out
and the rest is counted (`@rpc/status`, `publishing.superseded`). The encoding names the value:
`application/json;beliefd.Estimate`.

`health` is sent on change only. It has a cache of {HISTORY} for late joiners: an *advanced* subscriber
with history gets the changes from before it came (below).

`particles` is binary: rows of four little-endian `float32`, north, east, heading and weight, at most
{CLOUD_BYTES // 1024} KB. The attachment is JSON (`Cloud`): how many rows, when, and the names of the columns.

## Asked for

| key | answers |
|---|---|
"""

_ASKING = f"""
Answers are JSON. One that cannot be given is a Zenoh error reply, `{{"reason": "…"}}`. Chunks that begin
with `@` are *verbatim* in Zenoh: `**` never matches them, so no wildcard asks by accident.

`{LIVE}` is a liveliness token: it stands while the daemon's session does.

## From Python

`pip install eclipse-zenoh` is all that is needed; any other Zenoh client reads the same bytes.
"""

_EXAMPLES = """
Particles with numpy:

```python
import numpy as np

particles = session.declare_subscriber("beliefd/v1/mower/particles")
for sample in particles:
    cloud = np.frombuffer(sample.payload.to_bytes(), "<f4").reshape(-1, 4)
    facts = json.loads(sample.attachment.to_bytes())  # count, time, columns
    north, east, heading, weight = cloud.T
```

Who is there, and a question:

```python
for reply in session.liveliness().get("beliefd/v1/*/@live"):
    print(reply.ok.key_expr)
for reply in session.get("beliefd/v1/mower/@rpc/status"):
    print(json.loads((reply.ok or reply.err).payload.to_bytes()))
```

Health, with what happened before:

```python
import zenoh.ext

history = zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=50)
changes = zenoh.ext.declare_advanced_subscriber(session, "beliefd/v1/mower/health", history=history)
for sample in changes:
    print(json.loads(sample.payload.to_bytes()))
```

Keep the subscriber in a variable: one that nothing refers to is undeclared at once. And do not leave its
channel undrained: the default one holds 256 samples and then stalls everything that arrives in that session.
`zenoh.handlers.RingChannel(n)` keeps the newest instead.

## The values
"""


_FOREIGN = f"""
## Samples of others

A link of kind `zenoh` takes what anyone puts under `{PREFIX}/<vehicle>/sample/<sensor>` (a UWB node, a DVL): one JSON
object with the reading's `kind` and fields, **SI units and radians, latitude and longitude too**, and optionally
`time`, Unix seconds; without it the time of arrival counts.

```json
{{"kind": "range", "beacon": 5, "distance": 12.3, "sigma": 0.3, "time": 1700000010.25}}
{{"kind": "local_position", "north": 3.2, "east": -1.0, "sigma_horizontal": 0.2}}
{{"kind": "geodetic_position", "latitude": 0.7058, "longitude": -1.3951, "sigma_horizontal": 1.5}}
{{"kind": "velocity", "north": 1.2, "east": -0.4, "sigma": 0.05}}
{{"kind": "heading", "heading": 1.57, "sigma": 0.05}}
{{"kind": "speed", "speed": 1.1}}
```

`drivers/sample.py` has every kind, `drivers/foreign.py` what is refused. A field too many, a wrong type or a value
that cannot be true refuses the sample; the count stands in `sensors`, `links`, `malformed`, under `sample/<sensor>`.
A `time` more than a second ahead or a minute behind is refused too: the sender's clock is not set.
"""

SUBSCRIBER = """\
import json

import zenoh

client = '{mode: "client", connect: {endpoints: ["tcp/127.0.0.1:7447"]}}'
session = zenoh.open(zenoh.Config.from_json5(client))
subscriber = session.declare_subscriber("beliefd/v1/*/estimate/slow")
for sample in subscriber:
    estimate = json.loads(sample.payload.to_bytes())
    print(estimate["health"], estimate["position"], estimate["radius95"])
"""
"""The smallest useful client; examples/subscribe.py is the same."""


def page() -> str:
    """Return the whole page."""
    return "".join(_parts()).rstrip() + "\n"


def _parts() -> Iterator[str]:
    yield _HEAD
    yield "\n| key | value | rate | priority | encoding |\n|---|---|---|---|---|\n"
    for topic in TOPICS:
        row = (
            f"`{topic.key}`",
            _carried(topic),
            topic.rate,
            str(topic.priority).removeprefix("Priority."),
            f"`{topic.encoding}`",
        )
        yield f"| {' | '.join(row)} |\n"
    yield _QOS
    for key in (*QUERIES, *REQUESTS):
        yield f"| `{key}` | {ANSWERS[key]} |\n"
    yield _ASKING
    yield f"\n```python\n{SUBSCRIBER}```\n"
    yield _EXAMPLES
    yield _FOREIGN
    for value in VALUES:
        yield from _value(value)


def _carried(topic: Topic) -> str:
    return f"rows of float32; attachment `{topic.value}`" if topic is PARTICLES else f"`{topic.value}`"


def _value(value: type[msgspec.Struct]) -> Iterator[str]:
    said = _attributes(value)
    summary = inspect.cleandoc(value.__doc__ or "").split("\n\n", 1)[0].replace("\n", " ")
    yield f"\n### {value.__name__}\n\n{_plain(summary)}\n\n| field | is | means |\n|---|---|---|\n"
    fields = cast("types.StructType", types.type_info(value)).fields
    for meaning, alike in itertools.groupby(fields, lambda field: said[field.name]):
        group = list(alike)
        names = ", ".join(f"`{field.encode_name}`" for field in group)
        kinds = ", ".join(dict.fromkeys(_type(field.type) for field in group))
        yield f"| {names} | {kinds} | {meaning} |\n"


def _attributes(value: type[msgspec.Struct]) -> dict[str, str]:
    """Return what the docstring's section of attributes says of each field."""
    _, _, section = inspect.cleandoc(value.__doc__ or "").partition("Attributes\n----------\n")
    said: dict[str, str] = {}
    names: list[str] = []
    for line in section.splitlines():
        if line.startswith(" "):
            for name in names:
                said[name] = f"{said.get(name, '')} {_plain(line.strip())}".strip()
        elif " : " in line:
            names = line.split(" : ")[0].split(", ")
    return said


def _plain(text: str) -> str:
    return re.sub(r":class:`(\w+)`", r"`\1`", text).replace("``", "`").replace("|", "∣")


def _type(kind: types.Type) -> str:
    """Return what a value is on the wire, in words."""
    if isinstance(kind, types.Metadata):
        return _type(kind.type)
    if isinstance(kind, types.UnionType):
        return " or ".join(_type(choice) for choice in kind.types)
    if isinstance(kind, types.TupleType):
        return f"[{', '.join(_type(item) for item in kind.item_types)}]" if _mixed(kind) else _repeated(kind)
    if isinstance(kind, types.ListType):
        return f"list of {_type(kind.item_type)}"
    if isinstance(kind, types.DictType):
        return f"object of {_type(kind.value_type)}"
    if isinstance(kind, types.StructType):
        return f"`{kind.cls.__name__}`"
    if isinstance(kind, types.EnumType):
        return ", ".join(f"`{member.value}`" for member in kind.cls)
    return _WORDS[type(kind)]


def _mixed(kind: types.TupleType) -> bool:
    return len({_type(item) for item in kind.item_types}) > 1


def _repeated(kind: types.TupleType) -> str:
    return f"list of {len(kind.item_types)}: {_type(kind.item_types[0])}"


_WORDS: dict[type[types.Type], str] = {
    types.FloatType: "number",
    types.IntType: "integer",
    types.StrType: "text",
    types.NoneType: "null",
    types.BoolType: "true or false",
}


if __name__ == "__main__":
    sys.stdout.write(page())
