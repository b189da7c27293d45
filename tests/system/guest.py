"""The daemon as a user installs it: run as root in the guest by run.sh, on a real vcan0 and real systemd.

The vehicle is ``python -m sim_vehicle``, which speaks DroneCAN on vcan0 and MAVLink over UDP. Satellite fixes
come by the bus alone, and the configuration starts from the first fix, so that a first position proves that
frames on vcan0 have come through.
"""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from checks import (
    PATIENCE,
    SERVICE,
    CheckError,
    Estimates,
    Tally,
    expect,
    journal,
    must,
    processes,
    run,
    status_of,
    unit,
    until,
)

BELIEFD = "/opt/venv/bin/beliefd"
PYTHON = "/opt/venv/bin/python"
MAVLINK = "udpout:127.0.0.1:14550"
BUS = "socketcan:vcan0"
PRIORITY = 20
FOLDER = Path("/root/vehicle")
ROBOT = FOLDER / "robot.toml"
ROBOT_INSTALLED = Path("/etc/beliefd/beliefd.toml")
TRUTH = FOLDER / "truth.csv"
ROLES = {"supervisor", "loop", "publisher", "keeper", "link autopilot", "link bus"}
NO_WRITE_EXECUTE = "import numba; print(numba.njit('i8(i8)')(lambda x: x + 1)(1))"


def prepare_bus() -> None:
    must("modprobe", "vcan")
    must("ip", "link", "add", "vcan0", "type", "vcan")
    must("ip", "link", "set", "vcan0", "up")
    expect("UP" in must("ip", "-br", "link", "show", "vcan0"), "vcan0 is not up")


def install_wheel() -> None:
    (wheel,) = Path().glob("beliefd-*.whl")
    must(
        PYTHON,
        "-m",
        "pip",
        "install",
        "-q",
        "--no-deps",
        "--no-index",
        str(wheel),
    )


def write_configuration() -> None:
    """Take the simulator's own configuration for these links, but start from the first fix, in real time."""
    FOLDER.mkdir()
    must(
        PYTHON, "-m", "sim_vehicle", "demo", "--realtime", "--seconds", "0.1",
        "--mavlink", MAVLINK, "--can", BUS, "--config", str(ROBOT),
    )  # fmt: skip
    tables = re.split(r"\n(?=\[)", ROBOT.read_text())
    tables = ['[start]\nmode = "first_fix"\n' if table.startswith("[start]") else table for table in tables]
    # a tick that does nothing costs 25 ms here
    loop = f"[loop]\nrate = 5.0\npriority = {PRIORITY}\n[budget]\ncpu_ms = 100.0\nparticles_max = 5_000\n"
    ROBOT.write_text("\n".join([*tables, loop]))


class Vehicle:
    """The simulated vehicle, driving. Started anew it drives the same way again, with satellites for 20 s."""

    def __init__(self) -> None:
        self.start()

    def start(self) -> None:
        self._process = subprocess.Popen(
            [
                PYTHON, "-m", "sim_vehicle", "demo", "--realtime", "--seconds", "600",
                "--mavlink", MAVLINK, "--can", BUS, "--truth", str(TRUTH),
            ],
            stdout=subprocess.DEVNULL,
        )  # fmt: skip

    def position(self, unix: float) -> tuple[float, float]:
        """Return where the vehicle truly was."""
        rows = [line.split(",") for line in TRUTH.read_text().splitlines()[1:]]
        nearest = min((row for row in rows if len(row) == 5), key=lambda row: abs(float(row[0]) - unix))
        return float(nearest[1]), float(nearest[2])

    def stop(self) -> None:
        self._process.terminate()
        self._process.wait(PATIENCE)

    def again(self) -> None:
        self.stop()
        self.start()


def error_of(estimate: dict[str, Any], vehicle: Vehicle) -> float:
    north, east = vehicle.position(estimate["time"])
    return math.hypot(estimate["position"][0] - north, estimate["position"][1] - east)


def replaced(name: str, before: dict[str, int]) -> int:
    """Wait until a process of the service has another number than before; return it."""

    def another() -> int | None:
        number = processes().get(name)
        return None if number == before[name] else number

    return until(another, f"another {name}")


def installation(tally: Tally) -> None:
    with tally.check("vcan0 is up"):
        prepare_bus()
    with tally.check("the wheel installs"):
        install_wheel()
    with tally.check("the simulator writes a configuration for vcan0"):
        write_configuration()
    with tally.check("a wrong configuration is refused with exit 2, and nothing is installed"):
        wrong = FOLDER / "wrong.toml"
        wrong.write_text(ROBOT.read_text().replace('kind = "can"', 'kind = "cam"'))
        done = run(BELIEFD, "service", "install", str(wrong))
        expect(done.returncode == 2 and 'did you mean "can"?' in done.stderr, done)
        expect(not Path("/etc/systemd/system", SERVICE).exists(), "there is a unit")
    with tally.check("beliefd service install: it becomes ready") as facts:
        facts.extend(must(BELIEFD, "service", "install", str(ROBOT), timeout=480).splitlines()[-1:])
        expect(
            (unit("ActiveState"), unit("SubState"), unit("Type")) == ("active", "running", "notify"),
            unit("Result"),
        )
        expect(until(lambda: set(processes()) == ROLES, "all processes"), processes())


def confinement(tally: Tally) -> None:
    with tally.check("it runs as its own user, without a capability, under seccomp") as facts:
        for name, pid in processes().items():
            found = status_of(pid)
            expect(found["Uid"].split()[0] != "0", f"{name} is root")
            expect(int(found["CapEff"], 16) == int(found["CapBnd"], 16) == 0, f"{name} has {found['CapEff']}")
            expect((found["Seccomp"], found["NoNewPrivs"]) == ("2", "1"), f"{name}: {found}")
        facts.append(f"{len(processes())} processes")
    with tally.check(f"the loop, and only the loop, has SCHED_FIFO {PRIORITY} and locked memory") as facts:
        for name, pid in processes().items():
            policy, priority = os.sched_getscheduler(pid), os.sched_getparam(pid).sched_priority
            wanted = (os.SCHED_FIFO, PRIORITY) if name == "loop" else (os.SCHED_OTHER, 0)
            expect((policy, priority) == wanted, f"{name}: policy {policy}, priority {priority}")
        locked = int(status_of(processes()["loop"])["VmLck"].split()[0])
        expect(locked > 0, "no memory is locked")
        facts.append(f"{locked // 1024} MiB locked")
    with tally.check("systemd finds the unit right, and its exposure small") as facts:
        done = run("systemd-analyze", "verify", f"/etc/systemd/system/{SERVICE}")
        expect(not done.stdout + done.stderr, done)
        done = run("systemd-analyze", "security", "--no-pager", "--threshold=25", SERVICE)
        expect(done.returncode == 0, done.stdout)
        facts += [
            line.split(":", 1)[1].strip() for line in done.stdout.splitlines() if "Overall exposure" in line
        ]
    with tally.check("memory of each process") as facts:
        held = {name: int(status_of(pid)["VmRSS"].split()[0]) // 1024 for name, pid in processes().items()}
        facts += [f"{name} {megabytes} MiB" for name, megabytes in held.items()]
        facts.append(f"all, shared pages once: {int(unit('MemoryCurrent')) // 2**20} MiB")


def first_position(estimates: Estimates, vehicle: Vehicle, since: float) -> Any:
    """Wait for a position; where the guest was too slow for the satellites' 20 s, the vehicle drives again."""
    for _ in range(3):
        try:
            return until(lambda: estimates.located_after(since), "a first position", 40.0)
        except CheckError:
            vehicle.again()
    return until(lambda: estimates.located_after(since), "a first position")


def estimating(tally: Tally, estimates: Estimates) -> Vehicle:
    with tally.check("before any frame it publishes, and waits") as facts:
        newest = until(lambda: estimates.after(time.monotonic() - 1), "an estimate")
        expect((newest["health"], newest["position"][0]) == ("waiting", None), newest)
        facts.append(newest["reason"])
    started = time.monotonic()
    vehicle = Vehicle()
    with tally.check("frames on vcan0 give a position") as facts:
        until(lambda: estimates.link("bus").get("messages", 0) > 0, "frames on the bus")
        first = first_position(estimates, vehicle, started)
        expect(any(value["links"] for value in estimates.states), "no word on the links")
        facts.append(f"{estimates.arrived[-1][0] - started:.1f} s after the simulator's start")
        facts.append(f"{error_of(first, vehicle):.2f} m off")
    with tally.check("the estimate moves with the vehicle") as facts:
        begin = until(lambda: estimates.located_after(time.monotonic() - 1), "a position")
        end = until(
            lambda: (
                newest
                if (newest := estimates.located_after(started))
                and math.dist(newest["position"][:2], begin["position"][:2]) > 3.0
                else None
            ),
            "3 m of way",
        )
        off = error_of(end, vehicle)
        expect(off < 5.0, f"{off:.2f} m off")
        facts += [
            f"{off:.2f} m off",
            f"radius95 {end['radius95']:.2f} m",
            end["health"],
            f"{end['particles']} particles",
        ]
    with tally.check("beliefd service status shows it") as facts:
        said = must(BELIEFD, "service", "status")
        expect("link bus" in said and "active" in said, said)
    return vehicle


def killing(tally: Tally, vehicle: Vehicle) -> None:
    for name in ("link bus", "link autopilot", "loop", "publisher"):
        with tally.check(f"kill -9 of the {name} is survived") as facts, watching() as estimates:
            facts.extend(killed(name, estimates, vehicle))


def killed(name: str, estimates: Estimates, vehicle: Vehicle) -> list[str]:
    """Kill a process and wait until the chain is whole again, with everything else undisturbed."""
    link = name.removeprefix("link ")
    until(lambda: estimates.states, "a word on the links")
    messages = estimates.link(link).get("messages", 0)
    before, restarts, since = processes(), unit("NRestarts"), time.monotonic()
    os.kill(before[name], signal.SIGKILL)
    replaced(name, before)
    facts = [f"new process after {time.monotonic() - since:.1f} s"]
    if link != name:
        until(lambda: estimates.carries_anew(link, messages), f"messages by the new {name}")
        facts.append(f"messages again after {time.monotonic() - since:.1f} s")
    facts.append(recovered(name, estimates, vehicle, since))
    expect(unit("NRestarts") == restarts, "systemd restarted the service")
    others = {role: pid for role, pid in before.items() if role != name}
    expect(others.items() <= processes().items(), (before, processes()))
    return facts


def recovered(name: str, estimates: Estimates, vehicle: Vehicle, since: float) -> str:
    """Wait until the chain is whole again after a process was killed; say what it cost."""
    if name == "publisher":  # a new subscriber: the publisher is the hub that the old one was connected to
        with watching() as again:
            until(again.newest, "an estimate of the new publisher")
        return f"estimates again after {time.monotonic() - since:.1f} s"
    if name == "loop":
        return located_again(estimates, vehicle, since)
    until(lambda: estimates.located_after(time.monotonic() - 0.5), "a position")
    return f"longest time without an estimate {estimates.gap(since):.2f} s"


def located_again(estimates: Estimates, vehicle: Vehicle, since: float) -> str:
    """Wait for the estimates of a new loop, then for a position; its first fix needs satellites again."""
    until(lambda: estimates.counts_anew(since), "an estimate of the new loop")
    gap = estimates.gap(since)
    vehicle.again()
    first_position(estimates, vehicle, time.monotonic())
    return f"longest time without an estimate {gap:.2f} s"


def hanging(tally: Tally, vehicle: Vehicle) -> None:
    with (
        tally.check("a loop that hangs (SIGSTOP) is replaced by the supervisor") as facts,
        watching() as estimates,
    ):
        before, restarts, since = processes(), unit("NRestarts"), time.monotonic()
        os.kill(before["loop"], signal.SIGSTOP)
        replaced("loop", before)
        facts.append(f"new process after {time.monotonic() - since:.1f} s")
        facts.append(located_again(estimates, vehicle, since))
        expect(unit("NRestarts") == restarts, "systemd restarted the service")
        expect(journal("loop: no sign of life"), "the journal does not say so")
    with tally.check("a supervisor that hangs (SIGSTOP) trips systemd's watchdog") as facts:
        before, restarts, since = processes(), int(unit("NRestarts")), time.monotonic()
        os.kill(before["supervisor"], signal.SIGSTOP)
        until(lambda: int(unit("NRestarts")) == restarts + 1, "a restart by systemd")
        facts.append(f"restarted after {time.monotonic() - since:.1f} s")
        until(lambda: unit("SubState") == "running", "the service to be ready")
        facts.append(f"ready after {time.monotonic() - since:.1f} s")
        expect(journal("[Ww]atchdog timeout"), "the journal has no watchdog timeout")
        expect(not set(before.values()) & set(processes().values()), "a process has outlived it")
        with watching() as estimates:
            until(estimates.newest, "an estimate")


@contextmanager
def watching() -> Iterator[Estimates]:
    """Subscribe to the vehicle for as long as a check lasts."""
    estimates = Estimates(vehicle_name())
    try:
        yield estimates
    finally:
        estimates.close()


def faults(tally: Tally, vehicle: Vehicle, estimates: Estimates) -> None:
    with tally.check("vcan0 down and up: the link says so and comes back, nothing is restarted"):
        vehicle.stop()
        before = processes()
        must("ip", "link", "set", "vcan0", "down")
        until(lambda: estimates.link("bus").get("state") in ("retrying", "silent"), "the link to say so")
        must("ip", "link", "set", "vcan0", "up")
        vehicle.start()
        until(lambda: estimates.link("bus").get("state") == "up", "the link to be up")
        expect(processes() == before, (before, processes()))
    with tally.check("reload of a wrong configuration keeps the old one and says why"):
        right, before = ROBOT_INSTALLED.read_text(), processes()
        ROBOT_INSTALLED.write_text(right + "\n[publish]\nprefix = 3\n")
        run("systemctl", "reload", SERVICE)
        until(lambda: journal("publish, prefix: needs text"), "the reason in the journal")
        ROBOT_INSTALLED.write_text(right)
        must("systemctl", "reload", SERVICE)
        expect(processes() == before, (before, processes()))
    with tally.check("it has no traceback in its journal"):
        expect(not journal("Traceback"), must("journalctl", "-u", SERVICE, "--no-pager", "-o", "cat")[-3000:])


def removal(tally: Tally) -> None:
    with tally.check("stop is clean within 2 s") as facts:
        pids = processes()
        began = time.monotonic()
        must("systemctl", "stop", SERVICE)
        took = time.monotonic() - began
        facts.append(f"{took:.2f} s")
        expect(took < 2.0, f"took {took:.2f} s")
        expect(
            (unit("Result"), unit("ExecMainStatus")) == ("success", "0"),
            (unit("Result"), unit("ExecMainStatus")),
        )
        expect(not any(Path(f"/proc/{pid}").exists() for pid in pids.values()), "a process is left")
    with tally.check("uninstall removes the unit and keeps the state, --purge removes all"):
        must(BELIEFD, "service", "uninstall")
        expect(not Path("/etc/systemd/system", SERVICE).exists(), "the unit is there")
        expect(
            Path("/var/lib/beliefd").exists() and ROBOT_INSTALLED.exists(), "state or configuration has gone"
        )
        must(BELIEFD, "service", "uninstall", "--purge")
        left = [
            path for path in ("/var/lib/beliefd", "/etc/beliefd", "/var/cache/beliefd") if Path(path).exists()
        ]
        expect(not left and run("getent", "passwd", "beliefd").returncode != 0, left)
    with tally.check("no unit has failed"):
        expect(
            not must("systemctl", "list-units", "--failed", "--no-legend").strip(),
            must("systemctl", "--failed"),
        )


def note_on_write_execute(tally: Tally) -> None:
    """Say whether the compiler lives under MemoryDenyWriteExecute=, which the unit leaves out for it."""
    done = run(
        "systemd-run",
        "-q",
        "--wait",
        "--pipe",
        "-p",
        "MemoryDenyWriteExecute=yes",
        PYTHON,
        "-c",
        NO_WRITE_EXECUTE,
    )
    said = (done.stdout + done.stderr).strip().splitlines()[-1:]
    tally.say(f"note MemoryDenyWriteExecute=yes: compiling a kernel exits {done.returncode}: {''.join(said)}")


def vehicle_name() -> str:
    found = re.search(r'\[vehicle\]\s*name = "([^"]+)"', ROBOT.read_text())
    return found[1] if found else ""


def main() -> int:
    """Run every check in order; the later ones need what the earlier ones made."""
    tally = Tally()
    installation(tally)
    if unit("ActiveState") != "active":
        tally.say(run("journalctl", "-u", SERVICE, "--no-pager", "-n", "40").stdout)
        return tally.summary()
    confinement(tally)
    with watching() as estimates:
        vehicle = estimating(tally, estimates)
    killing(tally, vehicle)
    hanging(tally, vehicle)
    with watching() as estimates:
        faults(tally, vehicle, estimates)
    vehicle.stop()
    removal(tally)
    note_on_write_execute(tally)
    return tally.summary()


if __name__ == "__main__":
    sys.exit(main())
