"""Recordings of samples (.mcap): what no other log says, or what was understood once and is to be replayed as it was.

One message is one reading: its data is the JSON of :data:`~drivers.sample.AnyReading` as ``sample/<sensor>`` has it on
Zenoh, ``publish_time`` is when it was measured and ``log_time`` when it was received, nanoseconds on one clock. The
channel's metadata say by which ``link`` it came and which ``source`` said it. A message on another channel is somebody
else's, and is left alone. MCAP is a container with chunks that have checksums: https://mcap.dev/spec
"""

from drivers.logs.recording.reader import Entry, RecordingReader
from drivers.logs.recording.writer import Recording, write

__all__ = ["Entry", "Recording", "RecordingReader", "write"]
