"""A serial line, by pyserial: for this program alone, never blocking."""

from __future__ import annotations

import select

import serial

from drivers.link import LinkError
from drivers.mavlink.port import LARGEST, Port

DEFAULT_BAUD = 115_200


class SerialPort:
    """An open serial device."""

    def __init__(self, device: str, port: serial.Serial) -> None:
        self._device = device
        self._port = port

    def wait(self, timeout: float) -> bool:
        """Wait at most ``timeout`` seconds for bytes; whether there are some."""
        return bool(select.select([self._port], [], [], max(0.0, timeout))[0])

    def read(self) -> list[bytes]:
        """Return what has arrived.

        Raises
        ------
        LinkError
            The device has gone.
        """
        try:
            data = self._port.read(LARGEST)
        except OSError as error:  # pyserial's SerialException is one
            raise LinkError(f"{self._device}: {error}; is it still plugged in?") from error
        return [data] if data else []

    def write(self, data: bytes) -> bool:
        """Send; whether all of it was taken."""
        try:
            return self._port.write(data) == len(data)
        except OSError:  # no room for now, or gone: then the next read says so
            return False

    def close(self) -> None:
        """Close; harmless when it is closed."""
        self._port.close()


def open_serial(url: str) -> Port:
    """Open ``device`` or ``device,baud``.

    Raises
    ------
    LinkError
        The baud rate is no number; the device is absent, not permitted, or in use.
    """
    device, _, baud = url.partition(",")
    if baud and not baud.isdigit():
        raise LinkError(f"{url}: baud rate '{baud}' is no number; write the device as /dev/ttyS1,57600")
    try:
        port = serial.Serial(device, int(baud or DEFAULT_BAUD), timeout=0, write_timeout=0, exclusive=True)
    except (OSError, ValueError) as error:
        raise LinkError(
            f"serial device {device}: {error}; needs a device that exists, that this user may open "
            "(group dialout), and that no other program has open"
        ) from error
    return SerialPort(device, port)
