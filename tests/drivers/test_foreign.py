"""The JSON of foreign samples: every kind of reading through it, and every kind of damage."""

from __future__ import annotations

import json

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.foreign import LARGEST_PAYLOAD, MalformedSample, decode, host_time
from drivers.plausibility import implausible
from drivers.sample import AnyReading, GeodeticPosition, Range
from tests.drivers.examples import KINDS, fields


def test_the_documented_example() -> None:
    text = b'{"kind": "range", "beacon": 5, "distance": 12.3, "sigma": 0.3, "time": 1700000010.25}'
    assert decode(text) == (Range(beacon=5, distance=12.3, sigma=0.3), 1700000010.25)


@pytest.mark.parametrize("stamp", ["", ', "time": null'])
def test_without_a_time(stamp: str) -> None:
    text = f'{{"latitude": 0.7, "longitude": -1.4, "altitude": null, "kind": "geodetic_position"{stamp}}}'
    assert decode(text.encode()) == (GeodeticPosition(latitude=0.7, longitude=-1.4), None)


@pytest.mark.parametrize(
    ("payload", "kind"),
    [
        (b"", "bad_json"),
        (b"hello", "bad_json"),
        (b'{"kind": "range", "beacon": 5, "distance": 1', "bad_json"),
        (b'{"kind": "range", "beacon": 5, "distance": NaN}', "bad_json"),
        (b'\xff\xfe{"kind": 1}', "bad_json"),
        (b'{"x":' * 600, "bad_json"),
        (b"[" * 4000, "invalid"),
        (b"[]", "invalid"),
        (b"null", "invalid"),
        (b"{}", "invalid"),
        (b'{"kind": "sonar", "distance": 1.0}', "invalid"),
        (b'{"kind": "range", "distance": 1.0}', "invalid"),
        (b'{"kind": "range", "beacon": 5.5, "distance": 1.0}', "invalid"),
        (b'{"kind": "range", "beacon": 5, "distance": "1.0"}', "invalid"),
        (b'{"kind": "range", "beacon": 5, "distance": true}', "invalid"),
        (b'{"kind": "range", "beacon": 5, "distance": null}', "invalid"),
        (b'{"kind": "range", "beacon": 5, "distance": 1.0, "colour": "red"}', "invalid"),
        (b'{"kind": "range", "beacon": 5, "distance": 1.0, "time": "now"}', "invalid"),
        (b'{"kind": "inertial", "angular_velocity": [1.0, 2.0]}', "invalid"),
        (b'{"kind": "range", "beacon": 5, "distance": -1.0}', "distance"),
        (b'{"kind": "range", "beacon": 5, "distance": 1.0, "sigma": 0.0}', "sigma"),
        (b'{"kind": "geodetic_position", "latitude": 40.44, "longitude": -1.4}', "latitude"),
        (b'{"kind": "geodetic_position", "latitude": 0.7, "longitude": -79.9}', "longitude"),
        (b'{"kind": "heading", "heading": 270.0}', "heading"),
        (b'{"kind": "speed", "speed": 1.0}' + b" " * LARGEST_PAYLOAD, "oversize"),
    ],
)
def test_what_is_refused_and_why(payload: bytes, kind: str) -> None:
    with pytest.raises(MalformedSample) as refusal:
        decode(payload)
    assert str(refusal.value) == kind


@pytest.mark.parametrize("digits", [20, 400])
@pytest.mark.parametrize(
    ("text", "field"),
    [
        ('{"kind": "odometer", "distance": [1.0], "epoch": %s}', "epoch"),
        (
            '{"kind": "presence", "type": 10, "autopilot": 3, "armed": true, "system_status": %s}',
            "system_status",
        ),
        ('{"kind": "range", "beacon": %s, "distance": 1.0}', "beacon"),
    ],
)
def test_an_integer_that_no_datagram_can_carry_is_refused(text: str, field: str, digits: int) -> None:
    with pytest.raises(MalformedSample) as refusal:
        decode((text % ("1" * digits)).encode())
    assert str(refusal.value) == field


def test_a_number_too_large_for_a_float() -> None:
    with pytest.raises(MalformedSample):
        decode(b'{"kind": "speed", "speed": 1e999}')


NUMBERS = st.floats(-1e7, 1e7) | st.integers(-1000, 1000) | st.integers(-(2**70), 2**70) | st.none()
VALUES = NUMBERS | st.lists(NUMBERS, max_size=4) | st.booleans() | st.text(max_size=3)
FIELDS = sorted({name for kind in KINDS for name in kind.__struct_fields__} | {"time", "x"})
TAGS = sorted(str(kind.__struct_config__.tag) for kind in KINDS)


@given(
    st.one_of(st.binary(max_size=200), st.dictionaries(st.sampled_from(FIELDS), VALUES)),
    st.sampled_from(TAGS),
)
@settings(max_examples=500, deadline=None)
def test_any_payload_is_a_plausible_reading_or_a_counted_refusal(
    content: bytes | dict[str, object], kind: str
) -> None:
    payload = content if isinstance(content, bytes) else json.dumps({"kind": kind, **content}).encode()
    try:
        reading, _ = decode(payload)
    except MalformedSample as refusal:
        assert str(refusal) in {"bad_json", "invalid", *FIELDS}  # noqa: PT017  either outcome is right
    else:
        assert implausible(reading) is None


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_every_kind_of_reading_comes_through(kind: type[AnyReading]) -> None:
    reading = kind(**fields(kind))
    assert decode(msgspec.json.encode(reading)) == (reading, None)


NOW_NS, UNIX_NOW = 5_000_000_000_000, 1_700_000_000.0


@pytest.mark.parametrize(
    ("unix", "expected"),
    [
        (None, NOW_NS),
        (UNIX_NOW, NOW_NS),
        (UNIX_NOW - 0.25, NOW_NS - 250_000_000),
        (UNIX_NOW - 59.0, NOW_NS - 59_000_000_000),
        (UNIX_NOW + 0.5, NOW_NS),  # a clock a little ahead cannot have measured later than now
    ],
)
def test_a_foreign_time_on_the_hosts_clock(unix: float | None, expected: int) -> None:
    assert host_time(unix, UNIX_NOW, NOW_NS) == pytest.approx(expected, abs=1000)


@pytest.mark.parametrize("unix", [UNIX_NOW + 1.5, UNIX_NOW - 61.0, 0.0, -1e300, 1e300])
def test_a_foreign_clock_that_is_not_set(unix: float) -> None:
    with pytest.raises(MalformedSample, match="time"):
        host_time(unix, UNIX_NOW, NOW_NS)
