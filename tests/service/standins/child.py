"""A small real child for the supervisor's tests: ``child.py <manner> <heart descriptor>``."""

from __future__ import annotations

import signal
import socket
import sys
import time

from service.channels import Heart
from service.realtime import die_with_parent

PERIOD = 0.02


def main() -> None:
    manner, descriptor, parent = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    die_with_parent(parent)
    heart = Heart(socket.socket(fileno=descriptor))
    if manner == "die":
        sys.exit(3)
    if manner == "stubborn":
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
    if manner == "mute":
        time.sleep(60)
    if manner == "slow":
        heart.announce("compiling kernels, 1 of 2: motion")
        time.sleep(0.3)
    while True:
        heart.beat()
        time.sleep(PERIOD)


if __name__ == "__main__":
    main()
