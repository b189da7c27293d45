"""Samples that others publish on Zenoh: a UWB node, a DVL, a simulation, in any language that writes JSON.

Published under ``<prefix>/<vehicle>/sample/<sensor>``, where ``<sensor>`` is one chunk that names the sender;
the payload is the JSON object that :mod:`drivers.foreign` describes, for example::

    {"kind": "range", "beacon": 5, "distance": 12.3, "sigma": 0.3, "time": 1700000010.25}

What is wrong is counted as ``sample/<sensor>.<kind of damage>``. Whoever lags behind loses the oldest
samples, never the newest: they wait in a ring, which is polled.
"""

from __future__ import annotations

import json
import re
import threading
import time
from collections import Counter
from pathlib import Path
from typing import Any, cast

import msgspec
import zenoh

from drivers.foreign import MalformedSample, decode, host_time
from drivers.link import LinkError
from drivers.sample import SECOND, LinkReport, Sample

MOST_SENSORS = 64
LONGEST_NAME = 64

_STEP = 0.002
_MOST_PER_POLL = 512
_SILENT_NS = SECOND
_CLOSING = 1.0


class ZenohSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where to listen.

    Attributes
    ----------
    root : str
        What the vehicle's keys begin with: ``beliefd/v1/mower``.
    configuration : str
        A Zenoh JSON5 configuration file, the same that the publishing process may use; empty: a client of
        ``endpoint``. From a file that makes a peer or router the link becomes a client of what that listens
        on.
    endpoint : str
        Where the publishing process, or whoever else, listens.
    ring : int
        How many samples may wait.
    """

    root: str
    configuration: str = ""
    endpoint: str = "tcp/127.0.0.1:7447"
    ring: int = 1024


def _client(endpoints: list[str], configuration: zenoh.Config) -> zenoh.Config:
    configuration.insert_json5("mode", '"client"')
    configuration.insert_json5("listen/endpoints", "[]")
    configuration.insert_json5("connect/endpoints", json.dumps(endpoints))
    return configuration


def _embedded(endpoint: str) -> zenoh.Config:
    configuration = zenoh.Config()
    configuration.insert_json5("scouting/multicast/enabled", "false")
    configuration.insert_json5("transport/shared_memory/enabled", "false")
    return _client([endpoint], configuration)


def _endpoints(configuration: zenoh.Config, side: str) -> list[str]:
    """Return the endpoints of ``listen`` or ``connect``, which a file may give for each mode apart."""
    given: Any = json.loads(configuration.get_json(f"{side}/endpoints"))
    if isinstance(given, dict):
        by_mode = cast("dict[str, list[str] | None]", given)
        given = by_mode.get(json.loads(configuration.get_json("mode")) or "peer")
    return cast("list[str]", given or [])


def _from_file(path: str) -> zenoh.Config:
    configuration = zenoh.Config.from_file(path)
    if json.loads(configuration.get_json("mode")) == "client":
        return configuration
    # The publishing process holds the listening end; two processes cannot.
    return _client(_endpoints(configuration, "listen") or _endpoints(configuration, "connect"), configuration)


class ZenohLink:
    """Foreign samples for one vehicle; implements :class:`drivers.link.Link`.

    Parameters
    ----------
    name : str
        As in the configuration.
    settings : ZenohSettings
        Where to listen.
    """

    def __init__(self, name: str, settings: ZenohSettings) -> None:
        self._name = name
        self._settings = settings
        self._key = f"{settings.root}/sample/*"
        self._session: zenoh.Session | None = None
        self._subscriber: zenoh.Subscriber[zenoh.handlers.Handler[zenoh.Sample]] | None = None
        self._sensors: set[str] = set()
        self._refused: Counter[str] = Counter()
        self._samples = 0
        self._ignored = 0
        self._opened = 0
        self._heard_ns = 0

    @property
    def place(self) -> str:
        """The other end in words, for messages."""
        return self._settings.configuration or self._settings.endpoint

    def open(self) -> None:
        """Connect and subscribe.

        Raises
        ------
        LinkError
            Nobody listens there, or the configuration file is wrong.
        """
        self.close()
        settings = self._settings
        if settings.configuration and not Path(settings.configuration).is_file():
            raise LinkError(
                f"{self._name}: {settings.configuration} is not a file; "
                "it should be a Zenoh JSON5 configuration, or empty"
            )
        try:
            configuration = (
                _from_file(settings.configuration) if settings.configuration else _embedded(settings.endpoint)
            )
            self._session = zenoh.open(configuration)
            self._subscriber = self._session.declare_subscriber(
                self._key, zenoh.handlers.RingChannel(settings.ring)
            )
        except zenoh.ZError as error:
            self.close()
            raise LinkError(
                f"{self._name}: no Zenoh session by {self.place}: {_plain(error)}; "
                "someone should listen there, as the publishing process does"
            ) from error
        self._opened += 1
        self._heard_ns = time.monotonic_ns()

    def poll(self, timeout: float) -> list[Sample]:
        """Wait at most ``timeout`` seconds for samples; return all that wait.

        Raises
        ------
        LinkError
            The link is not open, or its session has been closed.
        """
        subscriber = self._subscriber
        if subscriber is None or self._session is None or self._session.is_closed():
            raise LinkError(f"{self._name}: no Zenoh session by {self.place} is open; open it first")
        until = time.monotonic() + timeout
        try:
            while (arrived := subscriber.try_recv()) is None and time.monotonic() < until:
                time.sleep(min(_STEP, timeout))
            return self._drain(subscriber, arrived)
        except zenoh.ZError as error:
            raise LinkError(f"{self._name}: Zenoh by {self.place} broke: {_plain(error)}") from error

    def _drain(
        self, subscriber: zenoh.Subscriber[zenoh.handlers.Handler[zenoh.Sample]], arrived: zenoh.Sample | None
    ) -> list[Sample]:
        samples: list[Sample] = []
        handled = 0
        while arrived is not None:
            sample = self._understand(arrived)
            if sample is not None:
                samples.append(sample)
            handled += 1
            arrived = subscriber.try_recv() if handled < _MOST_PER_POLL else None
        self._samples += len(samples)
        return samples

    def _understand(self, arrived: zenoh.Sample) -> Sample | None:
        self._heard_ns = now_ns = time.monotonic_ns()
        if arrived.kind != zenoh.SampleKind.PUT:
            self._ignored += 1
            return None
        sensor = str(arrived.key_expr).rpartition("/")[2]
        if not self._known(sensor):
            return None
        source = f"sample/{sensor}"
        try:
            reading, unix = decode(arrived.payload.to_bytes())
            measured_ns = host_time(unix, time.time(), now_ns)
        except MalformedSample as error:
            self._refused[f"{source}.{error}"] += 1
            return None
        return Sample(time=measured_ns, received=now_ns, link=self._name, source=source, reading=reading)

    def _known(self, sensor: str) -> bool:
        """Keep the number of names bounded, which come from outside and are counted under."""
        if sensor in self._sensors:
            return True
        if len(sensor) > LONGEST_NAME:
            self._refused["long_name"] += 1
            return False
        if len(self._sensors) == MOST_SENSORS:
            self._refused["too_many_sensors"] += 1
            return False
        self._sensors.add(sensor)
        return True

    def report(self) -> LinkReport:
        """Return the totals since the link was made, and its state."""
        state, reason = self._state()
        return LinkReport(
            link=self._name,
            state=state,
            reason=reason,
            messages=self._samples,
            samples=self._samples,
            malformed=dict(self._refused),
            ignored=self._ignored,
            opened=self._opened,
            clock="unix",
        )

    def _state(self) -> tuple[str, str]:
        if self._session is None:
            return "opening", ""
        if self._session.is_closed() or not self._session.info.links():
            return "retrying", f"the connection by {self.place} is lost; Zenoh tries to renew it"
        if time.monotonic_ns() - self._heard_ns > _SILENT_NS:
            return "silent", f"connected, but nobody has published {self._key} for more than a second"
        return "up", ""

    def close(self) -> None:
        """Close the session; harmless when it is closed.

        Waits a second at most: a stalled peer can hold the session for ten. The rest then goes on in a daemon
        thread, and is counted as ``close.late``.
        """
        session, self._session = self._session, None
        self._subscriber = None
        if session is None:
            return
        closed = threading.Event()

        def close() -> None:
            try:
                session.close()
            except zenoh.ZError:
                return  # it says that a peer was stalled; counted below as late
            closed.set()

        threading.Thread(target=close, name="zenoh close", daemon=True).start()
        if not closed.wait(_CLOSING):
            self._refused["close.late"] += 1


def _plain(error: zenoh.ZError) -> str:
    """Return the text of an error without the places in Zenoh's own sources."""
    return re.sub(r"\s*at /\S+\.rs:\d+\.?", "", str(error)).strip()
