"""The live link: bytes from a port to samples, and what an onboard computer owes its autopilot."""

from __future__ import annotations

import time
from collections import Counter

from drivers.link import LinkError
from drivers.mavlink.address import open_port
from drivers.mavlink.decode import Decoder
from drivers.mavlink.dialect import IDENTIFIERS, Message
from drivers.mavlink.frames import Frame, FrameScanner
from drivers.mavlink.port import Port
from drivers.mavlink.requests import SET_MESSAGE_INTERVAL, MessageRequests
from drivers.mavlink.sequence import Sequences
from drivers.mavlink.settings import MavlinkSettings
from drivers.mavlink.signing import SignatureCheck, read_key
from drivers.mavlink.speaker import Speaker
from drivers.mavlink.timesync import TimeSync, TimeSynchroniser
from drivers.sample import SECOND, LinkReport, Sample

HEARTBEAT_PERIOD = SECOND
SILENT_AFTER = 3 * SECOND
DUTY_PERIOD = SECOND // 20  # how often at most the questions are looked through
UNKNOWN_VEHICLE = 1

TIMESYNC = IDENTIFIERS["TIMESYNC"]
COMMAND_ACK = IDENTIFIERS["COMMAND_ACK"]


class MavlinkLink:
    """One MAVLink port; see :class:`drivers.link.Link`.

    Parameters
    ----------
    name : str
        As in the configuration.
    settings : MavlinkSettings
        Where it is, whom to believe, what to ask for.

    Raises
    ------
    ValueError
        The settings name a message that does not exist, or a rate that is none.
    """

    def __init__(self, name: str, settings: MavlinkSettings) -> None:
        self._name = name
        self._settings = settings
        self._requests = MessageRequests(settings.rates)
        self._decoder = Decoder(name, settings)
        self._handled = self._decoder.wanted | {TIMESYNC, COMMAND_ACK}
        self._scanner = FrameScanner()
        self._sequences = Sequences()
        self._timesync = TimeSynchroniser()
        self._port: Port | None = None
        self._speaker: Speaker | None = None
        self._check: SignatureCheck | None = None
        self._refused: Counter[str] = Counter()
        self._ignored = 0
        self._opened = 0
        self._arrived = 0
        self._heard = 0
        self._heartbeat_due = 0
        self._duty_due = 0
        self._boots = 0
        self._samples: list[Sample] = []
        self._received = 0

    @property
    def port(self) -> Port | None:
        """The open port, ``None`` while it is closed."""
        return self._port

    def open(self) -> None:
        """Open the port and say hello.

        Raises
        ------
        LinkError
            The port is taken, the device absent, the address wrong, the key file unreadable.
        """
        self.close()
        key = read_key(self._settings.signing_key_file) if self._settings.signing_key_file else None
        self._check = None if key is None else SignatureCheck(key)
        self._port = open_port(self._settings.url)
        self._speaker = Speaker(self._decoder.vehicle or UNKNOWN_VEHICLE, self._settings.own_component, key)
        self._scanner.forget()
        self._sequences.forget()
        self._requests.restart()
        self._opened += 1
        self._arrived = self._heard = self._heartbeat_due = self._duty_due = 0
        self._do_duties(time.monotonic_ns())

    def close(self) -> None:
        """Close the port; harmless when it is closed."""
        if self._port is not None:
            self._port.close()
        self._port = None

    def poll(self, timeout: float) -> list[Sample]:
        """Wait at most ``timeout`` seconds for bytes; return the samples understood, in order of arrival.

        Raises
        ------
        LinkError
            The port has gone, or was not opened.
        """
        port = self._port
        if port is None:
            raise LinkError(f"{self._name}: is not open; open it before polling")
        self._do_duties(time.monotonic_ns())
        if not port.wait(min(timeout, self._until_duty(time.monotonic_ns()) / SECOND)):
            return []
        self._samples = []
        self._received = time.monotonic_ns()
        for piece in port.read():
            self._arrived = self._received
            self._scanner.feed(piece, self._take, self._sequences.passed)
        return self._samples

    def report(self) -> LinkReport:
        """Return the totals so far, and the state."""
        decoder = self._decoder
        clocks = decoder.main_clocks
        state, reason = self._state(time.monotonic_ns())
        return LinkReport(
            self._name,
            state,
            reason,
            messages=decoder.messages,
            samples=decoder.samples,
            malformed=dict(self._scanner.faults + self._refused + decoder.malformed),
            unusable=dict(decoder.unusable),
            ignored=self._ignored + decoder.ignored.total(),
            lost=self._sequences.lost,
            opened=self._opened,
            clock=clocks.boot.method if clocks else "",
            offset=clocks.boot.offset if clocks else None,
            jitter=clocks.boot.jitter if clocks else None,
        )

    def _state(self, now: int) -> tuple[str, str]:
        if self._port is None:
            return "opening", ""
        if now - self._heard <= SILENT_AFTER:
            return "up", ""
        if now - self._arrived <= SILENT_AFTER:
            wanted = "understood" if self._check is None else "signed with the key"
            return "silent", f"{self._settings.url}: bytes arrive, but no message that is {wanted}"
        return "silent", f"{self._settings.url}: nothing arrives"

    def _take(self, frame: Frame) -> None:
        """Handle one frame that the scanner found."""
        speaker = self._speaker
        if speaker is None or (frame.system, frame.component) == (speaker.system, speaker.component):
            self._ignored += 1  # our own, sent back by a router
            return
        fault = None if self._check is None else self._check.fault(frame)
        if fault is not None:
            self._refused[fault] += 1
            return
        self._heard = self._received
        if self._decoder.is_of_vehicle(frame.system, frame.component):
            self._sequences.heard(frame, self._received)
        if frame.identifier not in self._handled:
            self._ignored += 1
            return
        message = frame.message()
        if frame.identifier == TIMESYNC:
            self._synchronise(message)
        elif frame.identifier == COMMAND_ACK:
            self._acknowledged(message)
        else:
            self._samples += self._decoder.decode(message, self._received)
            if message.system == self._decoder.vehicle:
                self._requests.heard(frame.identifier, self._received)

    def _synchronise(self, message: Message) -> None:
        """Answer a request, whoever asks; believe an answer only from the autopilot."""
        heard = TimeSync(message.fields.tc1, message.fields.ts1)
        address = (message.system, message.component)
        if heard.asks and self._speaker is not None:
            self._send(self._speaker.timesync(heard.answer(time.monotonic_ns())))
        elif address == self._decoder.autopilot_address:
            self._timesync.answered_by(heard, self._received, self._decoder.clocks(*address))
        else:
            self._ignored += 1

    def _acknowledged(self, message: Message) -> None:
        fields, speaker = message.fields, self._speaker
        ours = speaker is None or fields.target_component in (0, speaker.component)
        from_autopilot = (message.system, message.component) == self._decoder.autopilot_address
        if fields.command == SET_MESSAGE_INTERVAL and ours and from_autopilot:
            self._requests.acknowledged(fields.result)
        else:
            self._ignored += 1

    def _until_duty(self, now: int) -> int:
        return max(0, min(self._heartbeat_due, self._duty_due) - now)

    def _do_duties(self, now: int) -> None:
        """Send what is due: the heartbeat, and to a known autopilot questions and time synchronisation."""
        speaker = self._speaker
        if speaker is None:
            return
        if now >= self._heartbeat_due:
            self._heartbeat_due = now + HEARTBEAT_PERIOD
            self._send(speaker.heartbeat())
        autopilot = self._decoder.autopilot_address
        if now < self._duty_due:
            return
        self._duty_due = now + DUTY_PERIOD
        if autopilot is None or now - self._heard > SILENT_AFTER:
            return
        speaker.system = autopilot[0]
        clocks = self._decoder.clocks(*autopilot)
        if clocks.boot.epoch != self._boots:
            self._boots = clocks.boot.epoch
            self._requests.restart()
        question = self._requests.due(now)
        if question is not None:
            self._send(speaker.request(autopilot, question))
        synchronisation = self._timesync.request(time.monotonic_ns(), clocks)
        if synchronisation is not None:
            self._send(speaker.timesync(synchronisation))

    def _send(self, data: bytes) -> None:
        if self._port is not None and not self._port.write(data):
            self._refused["unsent"] += 1
