"""The compiled readers against the dronecan package's own packing and unpacking."""

from __future__ import annotations

import math
import struct
from typing import Any

import dronecan
import pytest
from dronecan.transport import ArrayValue, CompoundValue, PrimitiveValue, bits_from_bytes, bytes_from_bits
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.can.dsdl import DataType, MalformedPayload
from drivers.can.readings import DATA_TYPES

TYPES = list(DATA_TYPES.values())


def plain(value: Any) -> Any:
    """A value of the dronecan package as plain Python."""
    if isinstance(value, CompoundValue):
        fields = {n: f for n, f in value._fields.items() if not n.startswith("_void")}
        return {name: plain(field) for name, field in fields.items()}
    if isinstance(value, ArrayValue):
        return [plain(item) for item in value]
    if isinstance(value, PrimitiveValue):
        return value.value
    return value


def same(a: Any, b: Any) -> bool:
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    if isinstance(a, list):
        return len(a) == len(b) and all(map(same, a, b))
    return a == b or (math.isnan(a) and math.isnan(b))


def oracle(data_type: DataType, payload: bytes, tail_array_optimised: bool) -> Any:
    message = dronecan.TYPENAMES[f"uavcan.equipment.{data_type.name}"]()
    message._unpack(bits_from_bytes(payload), tail_array_optimised)
    return plain(message)


@pytest.mark.parametrize("data_type", TYPES, ids=lambda t: t.name)
@given(data=st.data(), tail=st.booleans())
@settings(max_examples=60, deadline=None)
def test_any_bytes_read_as_the_dronecan_package_reads_them(
    data_type: DataType, data: st.DataObject, tail: bool
) -> None:
    payload = data.draw(st.binary(max_size=data_type.largest + 2))
    try:
        expected = oracle(data_type, payload, tail)
    except (ValueError, IndexError):
        with pytest.raises(MalformedPayload):
            data_type.unpack(payload, tail_array_optimised=tail)
        return
    try:
        message = data_type.unpack(payload, tail_array_optimised=tail)
    except MalformedPayload as error:
        assert str(error) == "oversize_array"  # noqa: PT017  the package does not mind an array too long
        return
    assert same(message, expected)


@pytest.mark.parametrize("tail", [True, False])
@pytest.mark.parametrize("data_type", TYPES, ids=lambda t: t.name)
def test_what_the_dronecan_package_packs_comes_back(data_type: DataType, tail: bool) -> None:
    message = dronecan.TYPENAMES[f"uavcan.equipment.{data_type.name}"]()
    fill(message, iter(range(1, 1000)))
    payload = bytes(bytes_from_bits(message._pack(tail)))
    assert same(data_type.unpack(payload, tail_array_optimised=tail), plain(message))


def fill(message: Any, numbers: Any) -> None:
    """Give every field a value of its own, and every array some items."""
    for name, field in message._fields.items():
        if isinstance(field, PrimitiveValue):
            setattr(message, name, next(numbers) % 2 if field._type.bitlen == 1 else next(numbers) % 8)
        elif isinstance(field, CompoundValue):
            fill(field, numbers)
        elif isinstance(field, ArrayValue):
            for index in range(field._type.max_size if len(field) else min(6, field._type.max_size)):
                item = field.new_item()
                if isinstance(item, CompoundValue):
                    fill(item, numbers)
                    field.insert(index, item)
                elif index < len(field):
                    field[index] = next(numbers) % 8
                else:
                    field.append(next(numbers) % 8)


def test_a_field_that_straddles_bytes_by_hand() -> None:
    """esc.Status: 32 bits of errors, three half floats, then 18 bits of rpm = 0x12345 & 0x1FFFF."""
    rpm = 0x12345
    straddling = (
        f"{rpm & 0xFF:08b}{rpm >> 8 & 0xFF:08b}{rpm >> 16 & 3:02b}" + f"{100:07b}" + f"{5:05b}" + "00"
    )
    payload = struct.pack("<Ieee", 7, 12.5, -1.5, 300.0) + int(straddling, 2).to_bytes(4, "big")
    status = next(t for t in TYPES if t.name == "esc.Status").unpack(payload)
    assert status == {
        "error_count": 7,
        "voltage": 12.5,
        "current": -1.5,
        "temperature": 300.0,
        "rpm": rpm,
        "power_rating_pct": 100,
        "esc_index": 5,
    }


def test_an_array_longer_than_its_type_is_refused() -> None:
    raw_command = next(t for t in TYPES if t.name == "esc.RawCommand")
    # five bits of count: 31 of at most 20
    with pytest.raises(MalformedPayload, match="oversize_array"):
        raw_command.unpack(b"\xff" * 60)
    array_command = next(t for t in TYPES if t.name == "actuator.ArrayCommand")
    with pytest.raises(MalformedPayload, match="oversize_array"):
        array_command.unpack(b"\x00" * 4 * 16)
