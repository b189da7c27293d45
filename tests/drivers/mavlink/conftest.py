"""A decoder fed with frames, as the link and the log feed it."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from drivers.mavlink.decode import Decoder
from drivers.mavlink.frames import Frame, FrameScanner
from drivers.mavlink.settings import MavlinkSettings
from drivers.sample import Sample
from tests.drivers.mavlink.wire import heartbeat

SECOND = 1_000_000_000


class Ear:
    """Frames in, samples out; the autopilot (ArduPilot, 1/1) has already said that it is there."""

    def __init__(self, settings: MavlinkSettings) -> None:
        self.decoder = Decoder("autopilot", settings)
        self.now = 100 * SECOND
        self.hear(heartbeat())

    def hear(self, *frames: bytes, at: int | None = None) -> list[Sample]:
        """Decode frames that arrived at ``at`` ns, or 10 ms after the last ones."""
        self.now = self.now + 10_000_000 if at is None else at
        samples: list[Sample] = []

        def take(frame: Frame) -> None:
            if frame.identifier in self.decoder.wanted:
                samples.extend(self.decoder.decode(frame.message(), self.now))

        FrameScanner().feed(b"".join(frames), take)
        return samples

    @property
    def refused(self) -> dict[str, int]:
        return dict(self.decoder.malformed)

    @property
    def passed_over(self) -> dict[str, int]:
        return dict(self.decoder.unusable)


@pytest.fixture
def listen() -> Callable[..., Ear]:
    """Make an ear from settings other than the url."""

    def make(**settings: object) -> Ear:
        return Ear(MavlinkSettings(url="", **settings))  # type: ignore[arg-type]

    return make


@pytest.fixture
def ear(listen: Callable[..., Ear]) -> Ear:
    return listen()
