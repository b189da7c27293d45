"""`beliefd run --record` on real processes: a simulated rover speaks MAVLink over UDP; what is recorded replays."""

from __future__ import annotations

import csv
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh

from drivers.logs.recording import RecordingReader

ROOT = Path(__file__).parents[2]
PATIENCE = 120.0
"""Seconds: the first start on a machine compiles the kernels."""

KEY = "beliefd/v1/beacons-rover"
LINES = 5000


def beliefd(*arguments: str, before: str = "") -> list[str]:
    return [sys.executable, "-c", before + "from service.cli import main; main()", *arguments]


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def wait_for(condition: Callable[[], bool], what: str) -> None:
    until = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < until, f"not within {PATIENCE} s: {what}"
        time.sleep(0.02)


class Drive:
    """The simulator, the daemon that records what it says, and what the daemon's journal says."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "drive.mcap"
        self.configuration = folder / "drive.toml"
        self.journal: list[str] = []
        self.endpoint = f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"
        listening = {
            "mode": "peer",
            "listen": {"endpoints": [self.endpoint]},
            "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        }
        (folder / "zenoh.json5").write_text(json.dumps(listening))
        command = [sys.executable, "-m", "sim_vehicle", "beacons", "--seconds", "600", "--realtime"]
        port = free_port(socket.SOCK_DGRAM)
        command += ["--mavlink", f"udpout:127.0.0.1:{port}", "--config", str(self.configuration)]
        self.processes: list[subprocess.Popen[Any]] = [
            subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL)
        ]
        wait_for(lambda: self.configuration.exists() and "[[beacon]]" in self._text, "a configuration")
        added = f'[publish]\nzenoh = "{folder}/zenoh.json5"\n[state]\ndirectory = "{folder}/none"\n'
        self.configuration.write_text(f"{self._text}\n{added}")

    @property
    def _text(self) -> str:
        return self.configuration.read_text()

    def record(self, before: str = "") -> subprocess.Popen[str]:
        """Start the daemon; ``before``: what its process is to do first."""
        daemon = subprocess.Popen(
            beliefd("run", str(self.configuration), "--record", str(self.file), before=before),
            cwd=ROOT,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.processes.append(daemon)
        threading.Thread(target=self._listen, args=(daemon,), daemon=True).start()
        return daemon

    def _listen(self, daemon: subprocess.Popen[str]) -> None:
        assert daemon.stderr is not None
        with daemon.stderr as lines:
            self.journal.extend(lines)

    def recorded(self) -> int:
        """Return how many bytes there are."""
        return self.file.stat().st_size if self.file.exists() else 0

    def session(self) -> zenoh.Session:
        connected = {"mode": "client", "connect": {"endpoints": [self.endpoint], "timeout_ms": -1}}
        return zenoh.open(zenoh.Config.from_json5(json.dumps(connected)))

    def close(self) -> None:
        for process in reversed(self.processes):
            process.send_signal(signal.SIGTERM)
        for process in self.processes:
            process.wait(20.0)


@pytest.fixture
def drive(tmp_path: Path) -> Iterator[Drive]:
    made = Drive(tmp_path)
    yield made
    made.close()


def replayed(path: Path, *more: str) -> dict[str, Any]:
    """Replay a recording by the command, with nothing but the file."""
    done = subprocess.run(
        beliefd("replay", str(path), "--json", *more), cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    (run,) = json.loads(done.stdout)["runs"]
    return run


def payloads(path: Path) -> dict[int, bytes]:
    """Return the estimates of a recording by their sequence."""
    entries = RecordingReader(path).entries()
    found = [entry.data for entry in entries if entry.topic == "estimate"]
    return {json.loads(data)["sequence"]: data for data in found}


@pytest.mark.slow
def test_a_recorded_run_is_replayed_to_the_bytes_that_it_published(drive: Drive, tmp_path: Path) -> None:
    """What a subscriber got, what the file holds and what the replay finds are the same; SIGTERM closes the file."""
    daemon = drive.record()
    with drive.session() as session:
        heard = session.declare_subscriber(f"{KEY}/estimate", zenoh.handlers.FifoChannel(LINES))
        wait_for(lambda: drive.recorded() > 200_000, "200 kB")
        daemon.send_signal(signal.SIGTERM)
        assert daemon.wait(20.0) == 0
        published: list[bytes] = []
        while (value := heard.try_recv()) is not None:
            published.append(value.payload.to_bytes())
    in_file = payloads(drive.file)
    assert len(published) > 50
    assert all(in_file[json.loads(payload)["sequence"]] == payload for payload in published)

    run = replayed(drive.file, "--out", str(tmp_path))
    assert run["again"] == {"published": len(in_file), "same": len(in_file)}
    assert run["ticks"] == len(in_file)
    assert "malformed" not in run["links"][0]
    with (tmp_path / "estimates_seed0.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    last = json.loads(in_file[max(in_file)])
    assert float(rows[-1]["time_s"]) == pytest.approx(last["time"], abs=1e-5)
    assert float(rows[-1]["north_m"]) == pytest.approx(last["position"][0], abs=1e-4)
    assert any(f"{drive.file}: {len(in_file)} ticks" in line for line in drive.journal)


@pytest.mark.slow
def test_one_cut_off_by_a_kill_replays_up_to_there(drive: Drive) -> None:
    """The supervisor is killed, and the kernel kills the rest: no index, no end; what was written is the same again."""
    daemon = drive.record()
    wait_for(lambda: drive.recorded() > 100_000, "100 kB")
    daemon.kill()
    daemon.wait(20.0)
    run = replayed(drive.file)
    assert run["again"]["same"] == run["again"]["published"] > 50
    assert run["links"][0]["malformed"]["broken_container"] == 1


@pytest.mark.slow
def test_a_full_disk_ends_the_recording_and_nothing_else(drive: Drive) -> None:
    """A limit on the size of files stands for the disk: one message, and the estimates go on; the rest replays."""
    limit = 200_000
    daemon = drive.record(f"import resource as r; r.setrlimit(r.RLIMIT_FSIZE, ({limit}, {limit})); ")
    wait_for(lambda: any("ends here" in line for line in drive.journal), "the message")
    ended = time.monotonic_ns()
    with drive.session() as session:
        heard = session.declare_subscriber(f"{KEY}/estimate", zenoh.handlers.FifoChannel(LINES))

        def later() -> bool:
            value = heard.try_recv()
            return value is not None and json.loads(value.payload.to_bytes())["monotonic_ns"] > ended + 10**9

        wait_for(later, "an estimate a second later")
    daemon.send_signal(signal.SIGTERM)
    assert daemon.wait(20.0) == 0
    said = [line for line in drive.journal if "ends here" in line]
    assert len(said) == 1
    assert f"{drive.file}: File too large; the recording ends here, the estimate goes on" in said[0]
    assert drive.recorded() <= limit
    run = replayed(drive.file)
    assert run["again"]["same"] == run["again"]["published"] > 0


def refused(*arguments: str, before: str = "") -> str:
    command = beliefd("run", *arguments, before=before)
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=60.0)
    assert done.returncode == 1, done.stderr
    return done.stderr


@pytest.fixture
def configuration(tmp_path: Path) -> Path:
    path = tmp_path / "rover.toml"
    path.write_text(
        '[vehicle]\nname = "r"\n[[link]]\nname = "a"\nkind = "mavlink"\nurl = "udpin:127.0.0.1:0"\n'
    )
    return path


def test_what_was_recorded_once_is_not_written_over(configuration: Path, tmp_path: Path) -> None:
    (tmp_path / "drive.mcap").write_bytes(b"precious")
    said = refused(str(configuration), "--record", str(tmp_path / "drive.mcap"))
    assert "drive.mcap exists already, and is not written over: name another file, or move it away" in said
    assert (tmp_path / "drive.mcap").read_bytes() == b"precious"


def test_a_file_that_cannot_be_made_is_said_at_once(configuration: Path, tmp_path: Path) -> None:
    said = refused(str(configuration), "--record", str(tmp_path / "none" / "drive.mcap"))
    assert "cannot be written: No such file or directory" in said


def test_a_library_that_is_missing_is_named_with_what_brings_it(configuration: Path, tmp_path: Path) -> None:
    hidden = "import sys; sys.modules['mcap'] = None; "
    said = refused(str(configuration), "--record", str(tmp_path / "drive.mcap"), before=hidden)
    assert "--record needs mcap: pip install 'beliefd[record]'" in said
    assert not os.path.lexists(tmp_path / "drive.mcap")
