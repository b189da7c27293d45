"""What the loop says to the recording process: everything that a belief is made of, and the belief.

Datagrams of a tag and a content, in the order in which things happened: what the loop began with, and then for every
tick the samples as they were taken, orders, the estimate as it went out, and what was decided. The loop copies what it
holds anyway: the datagrams of the links, of the publisher, and its own; nothing is encoded twice, and nothing is
allocated for it. What the queue has no room for is lost to the recording alone, and counted.
"""

from __future__ import annotations

import time
from typing import Any

import msgspec

from service.channels import ESTIMATE, Outlet
from service.checkpoint import Kept, Writer
from service.config import Configuration

BEGUN = b"N"
TAKEN = b"L"
ORDER = b"O"
DECIDED = b"D"

RUN_TOPIC, ESTIMATE_TOPIC, DECISION_TOPIC, ORDER_TOPIC = "run", "estimate", "decision", "order"
"""What a recording calls them, beside ``sample/LINK/SOURCE``."""

LARGEST = 256 * 1024
"""Bytes of the largest datagram that the recording process makes room for."""


class Begun(msgspec.Struct, frozen=True):
    """What a loop began with.

    Attributes
    ----------
    version : str
        Of beliefd.
    shift : int
        Nanoseconds by which the recording's clock is ahead of the loop's monotonic one: to Unix time at the beginning.
        Nobody sets it afterwards, whatever happens to the wall clock.
    links : list[str]
        Names of the links, in the order of the configuration.
    configuration : dict
        All of it, with the defaults.
    checkpoint : bytes
        What the belief went on from, as it lies in the file of checkpoints; empty where it began as ``[start]`` says.
    """

    version: str
    shift: int
    links: list[str]
    configuration: dict[str, Any]
    checkpoint: bytes = b""


def begun(configuration: Configuration, kept: Kept | None) -> Begun:
    """Return what a loop of ``configuration`` begins with now; ``kept``: what its belief goes on from."""
    from importlib.metadata import version

    shift = time.time_ns() - time.monotonic_ns()
    return Begun(
        version("beliefd"),
        shift,
        [link.name for link in configuration.link],
        configuration.model_dump(mode="json"),
        b"" if kept is None else Writer(configuration).encode(kept, kept.time + shift),
    )


def tell(records: Outlet, beginning: Begun) -> bool:
    """Send what a loop begins with; False when there was no room."""
    return records.send(BEGUN + msgspec.json.encode(beginning))


class Doubled(Outlet):
    """The publisher's queue, of which every estimate also goes to the recording process.

    Parameters
    ----------
    outlet : Outlet
        Queue to the publisher.
    records : Outlet
        Queue to the recording process.
    """

    def __init__(self, outlet: Outlet, records: Outlet) -> None:
        super().__init__(outlet.end)
        self._records = records

    def send(self, datagram: bytes | bytearray | memoryview) -> bool:
        """Send one datagram to the publisher, and an estimate to both; tell whether the publisher's was taken."""
        if datagram[0] == ESTIMATE[0]:
            self._records.send(datagram)
        return super().send(datagram)
