"""A serial CAN adapter made of a pseudo-terminal: this side is the adapter, the client opens the other side.

The text protocol is LAWICEL's: ``S8`` sets the rate, ``O`` opens, ``L`` opens to listen, ``C`` closes, ``V``
and ``N`` ask for version and serial number; ``T1234567833AABBCC`` is an extended frame, ``t`` a standard one,
each ending in a carriage return. The client may come and go; frames for which there is nobody, or no room,
are dropped and counted.
"""

from __future__ import annotations

import contextlib
import os
import pty
import termios
import tty
from pathlib import Path

from sim_vehicle.frame import CanFrame

_DONE, _REFUSED = b"\r", b"\a"
_VERSION, _SERIAL_NUMBER = b"V1013\r", b"NB001\r"
_LONGEST_COMMAND = 64


def frame_line(frame: CanFrame) -> bytes:
    """Return a frame as the adapter says it."""
    identifier = f"T{frame.identifier:08X}" if frame.extended else f"t{frame.identifier:03X}"
    return f"{identifier}{len(frame.data)}{frame.data.hex().upper()}\r".encode()


def parsed(line: bytes) -> CanFrame | None:
    """Return the frame that a client's ``T`` or ``t`` line says; ``None`` when it is malformed."""
    digits = {b"T": 8, b"t": 3}.get(line[:1])
    if digits is None:
        return None
    try:
        identifier, length = int(line[1 : 1 + digits], 16), int(line[1 + digits : 2 + digits])
        data = bytes.fromhex(line[2 + digits :].decode())
    except ValueError:
        return None
    fits = identifier < (1 << 29 if digits == 8 else 1 << 11)
    return CanFrame(identifier, data, digits == 8) if fits and len(data) == length <= 8 else None


class Adapter:
    """A serial CAN adapter.

    Parameters
    ----------
    path : str
        Becomes a symbolic link to the client's side of the terminal; one that is there already is replaced.

    Raises
    ------
    FileExistsError
        Something else than a symbolic link is there.
    """

    def __init__(self, path: str) -> None:
        self._link = Path(path)
        if self._link.exists() and not self._link.is_symlink():
            raise FileExistsError(f"{path} exists and is no symbolic link; name a free path")
        self._link.parent.mkdir(parents=True, exist_ok=True)
        self._ours, self._theirs = pty.openpty()
        tty.setraw(self._theirs)
        os.set_blocking(self._ours, False)
        self._link.unlink(missing_ok=True)
        self._link.symlink_to(os.ttyname(self._theirs))
        self._command = bytearray()
        self._backlog = b""
        self.open = False
        self.address = f"slcan:{path}"
        self.sent = 0
        self.dropped = 0
        self.received = 0
        self.malformed = 0

    def filenos(self) -> list[int]:
        """Return the descriptors to wait on."""
        return [self._ours]

    def send(self, frame: CanFrame) -> None:
        """Say a frame to the client, or drop and count it when the channel is closed or nobody reads."""
        if not self.open or not self._say(frame_line(frame)):
            self.dropped += 1
        else:
            self.sent += 1

    def serve(self) -> None:
        """Take in the client's commands and frames, and answer them."""
        while True:
            try:
                data = os.read(self._ours, 4096)
            except BlockingIOError:
                return
            for byte in data:
                if byte == _DONE[0]:
                    self._obey(bytes(self._command))
                    self._command.clear()
                elif len(self._command) < _LONGEST_COMMAND:
                    self._command.append(byte)

    def close(self) -> None:
        """Take the adapter away: the link, and both sides of the terminal."""
        with contextlib.suppress(FileNotFoundError):
            if self._link.readlink() == Path(os.ttyname(self._theirs)):
                self._link.unlink()
        os.close(self._ours)
        os.close(self._theirs)

    def _obey(self, command: bytes) -> None:
        letter = command[:1]
        if letter in (b"O", b"L"):
            # What an earlier client left unread is stale: this one begins with what comes now.
            termios.tcflush(self._theirs, termios.TCIFLUSH)
            self._backlog = b""
            self.open = True
            self._say(_DONE)
        elif letter == b"C":
            self.open = False
            self._say(_DONE)
        elif letter in (b"S", b"s", b"", b"Z", b"M", b"m", b"X", b"Y"):
            self._say(_DONE)
        elif letter in (b"V", b"N"):
            self._say(_VERSION if letter == b"V" else _SERIAL_NUMBER)
        else:
            self._take(command)

    def _take(self, line: bytes) -> None:
        frame = parsed(line)
        if frame is None or not self.open:
            self.malformed += 1
            self._say(_REFUSED)
        else:
            self.received += 1
            self._say(b"Z\r" if frame.extended else b"z\r")

    def _say(self, line: bytes) -> bool:
        """Write a whole line; what does not fit goes before the next one, so that no line is cut."""
        try:
            if self._backlog:
                self._backlog = self._backlog[os.write(self._ours, self._backlog) :]
            if self._backlog:
                return False
            self._backlog = line[os.write(self._ours, line) :]
        except BlockingIOError:
            return False
        return True
