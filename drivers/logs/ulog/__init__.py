"""PX4's ULog files (.ulg)."""

from drivers.logs.ulog.reader import UlogReader

__all__ = ["UlogReader"]
