"""ArduPilot's DataFlash logs (.bin)."""

from drivers.logs.dataflash.reader import DataflashReader

__all__ = ["DataflashReader"]
