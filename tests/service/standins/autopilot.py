"""A plain pymavlink script: ``autopilot.py <host:port> <seconds>``. It knows MAVLink and nothing of beliefd.

A vehicle that drives north at 1 m/s, with two beacons. Prints the monotonic time of its first wheel message.
"""

import math
import os
import sys
import time

os.environ["MAVLINK20"] = "1"
os.environ["MAVLINK_DIALECT"] = "all"

from pymavlink import mavutil

RATE = 50
SPEED = 1.0
BEACONS = {0: (20.0, 10.0), 1: (-5.0, 20.0)}
UNKNOWN = 2**31 - 1


def main() -> None:
    address, seconds = sys.argv[1], float(sys.argv[2])
    port = mavutil.mavlink_connection(f"udpout:{address}", source_system=1, source_component=1)
    mav = port.mav
    mav.heartbeat_send(10, 3, 0, 0, 4)
    began = time.monotonic()
    for tick in range(round(seconds * RATE)):
        time.sleep(max(0.0, began + tick / RATE - time.monotonic()))
        stamp = int((tick / RATE + 100.0) * 1e6)
        north = SPEED * tick / RATE
        if tick % RATE == 0:
            mav.heartbeat_send(10, 3, 0, 0, 4)
        if tick == 0:
            sys.stdout.write(f"{time.monotonic()}\n")
            sys.stdout.flush()
        mav.wheel_distance_send(stamp, 2, [north, north] + [0.0] * 14)
        mav.highres_imu_send(stamp, 0, 0, -9.81, 0, 0, 0.0, 0.2, 0, 0.4, 1013.0, 0, 0, 20.0, 0b111111, 0)
        if tick % 5 == 0:
            for beacon, place in BEACONS.items():
                distance = round(1000 * math.dist((north, 0.0), place))
                mav.ranging_beacon_send(
                    stamp, 0, 0, beacon, distance, UNKNOWN, UNKNOWN, math.nan, 0, 0, 0, 0, 300, tick % 256, 0
                )


if __name__ == "__main__":
    main()
