"""A plain Zenoh subscriber: ``subscriber.py <endpoint> <key expression>``. It knows nothing of beliefd.

Prints ``monotonic seconds, key, payload`` for each value, separated by tabs, until it is told to stop.
"""

import json
import sys
import time

import zenoh


def say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def main() -> None:
    configuration = zenoh.Config()
    configuration.insert_json5("mode", '"client"')
    configuration.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
    configuration.insert_json5("connect/timeout_ms", "20000")
    configuration.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(configuration) as session:
        values = session.declare_subscriber(sys.argv[2], zenoh.handlers.RingChannel(1000))
        say("subscribed")
        while True:
            value = values.try_recv()
            if value is None:
                time.sleep(0.002)
                continue
            if str(value.key_expr).endswith("/particles"):
                continue  # binary
            payload = value.payload.to_string()
            say(f"{time.monotonic()}\t{value.key_expr}\t{payload}")


if __name__ == "__main__":
    main()
