"""The real supervisor over stand-in children: ``daemon.py <specification.json> <statuses descriptor>``.

The specification is a list of objects: name, manner (see ``child.py``), and what else a Program has. ``UNREAD``
in the environment shortens the supervisor's patience with a publisher that does not read.
"""

from __future__ import annotations

import json
import os
import socket
import sys
from pathlib import Path

from service import supervisor
from service.channels import Outlet, Pair, pair
from service.child import Program
from service.config import ConfigurationError
from service.journal import write_log
from service.notify import Notifier
from service.supervisor import Supervisor

CHILD = Path(__file__).with_name("child.py")


class Plan:
    publisher = "publisher"

    def __init__(self, path: Path, statuses: socket.socket) -> None:
        self.path = path
        statuses.setblocking(False)
        self.statuses = Outlet(statuses)
        self.hearts: dict[str, Pair] = {}
        self.reload()

    def reload(self) -> None:
        try:
            self.specification = json.loads(self.path.read_text())
        except json.JSONDecodeError as error:
            raise ConfigurationError([f"{self.path.name}: {error}", "and a second error"]) from error

    def call(self) -> None:
        pass

    def programs(self) -> list[Program]:
        return [self._program(**dict(item)) for item in self.specification]

    def _program(self, name: str, manner: str, **facts: object) -> Program:
        if name not in self.hearts:
            self.hearts[name] = pair(16 * 1024)
        heart = self.hearts[name]
        outlet = heart.outlet.fileno()
        interpreter = "/nonexistent/python" if manner == "absent" else sys.executable
        command = (interpreter, str(CHILD), manner, str(outlet), str(os.getpid()))
        listened = None if facts.pop("heartless", False) else heart.inlet
        return Program(name, command, (outlet,), manner, listened, **facts)  # type: ignore[arg-type]


if __name__ == "__main__":
    write_log()
    supervisor.UNREAD = float(os.environ.get("UNREAD", supervisor.UNREAD))
    plan = Plan(Path(sys.argv[1]), socket.socket(fileno=int(sys.argv[2])))
    sys.exit(Supervisor(plan, Notifier()).run())
