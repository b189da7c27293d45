"""The checkpoint: what of a belief survives the process that held it.

The loop sends one a second to a process that writes it down (:mod:`service.keeper`); a loop that starts reads it. It
holds a fair sample of the particles, all columns of them, so whatever the belief was (ambiguous, or spread over a ring)
it is again. How old it is is told by the monotonic clock where it was written since the computer started, so that a
step of the wall clock does no harm, else by Unix time.
"""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from service.channels import Outlet
from service.config import Configuration
from service.keeper import path_of

PARTICLES = 1000
"""Particles that are kept: 24 kB."""

OLDEST = 60.0
"""Seconds after which a checkpoint says nothing any more: a vehicle may be anywhere by then."""

MAGIC = b"beliefd checkpoint 1\n"
_CHECK = 4
_BOOT = Path("/proc/sys/kernel/random/boot_id")
_BELIEF = {"vehicle", "origin", "start", "area", "sensor", "beacon", "map"}


class CheckpointError(Exception):
    """A file that holds no usable checkpoint; the text says which, and why."""


class Kept(NamedTuple):
    """What of a belief is kept.

    Attributes
    ----------
    time : int
        The belief's own, nanoseconds on the monotonic clock.
    names : tuple[str, ...]
        The dimensions.
    columns : (dimension, n) float32
        Equally likely particles.
    height : tuple[float, float] or None
        Down and its variance, where the particles do not have it.
    origin : tuple[float, float, float] or None
        Of the local frame: radians, metres above the sea.
    reset_counter : int
        As published last.
    health : str
        As published last.
    """

    time: int
    names: tuple[str, ...]
    columns: NDArray[np.float32]
    height: tuple[float, float] | None
    origin: tuple[float, float, float] | None
    reset_counter: int
    health: str


class _File(msgspec.Struct, array_like=True):
    fingerprint: str
    boot: str
    monotonic: int
    unix: int
    names: tuple[str, ...]
    columns: bytes
    height: tuple[float, float] | None
    origin: tuple[float, float, float] | None
    reset_counter: int
    health: str


_encoder = msgspec.msgpack.Encoder()
_decoder = msgspec.msgpack.Decoder(_File)


def fingerprint(configuration: Configuration) -> str:
    """Return what tells two configurations apart whose beliefs are not the same: another start is a new start."""
    return hashlib.sha256(configuration.model_dump_json(include=_BELIEF).encode()).hexdigest()[:16]


def boot() -> str:
    """Return what tells one start of the computer from another; empty where that is not known."""
    try:
        return _BOOT.read_text().strip()
    except OSError:
        return ""


class Writer:
    """Makes the bytes of checkpoints; whatever does not change is made once.

    Parameters
    ----------
    configuration : Configuration
        Of the belief.
    """

    def __init__(self, configuration: Configuration) -> None:
        self._fingerprint = fingerprint(configuration)
        self._boot = boot()

    def encode(self, kept: Kept, unix: int) -> bytes:
        """Return a checkpoint as it lies in the file; ``unix``: the belief's time on that clock, nanoseconds."""
        content = _encoder.encode(
            _File(
                self._fingerprint,
                self._boot,
                kept.time,
                unix,
                kept.names,
                np.ascontiguousarray(kept.columns, "<f4").tobytes(),
                kept.height,
                kept.origin,
                kept.reset_counter,
                kept.health,
            )
        )
        return MAGIC + zlib.crc32(content).to_bytes(_CHECK, "little") + content


class Checkpoints:
    """Sends the loop's checkpoints to the process that writes them.

    Parameters
    ----------
    configuration : Configuration
        Of the belief.
    outlet : Outlet
        Queue to that process.
    kept : callable
        What there is to keep, if anything.
    """

    def __init__(self, configuration: Configuration, outlet: Outlet, kept: Callable[[], Kept | None]) -> None:
        self._writer = Writer(configuration)
        self._outlet = outlet
        self._kept = kept

    def send(self, monotonic: int, unix: int) -> None:
        """Send one; the times are those of now."""
        kept = self._kept()
        if kept is not None:
            self._outlet.send(self._writer.encode(kept, unix - (monotonic - kept.time)))

    @property
    def dropped(self) -> int:
        """Checkpoints that the queue had no room for."""
        return self._outlet.dropped


def decode(data: bytes) -> _File:
    """Return what :meth:`Writer.encode` made.

    Raises
    ------
    CheckpointError
        The bytes are no checkpoint of this version, or damaged.
    """
    head = len(MAGIC) + _CHECK
    if not data.startswith(MAGIC):
        raise CheckpointError("is no checkpoint of this version")
    content = data[head:]
    if zlib.crc32(content) != int.from_bytes(data[len(MAGIC) : head], "little"):
        raise CheckpointError("is damaged")
    try:
        return _decoder.decode(content)
    except msgspec.MsgspecError as error:
        raise CheckpointError(f"is damaged: {error}") from error


def read(configuration: Configuration, monotonic: int, unix: int) -> Kept | None:
    """Return what was kept of the belief of ``configuration``, on the clock of now; ``None`` where nothing was.

    Parameters
    ----------
    monotonic, unix : int
        The time now on both clocks, nanoseconds.

    Raises
    ------
    CheckpointError
        There is a file that cannot be used; the text says why, and names it.
    """
    path = path_of(configuration)
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise CheckpointError(f"{path} cannot be read: {error.strerror}") from error
    try:
        return _kept(decode(data), configuration, monotonic, unix)
    except CheckpointError as error:
        raise CheckpointError(f"{path} {error}") from error


def as_it_was(configuration: Configuration, data: bytes) -> Kept:
    """Return what :meth:`Writer.encode` was given for the belief of ``configuration``, on the clock of then.

    Raises
    ------
    CheckpointError
        It cannot be used; the text says why.
    """
    file = decode(data)
    return _kept(file, configuration, file.monotonic, file.unix)


def _kept(file: _File, configuration: Configuration, monotonic: int, unix: int) -> Kept:
    if file.fingerprint != fingerprint(configuration):
        raise CheckpointError("is of another configuration")
    age = monotonic - file.monotonic if file.boot and file.boot == boot() else unix - file.unix
    if age < 0:
        raise CheckpointError(f"is from the future, by {-age * 1e-9:.0f} s")
    if age > OLDEST * 1e9:
        raise CheckpointError(f"is {age * 1e-9:.0f} s old, more than {OLDEST:.0f} s")
    columns = np.frombuffer(file.columns, "<f4")
    if (
        not file.names
        or columns.size == 0
        or columns.size % len(file.names)
        or not np.isfinite(columns).all()
    ):
        raise CheckpointError("is damaged: its particles are none")
    return Kept(
        monotonic - age,
        file.names,
        columns.reshape(len(file.names), -1),
        file.height,
        file.origin,
        file.reset_counter,
        file.health,
    )
