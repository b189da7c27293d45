"""pymavlink's tables against the documents, and both of its checksums against the one typed in here."""

from __future__ import annotations

import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.mavlink import dialect
from tests.drivers.mavlink import wire


@pytest.mark.parametrize("name", wire.LAYOUTS)
def test_the_dialect_is_the_one_of_the_documents(name: str) -> None:
    identifier, extra, layout = wire.LAYOUTS[name]
    known = dialect.LAYOUTS[dialect.IDENTIFIERS[name]]
    assert (known.identifier, known.name, known.seed) == (identifier, name, bytes((extra,)))
    assert len(known.unpack(b"")) > 0
    assert known._unpacker.size == wire.struct.calcsize(layout)


def test_it_is_mavlink_2_whatever_the_environment_said() -> None:
    assert os.environ["MAVLINK20"] == "1"
    assert dialect.mavlink.WIRE_PROTOCOL_VERSION == "2.0"
    assert dialect.mavlink.DIALECT == "all"


@given(st.binary(max_size=280))
def test_the_checksum(data: bytes) -> None:
    assert dialect.checksum(data) == wire.crc(data)


def test_the_checksum_without_the_compiled_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dialect.mavlink, "mcrf4xx", None)
    monkeypatch.setattr(dialect.mavlink, "x25crc", dialect.mavlink._x25crc_slow)
    data = wire.heartbeat()
    assert dialect._checksum_of()(data) == wire.crc(data)
