"""Run by test_socketcan in a network namespace with a vcan0 of its own: a link on the kernel's CAN sockets.

Prints one JSON object.
"""

from __future__ import annotations

import json
import subprocess
import time

import can

from drivers.can import CanFrame, CanLink, CanSettings
from drivers.link import LinkError
from drivers.sample import Sample
from tests.drivers.can.encoding import fix, frames, message

CHANNEL = "vcan0"


def send(bus: can.BusABC, some: list[CanFrame]) -> None:
    for frame in some:
        sent = can.Message(arbitration_id=frame.identifier, data=frame.data, is_extended_id=frame.extended)
        bus.send(sent, timeout=1.0)


def collect(link: CanLink, count: int) -> list[Sample]:
    samples: list[Sample] = []
    until = time.monotonic() + 20.0
    while len(samples) < count and time.monotonic() < until:
        samples += link.poll(0.1)
    return samples


def complaint(link: CanLink, *, opening: bool) -> str:
    """What the link says when it is opened, or polled until it breaks."""
    try:
        if opening:
            link.open()
            return "nothing"
        for _ in range(50):
            link.poll(0.1)
    except LinkError as error:
        return str(error)
    return "nothing"


def ip(*arguments: str) -> None:
    subprocess.run(["ip", "link", *arguments], check=True)


def main() -> None:
    link = CanLink("bus", CanSettings(channel=CHANNEL))
    with can.Bus(CHANNEL, "socketcan", ignore_config=True) as bus:
        link.open()
        unwanted = [CanFrame(0x123, b"12345678", False), CanFrame(0x1001552A, b"1234567\xc0")]
        send(bus, unwanted)
        send(bus, frames(fix()))
        samples = collect(link, 2)
        ignored = link.report().ignored
        send(bus, frames(message("air_data.StaticPressure", static_pressure=9e4)))
        sent = time.monotonic_ns()
        time.sleep(0.2)  # the frame waits in the socket, and must not be dated by its reading
        (waited,) = collect(link, 1)
    ip("set", CHANNEL, "down")
    down = complaint(link, opening=False)
    again = CanLink("bus", CanSettings(channel=CHANNEL))
    still_down = complaint(again, opening=True)
    ip("set", CHANNEL, "up")
    again.open()
    ip("delete", CHANNEL)
    gone = complaint(again, opening=False)
    again.close()
    absent = complaint(again, opening=True)
    link.close()
    result = {
        "kinds": [type(s.reading).__name__ for s in samples],
        "ignored": ignored,
        "off_by_ms": abs(waited.time - sent) / 1e6,
        "down": down,
        "still_down": still_down,
        "gone": gone,
        "absent": absent,
    }
    print(json.dumps(result))  # noqa: T201


if __name__ == "__main__":
    main()
