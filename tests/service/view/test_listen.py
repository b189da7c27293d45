"""``listen`` as its user has it: in a pipe, in a terminal, with one vehicle, with several, with none."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import pty
import select
import signal
import struct
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Callable, Iterator

import pytest

from tests.service.publish.conftest import Daemon
from tests.service.publish.spoken import budget, estimate, sensors, tagged, wait_for

PROGRAM = "import sys; from service.view.listen import run; sys.exit(run(sys.argv[1] or None, sys.argv[2]))"

Start = Callable[..., Daemon]


def listening(vehicle: str, endpoint: str) -> list[str]:
    return [sys.executable, "-c", PROGRAM, vehicle, endpoint]


@contextlib.contextmanager
def speaking(daemon: Daemon) -> Iterator[None]:
    """Let the loop speak, 50 times a second, until the end."""
    stop = threading.Event()

    def _speak() -> None:
        sequence = 0
        while not stop.wait(0.02):
            sequence += 1
            with contextlib.suppress(BlockingIOError):
                daemon.send(tagged(b"E", estimate(sequence)), tagged(b"B", budget()), tagged(b"S", sensors()))

    thread = threading.Thread(target=_speak)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def test_in_a_pipe_it_writes_a_line_a_time(start: Start, endpoint: str) -> None:
    """The only vehicle is found by itself; the lines are the slow estimate as it is; Ctrl-C ends it well."""
    with (
        speaking(start(endpoint)),
        subprocess.Popen(listening("", endpoint), stdout=subprocess.PIPE, text=True) as process,
    ):
        assert process.stdout is not None
        lines = [json.loads(process.stdout.readline()) for _ in range(3)]
        process.send_signal(signal.SIGINT)
        assert process.wait(5.0) == 0
    assert [set(line) for line in lines] == [set(json.loads(tagged(b"", estimate(1))))] * 3
    assert lines[0]["sequence"] < lines[1]["sequence"] < lines[2]["sequence"]


def test_a_reader_that_goes_away_is_no_error(start: Start, endpoint: str) -> None:
    """With a buffered output: what could not be written is still in it when the interpreter ends."""
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with (
        speaking(start(endpoint)),
        subprocess.Popen(
            listening("mower", endpoint),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=buffered,
        ) as process,
    ):
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        assert process.wait(10.0) == 0
        assert process.stderr.read() == ""


def test_of_several_vehicles_one_must_be_named(start: Start, endpoint: str, tmp_path: object) -> None:
    start(endpoint, "mower")
    start(endpoint, "tractor", connect=True)

    def _refused() -> subprocess.CompletedProcess[str] | None:
        with subprocess.Popen(
            listening("", endpoint), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as process:
            try:
                out, err = process.communicate(timeout=3.0)
            except subprocess.TimeoutExpired:
                process.kill()
                return None
            return subprocess.CompletedProcess(process.args, process.returncode, out, err)

    refusal = wait_for(_refused, 20.0)
    assert isinstance(refusal, subprocess.CompletedProcess)
    assert refusal.returncode == 2
    assert "several vehicles are alive, name one of them: mower, tractor" in refusal.stderr


@pytest.mark.parametrize(
    ("vehicle", "router", "said"),
    [
        ("a/b", "tcp/127.0.0.1:1", "a name is one chunk of a key"),
        ("mower", "127.0.0.1", "protocol/host:port"),
    ],
)
def test_wrong_use_is_refused_at_once(vehicle: str, router: str, said: str) -> None:
    refusal = subprocess.run(
        listening(vehicle, router), capture_output=True, text=True, timeout=20, check=False
    )
    assert refusal.returncode == 2
    assert said in refusal.stderr


def test_silence_is_explained(endpoint: str, start: Start) -> None:
    """Nobody there, and then a daemon whose loop sends nothing: each is said, and waited for."""
    with subprocess.Popen(
        listening("mower", endpoint), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        assert f"nobody answers at {endpoint}: is `beliefd run` started there?" in process.stderr.readline()
        start(endpoint)
        assert "mower is alive, but sends no estimate" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        assert process.wait(5.0) == 0


def test_in_a_terminal_it_shows_the_screen(start: Start, endpoint: str) -> None:
    """80 by 24, with what the loop says; Ctrl-C leaves the terminal as it was."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    with speaking(start(endpoint)):
        process = subprocess.Popen(
            listening("mower", endpoint),
            stdin=theirs,
            stdout=theirs,
            env={**os.environ, "TERM": "xterm-256color"},
            start_new_session=True,
        )
        os.close(theirs)
        shown = bytearray()

        def _read(until: bytes, seconds: float = 20.0) -> None:
            deadline = time.monotonic() + seconds
            while until not in shown:
                assert time.monotonic() < deadline, shown[-3000:].decode(errors="replace")
                if select.select([ours], [], [], 0.1)[0]:
                    shown.extend(os.read(ours, 65536))

        try:
            _read(b"\x1b[?1049h")
            _read(b"ranges and odometry agree")
            _read(b"range/autopilot/5")
            _read(b"50 Hz from")
            process.send_signal(signal.SIGINT)
            _read(b"\x1b[?1049l")
            assert process.wait(5.0) == 0
        finally:
            process.kill()
            process.wait()
            os.close(ours)
