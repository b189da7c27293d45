"""Run inside a network namespace by test_multicast: one link and one sender on the loopback's multicast.

The argument is the interface of the link. Prints one JSON object.
"""

from __future__ import annotations

import binascii
import json
import multiprocessing
import os
import signal
import socket
import struct
import sys
import time
from pathlib import Path

import can

from drivers.can import CanFrame, CanLink, CanSettings
from drivers.link import LinkError
from drivers.sample import Sample
from tests.drivers.can.encoding import fix, frames

MULTICAST_PORT = 57732


def send_as_simulator(some: list[CanFrame], sender: socket.socket) -> None:
    """ArduPilot SITL's framing by hand: magic, CRC of the rest, flags, identifier, data."""
    for frame in some:
        body = struct.pack("<HI", 0, frame.identifier | 1 << 31) + frame.data
        header = struct.pack("<HH", 0x2934, binascii.crc_hqx(body, 0xFFFF))
        sender.sendto(header + body, ("239.65.82.0", MULTICAST_PORT))


def send_as_python_can(some: list[CanFrame], bus: can.BusABC) -> None:
    for frame in some:
        bus.send(can.Message(arbitration_id=frame.identifier, data=frame.data, is_extended_id=True))


def receive(interface: str) -> list[Sample]:
    """Send fixes until the link has heard one: the receiver joins its group in its own time."""
    channel = "0" if interface == "mcast" else "239.74.163.2"
    link = CanLink("bus", CanSettings(interface=interface, channel=channel))
    sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    samples: list[Sample] = []
    with can.Bus("239.74.163.2", "udp_multicast", ignore_config=True) as bus:
        link.open()
        until = time.monotonic() + 20.0
        number = 0
        while len(samples) < 4 and time.monotonic() < until:
            if interface == "mcast":
                sender.sendto(b"noise", ("239.65.82.0", MULTICAST_PORT))
                send_as_simulator(frames(fix(), number=number % 32), sender)
            else:
                send_as_python_can(frames(fix(), number=number % 32), bus)
            number += 1
            samples += link.poll(0.1)
        link.close()
    sender.close()
    return samples


def lose_the_receiver() -> str:
    """Kill the receiving process of an open link; return what the link says."""
    link = CanLink("bus", CanSettings(interface="mcast", channel="0"))
    link.open()
    (child,) = multiprocessing.active_children()
    os.kill(child.pid or 0, signal.SIGKILL)
    try:
        for _ in range(100):
            link.poll(0.1)
    except LinkError as error:
        return str(error)
    finally:
        link.close()
    return "nothing"


def orphan_the_receiver() -> bool:
    """Open a link in a process that is then killed; tell whether its receiving process ends with it."""
    ours, theirs = os.pipe()
    parent = os.fork()
    if parent == 0:
        link = CanLink("bus", CanSettings(interface="mcast", channel="0"))
        link.open()
        (child,) = multiprocessing.active_children()
        os.write(theirs, str(child.pid).encode())
        time.sleep(60)
    child_pid = int(os.read(ours, 20))
    until = time.monotonic() + 10.0
    while f":{MULTICAST_PORT:04X} " not in Path("/proc/net/udp").read_text() and time.monotonic() < until:
        time.sleep(0.01)  # the child is at work once its port is bound
    os.kill(parent, signal.SIGKILL)
    os.waitpid(parent, 0)
    until = time.monotonic() + 10.0
    while time.monotonic() < until:
        if not running(child_pid):
            return True
        time.sleep(0.02)
    return False


def running(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def main(interface: str) -> None:
    samples = receive(interface)
    result: dict[str, object] = {
        "kinds": sorted({type(s.reading).__name__ for s in samples}),
        "children": len(multiprocessing.active_children()),
    }
    if interface == "mcast":
        result["lost"] = lose_the_receiver()
        result["orphan_ended"] = orphan_the_receiver()
    print(json.dumps(result))  # noqa: T201


if __name__ == "__main__":
    main(sys.argv[1])
