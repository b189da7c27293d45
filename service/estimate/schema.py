"""The JSON Schema of every value on the wire."""

from __future__ import annotations

import msgspec

from service.estimate.belief import Estimate
from service.estimate.budget import Budget
from service.estimate.density import Cloud, Density
from service.estimate.health import Health
from service.estimate.hypotheses import Hypotheses
from service.estimate.sensors import Sensors
from service.estimate.status import Status


def schema() -> dict[str, object]:
    """Return the JSON Schema of every value on the wire, by name (what ``@rpc/schema`` answers)."""
    values = (Estimate, Hypotheses, Budget, Sensors, Health, Status, Cloud, Density)
    schemas, components = msgspec.json.schema_components(values, ref_template="#/$defs/{name}")
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$defs": components,
        "values": {value.__name__: schema for value, schema in zip(values, schemas, strict=True)},
    }
