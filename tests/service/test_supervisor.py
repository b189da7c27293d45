"""The supervisor over real processes: kills, hangs, signals, and what systemd hears on a real socket."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest

from service.estimate import ProcessStatus

DAEMON = Path(__file__).parent / "standins" / "daemon.py"
ROOT = Path(__file__).parents[2]
PATIENCE = 20.0

LOOP = {"name": "loop", "manner": "beat", "vital": True, "patience": 1.0}
LINK = {"name": "link bus", "manner": "beat", "patience": 1.0}
PUBLISHER = {"name": "publisher", "manner": "beat", "heartless": True}


class Service:
    """The stand-in daemon as a process, with the sockets that it talks to."""

    def __init__(
        self, folder: Path, *programs: dict[str, Any], environment: dict[str, str] | None = None
    ) -> None:
        self.specification = folder / "plan.json"
        self.write(*programs)
        self.notify = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.notify.bind(str(folder / "notify"))
        self.notifications: queue.Queue[str] = queue.Queue()
        threading.Thread(target=self._read_notifications, daemon=True).start()
        self.statuses, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.statuses.settimeout(PATIENCE)
        self.log = folder / "log"
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                [sys.executable, str(DAEMON), str(self.specification), str(theirs.fileno())],
                pass_fds=(theirs.fileno(),),
                stderr=log,
                env=os.environ
                | {"NOTIFY_SOCKET": str(folder / "notify"), "PYTHONPATH": str(ROOT)}
                | (environment or {}),
            )
        self.outlet = theirs
        self.last: dict[str, ProcessStatus] = {}
        self.pids: set[int] = set()

    def _read_notifications(self) -> None:
        with contextlib.suppress(OSError):  # closed under it at the end
            while message := self.notify.recv(4096):
                self.notifications.put(message.decode())

    def write(self, *programs: dict[str, Any]) -> None:
        self.specification.write_text(json.dumps(programs))

    def hear(self, wanted: str) -> list[str]:
        """Wait for a notification that begins so; return all that came until then."""
        heard: list[str] = []
        while not heard or not heard[-1].startswith(wanted):
            try:
                heard.append(self.notifications.get(timeout=PATIENCE))
            except queue.Empty:
                pytest.fail(f"no {wanted}; heard {heard}; log:\n{self.log.read_text()}")
        return heard

    def wait(self, condition: Callable[[dict[str, ProcessStatus]], bool]) -> dict[str, ProcessStatus]:
        """Wait for a status that fulfils the condition."""
        until = time.monotonic() + PATIENCE
        while not self.last or not condition(self.last):
            assert time.monotonic() < until, f"{self.last}\n{self.log.read_text()}"
            datagram = self.statuses.recv(65536)
            if datagram[:1] != b"R":
                continue
            listed = msgspec.json.decode(datagram[1:], type=list[ProcessStatus])
            self.last = {status.name: status for status in listed}
            self.pids |= {status.pid for status in listed if status.pid}
        return self.last

    def fill(self) -> None:
        """Leave no room in the publisher's queue."""
        self.outlet.setblocking(False)
        for size in (4096, 1):
            with contextlib.suppress(BlockingIOError):
                while True:
                    self.outlet.send(bytes(size))

    def running(self, *names: str) -> dict[str, ProcessStatus]:
        return self.wait(lambda last: all(name in last and last[name].state == "running" for name in names))

    def end(self, number: signal.Signals = signal.SIGTERM) -> float:
        """Send a signal, wait for the end, and return how long it took."""
        began = time.monotonic()
        self.process.send_signal(number)
        self.process.wait(PATIENCE)
        return time.monotonic() - began

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait(PATIENCE)
        self.notify.shutdown(socket.SHUT_RDWR)
        self.notify.close()
        self.statuses.close()
        self.outlet.close()


Start = Callable[..., Service]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    services: list[Service] = []

    def _start(*programs: dict[str, Any], environment: dict[str, str] | None = None) -> Service:
        services.append(Service(tmp_path, *programs, environment=environment))
        return services[-1]

    yield _start
    for service in services:
        service.close()


def gone(pid: int) -> bool:
    """Say whether a process has ended (or waits for somebody else to reap it)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except OSError:
        return True


def wait_gone(pids: set[int]) -> None:
    until = time.monotonic() + PATIENCE
    while not all(gone(pid) for pid in pids):
        assert time.monotonic() < until, [pid for pid in pids if not gone(pid)]
        time.sleep(0.01)


def test_ready_comes_with_the_first_tick_and_the_watchdog_with_every_beat(start: Start) -> None:
    service = start(PUBLISHER, LOOP | {"manner": "slow"}, LINK)
    heard = service.hear("READY=1")
    assert "STATUS=compiling kernels, 1 of 2: motion" in heard
    assert not any(message.startswith("WATCHDOG=") for message in heard)
    service.hear("WATCHDOG=1")
    status = service.hear("STATUS=running: publisher, loop, link bus")
    assert "READY=1" not in status
    processes = service.running("publisher", "loop", "link bus")
    assert processes["supervisor"].pid == service.process.pid
    assert all((status.resident_bytes or 0) > 1_000_000 for status in processes.values())


def test_sigterm_ends_everything_within_two_seconds(start: Start) -> None:
    service = start(PUBLISHER, LOOP, LINK)
    service.running("publisher", "loop", "link bus")
    took = service.end()
    assert service.process.returncode == 0
    assert took < 2.0
    assert all(gone(pid) for pid in service.pids)
    assert "killed" not in service.log.read_text(), "asked to end, not forced"
    service.hear("STOPPING=1")


def test_a_child_that_will_not_end_is_killed_in_time(start: Start) -> None:
    service = start(PUBLISHER, LOOP, LINK | {"manner": "stubborn"})
    service.running("publisher", "loop", "link bus")
    took = service.end(signal.SIGINT)
    assert service.process.returncode == 0
    assert took < 2.0
    assert all(gone(pid) for pid in service.pids)
    assert "link bus: did not end within its time, killed" in service.log.read_text()


@pytest.mark.parametrize("name", ["loop", "link bus", "publisher"])
def test_a_killed_child_is_started_again_and_the_others_go_on(start: Start, name: str) -> None:
    service = start(PUBLISHER, LOOP, LINK)
    before = service.running("publisher", "loop", "link bus")
    victim = before[name].pid
    assert victim is not None
    os.kill(victim, signal.SIGKILL)
    after = service.wait(lambda last: last[name].restarts == 1 and last[name].state == "running")
    assert after[name].pid != victim
    assert after[name].reason == "killed by SIGKILL"
    others = set(before) - {name}
    assert {other: after[other].pid for other in others} == {other: before[other].pid for other in others}


@pytest.mark.parametrize("name", ["loop", "link bus"])
def test_a_hung_child_is_killed_and_started_again(start: Start, name: str) -> None:
    service = start(PUBLISHER, LOOP, LINK)
    victim = service.running("publisher", "loop", "link bus")[name].pid
    assert victim is not None
    os.kill(victim, signal.SIGSTOP)
    after = service.wait(lambda last: last[name].restarts == 1 and last[name].state == "running")
    assert after[name].reason == "hung: no sign of life for 1 s"
    assert gone(victim)


def test_one_that_never_beats_is_given_its_start_time_only(start: Start) -> None:
    service = start(PUBLISHER, LOOP, LINK | {"manner": "mute", "start_patience": 0.3})
    after = service.wait(lambda last: "link bus" in last and last["link bus"].restarts >= 1)
    assert after["link bus"].reason == "hung: no sign of life for 0.3 s"
    after = service.wait(lambda last: last["link bus"].restarts >= 2)
    assert after["link bus"].reason == "hung: no sign of life for 0.6 s", "a slow computer is given more time"


def test_the_watchdog_is_fed_only_while_ticks_arrive(start: Start) -> None:
    """A stopped loop: not one WATCHDOG=1 from its last beat until it beats again."""
    service = start(PUBLISHER, LOOP, LINK, environment={"WATCHDOG_USEC": "3000000"})
    victim = service.running("publisher", "loop", "link bus")["loop"].pid
    assert victim is not None
    service.hear("READY=1")
    os.kill(victim, signal.SIGSTOP)
    before = service.hear("WATCHDOG_USEC=")
    assert before[-1] == "WATCHDOG_USEC=3100000", "it waits through the back-off"
    assert before.count("WATCHDOG=1") <= 1 + 1.0 / 0.25, "none but what was on its way"
    starting = service.hear("WATCHDOG_USEC=")
    assert starting[-1] == "WATCHDOG_USEC=30000000", "while a new loop starts, systemd waits as long as we do"
    assert "WATCHDOG=1" not in starting
    between = service.hear("WATCHDOG_USEC=")
    assert between[-1] == "WATCHDOG_USEC=3000000"
    assert "WATCHDOG=1" not in between
    service.hear("WATCHDOG=1")


def test_a_loop_that_cannot_start_ends_the_service_with_one(start: Start) -> None:
    service = start(PUBLISHER, LOOP | {"manner": "die"}, LINK)
    service.process.wait(PATIENCE)
    assert service.process.returncode == 1
    log = service.log.read_text()
    assert "loop: 5 starts in a row failed (exit status 3): giving up" in log
    service.hear("STOPPING=1")


def test_a_loop_whose_program_is_not_there_is_named(start: Start) -> None:
    service = start(PUBLISHER, LOOP | {"manner": "absent"}, LINK)
    service.process.wait(PATIENCE)
    assert service.process.returncode == 1
    assert "loop: cannot be started: [Errno 2] No such file or directory: '/nonexistent/python'" in (
        service.log.read_text()
    )


def test_a_link_that_cannot_start_is_tried_for_ever(start: Start) -> None:
    service = start(PUBLISHER, LOOP, LINK | {"manner": "die"})
    service.running("loop")
    after = service.wait(lambda last: last["link bus"].restarts >= 6)
    assert after["loop"].restarts == 0


def test_children_die_with_the_supervisor(start: Start) -> None:
    service = start(PUBLISHER, LOOP | {"manner": "beat"}, LINK | {"manner": "stubborn"})
    service.running("publisher", "loop", "link bus")
    service.end(signal.SIGKILL)
    wait_gone(service.pids)


def test_sighup_with_a_good_configuration_renews_what_changed(start: Start) -> None:
    second = {"name": "link second", "manner": "beat"}
    service = start(PUBLISHER, LOOP, LINK, second)
    before = service.running("publisher", "loop", "link bus", "link second")
    third = {"name": "link third", "manner": "beat"}
    service.write(PUBLISHER, LOOP, LINK | {"manner": "slow"}, third)
    service.process.send_signal(signal.SIGHUP)
    service.hear("RELOADING=1\nMONOTONIC_USEC=")
    service.hear("READY=1")
    after = service.wait(
        lambda last: (
            "link third" in last
            and "link second" not in last
            and last["link third"].state == "running"
            and last["link bus"].state == "running"
            and last["link bus"].pid != before["link bus"].pid
        )
    )
    assert after["loop"].pid == before["loop"].pid
    assert after["publisher"].pid == before["publisher"].pid
    assert after["link bus"].restarts == 0
    assert gone(before["link second"].pid or 0)


def test_sighup_that_renews_the_loop_is_ready_again_with_its_first_tick(start: Start) -> None:
    service = start(PUBLISHER, LOOP, LINK)
    before = service.running("publisher", "loop", "link bus")
    service.write(PUBLISHER, LOOP | {"manner": "slow"}, LINK)
    service.process.send_signal(signal.SIGHUP)
    service.hear("RELOADING=1")
    assert "STATUS=compiling kernels, 1 of 2: motion" in service.hear("READY=1")
    service.wait(lambda last: last["loop"].state == "running" and last["loop"].pid != before["loop"].pid)


def test_sighup_with_a_bad_configuration_keeps_the_old_one_and_says_why(start: Start) -> None:
    service = start(PUBLISHER, LOOP, LINK)
    before = service.running("publisher", "loop", "link bus")
    service.hear("STATUS=running")
    service.specification.write_text("[nonsense")
    service.process.send_signal(signal.SIGHUP)
    service.hear("RELOADING=1")
    heard = service.hear("STATUS=kept the old configuration: plan.json:")
    assert "READY=1" in heard
    after = service.wait(lambda last: bool(last["supervisor"].reason))
    assert {name: status.pid for name, status in after.items()} == {
        name: status.pid for name, status in before.items()
    }
    assert "plan.json" in after["supervisor"].reason
    log = service.log.read_text()
    assert "plan.json:" in log
    assert "and a second error" in log
    service.write(PUBLISHER, LOOP, LINK)
    service.process.send_signal(signal.SIGHUP)
    service.hear("STATUS=running: publisher, loop, link bus")


def test_a_sighup_before_the_first_tick_does_not_make_it_ready(start: Start) -> None:
    """A wrong configuration while the loop still starts is refused, and systemd goes on waiting."""
    service = start(PUBLISHER, LOOP | {"manner": "mute"}, LINK)
    service.running("publisher", "link bus")
    service.specification.write_text("[nonsense")
    service.process.send_signal(signal.SIGHUP)
    assert "READY=1" not in service.hear("STATUS=kept the old configuration: plan.json:")


def test_a_sighup_while_it_stops_changes_nothing(start: Start) -> None:
    service = start(PUBLISHER, LOOP, LINK | {"manner": "stubborn"})
    service.running("publisher", "loop", "link bus")
    service.process.send_signal(signal.SIGTERM)
    service.hear("STOPPING=1")
    service.process.send_signal(signal.SIGHUP)
    service.process.wait(PATIENCE)
    assert service.process.returncode == 0
    assert "SIGHUP" not in service.log.read_text()


def test_a_link_that_is_taken_out_while_it_waits_is_forgotten(start: Start) -> None:
    """It has no process whose end could be awaited."""
    service = start(PUBLISHER, LOOP, LINK | {"manner": "die"})
    service.wait(lambda last: "link bus" in last and last["link bus"].restarts >= 4)  # 0.8 s to wait
    service.write(PUBLISHER, LOOP)
    service.process.send_signal(signal.SIGHUP)
    after = service.wait(lambda last: "link bus" not in last)
    assert set(after) == {"supervisor", "publisher", "loop"}


def test_systemd_is_more_patient_than_the_supervisor(start: Start) -> None:
    service = start(PUBLISHER, LOOP | {"patience": 4.0}, LINK, environment={"WATCHDOG_USEC": "3000000"})
    assert service.hear("WATCHDOG_USEC=6")[-1] == "WATCHDOG_USEC=6000000", "once the loop beats"


def test_systemd_waits_through_the_back_off_of_the_loop(start: Start) -> None:
    """It grows to 5 s, beyond the watchdog: that must not end the service."""
    service = start(PUBLISHER, LOOP | {"manner": "die"}, LINK, environment={"WATCHDOG_USEC": "1000000"})
    service.process.wait(PATIENCE)
    heard = [message for message in service.hear("STOPPING=1") if message.startswith("WATCHDOG_USEC=")]
    granted = [int(message.partition("=")[2]) for message in heard]
    assert granted[::2] == [30_000_000] * 5, "while it starts"
    waits = [0.1, 0.2, 0.4, 0.8, 1.6]
    assert granted[1::2] == [round((1.0 + wait) * 1e6) for wait in waits], "while it waits"


def test_a_publisher_that_does_not_read_is_started_again(start: Start) -> None:
    """Its queue stays full: after a while that is a hang."""
    service = start(PUBLISHER | {"start_patience": 0.1}, LOOP, LINK, environment={"UNREAD": "1"})
    victim = service.running("publisher", "loop", "link bus")["publisher"].pid
    service.fill()
    heard = service.hear("STATUS=running: loop, link bus; publisher")
    assert "publisher waiting (hung: has not read for 1 s)" in heard[-1]
    after = service.wait(
        lambda last: last["publisher"].restarts >= 1 and last["publisher"].state == "running"
    )
    assert after["publisher"].pid != victim


@pytest.mark.parametrize("full", ["before it starts", "while it starts"])
def test_a_publisher_is_given_time_to_start_before_its_queue_counts(start: Start, full: str) -> None:
    """The loop goes on filling the queue while a new publisher starts, which may take longer than a hang."""
    service = start(PUBLISHER | {"start_patience": 4.0}, LOOP, LINK, environment={"UNREAD": "1"})
    victim = service.running("publisher", "loop", "link bus")["publisher"].pid
    assert victim is not None
    service.hear("STATUS=running: publisher, loop, link bus")
    if full == "before it starts":
        service.fill()
    os.kill(victim, signal.SIGKILL)
    killed = time.monotonic()
    service.hear("STATUS=running: publisher, loop, link bus")
    service.fill()
    heard = service.hear("STATUS=running: loop, link bus; publisher waiting (hung: has not read for 1 s)")
    assert time.monotonic() - killed > 4.0, heard
