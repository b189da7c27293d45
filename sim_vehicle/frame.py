"""A frame on a CAN bus."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CanFrame:
    """One classic CAN frame: identifier (29 bits when ``extended``), up to 8 bytes."""

    identifier: int
    data: bytes
    extended: bool = True
