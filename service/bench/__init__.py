"""``beliefd bench``: what this machine affords."""

from service.bench.command import command

__all__ = ["command"]
