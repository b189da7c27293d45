"""What the demonstration puts up and takes down: a simulated vehicle and a daemon, as processes.

Everything is private to it: a temporary directory, ports that the system chose, a Zenoh endpoint of its
own. The vehicle's CAN bus is ``vcan0`` where the kernel has it, else a serial adapter (slcan) that the
simulator plays.
"""

from __future__ import annotations

import contextlib
import json
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Generator
from pathlib import Path

from service.config import Configuration, load

_COMMAND = (sys.executable, "-c", "from service.cli import main; main()")
_SIMULATOR = (sys.executable, "-m", "sim_vehicle")
_VCAN = Path("/sys/class/net/vcan0/flags")
_UP = 0x1
_WRITING = 0.1
_LAST_LINES = 20
_PATIENCE = 5.0


class StageError(Exception):
    """The demonstration cannot be put up; the text says why."""


class Stage:
    """A folder, a configuration, and the two programs once they are started.

    Attributes
    ----------
    configuration : Configuration
        What the daemon runs with.
    endpoint : str
        Where its Zenoh session listens.
    truth : Path
        Where the simulator writes where the vehicle really is.
    """

    def __init__(self, folder: Path, scenario: str, seed: int, port: int) -> None:
        self._folder = folder
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self.endpoint = f"tcp/127.0.0.1:{port}"
        self.truth = folder / "truth.csv"
        can = "socketcan:vcan0" if _has_vcan() else f"slcan:{folder / 'can0'}"
        self._drive = (
            *_SIMULATOR, scenario, "--seed", str(seed), "--realtime",
            "--mavlink", f"udpout:127.0.0.1:{_free_udp_port()}", "--can", can,
        )  # fmt: skip
        self._file = folder / "demo.toml"
        self.configuration = self._configured()

    def start_daemon(self) -> None:
        """Start ``beliefd run``."""
        self._start("daemon", *_COMMAND, "run", str(self._file))

    def start_vehicle(self, seconds: float) -> None:
        """Let the vehicle drive for ``seconds``."""
        self._start("vehicle", *self._drive, "--seconds", f"{seconds:g}", "--truth", str(self.truth))

    def died(self) -> str | None:
        """Return which program has ended that should not have, and how; ``None`` while all run."""
        for name, process in self._running.items():
            status = process.poll()
            if status is not None:
                return f"the {name} ended by itself, exit status {status}"
        return None

    def tail(self, name: str) -> str:
        """Return the last lines that ``daemon`` or ``vehicle`` said."""
        log = self._folder / f"{name}.log"
        lines = log.read_text(errors="replace").splitlines() if log.exists() else []
        return "\n".join(lines[-_LAST_LINES:])

    def stop(self) -> None:
        """Stop the vehicle, then the daemon; what does not stop in five seconds is killed."""
        for name in ("vehicle", "daemon"):
            process = self._running.pop(name, None)
            if process is None:
                continue
            process.send_signal(signal.SIGTERM)
            try:
                process.wait(_PATIENCE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def _start(self, name: str, *command: str) -> None:
        with (self._folder / f"{name}.log").open("wb") as log, _uninterrupted():
            # A session of its own: Ctrl-C in the terminal reaches only us, and we stop things in order.
            self._running[name] = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True
            )

    def _configured(self) -> Configuration:
        written = subprocess.run(
            (*self._drive, "--seconds", str(_WRITING), "--config", str(self._file)),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )
        if written.returncode or not self._file.exists():
            raise StageError(written.stderr.strip() or "the simulator wrote no configuration")
        session = self._folder / "zenoh.json5"
        session.write_text(
            json.dumps(
                {
                    "mode": "peer",
                    "listen": {"endpoints": [self.endpoint]},
                    "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
                    "transport": {"shared_memory": {"enabled": False}},
                }
            )
        )
        with self._file.open("a") as file:
            file.write(
                f'\n[publish]\nzenoh = "{session}"\n\n[state]\ndirectory = "{self._folder / "state"}"\n'
            )
        return load(self._file)


@contextlib.contextmanager
def stage(scenario: str, seed: int) -> Generator[Stage]:
    """Put up a stage, and take down everything on it at the end, whatever happens.

    Raises
    ------
    StageError
        There is no such scenario, or the simulator cannot open its ports.
    """
    with tempfile.TemporaryDirectory(prefix="beliefd-demo-") as folder, socket.socket() as reserved:
        reserved.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        reserved.bind(
            ("127.0.0.1", 0)
        )  # bound, not listening: nobody else is given the port, Zenoh may have it
        put_up = Stage(Path(folder), scenario, seed, reserved.getsockname()[1])
        try:
            yield put_up
        finally:
            patient = signal.signal(
                signal.SIGINT, signal.SIG_IGN
            )  # a second Ctrl-C must not leave half of it
            put_up.stop()
            signal.signal(signal.SIGINT, patient)


def warm() -> int:
    """Compile the kernels that are not cached yet, showing the progress; return the exit status."""
    return subprocess.run((*_COMMAND, "warm"), check=False).returncode


@contextlib.contextmanager
def _uninterrupted() -> Generator[None]:
    """Put Ctrl-C off: in the middle of a start it would leave a process that nobody knows of."""
    interrupts: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: interrupts.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if interrupts:
        raise KeyboardInterrupt


def _free_udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def _has_vcan() -> bool:
    return _VCAN.exists() and bool(int(_VCAN.read_text(), 16) & _UP)
