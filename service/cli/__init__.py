"""``beliefd``, the command line: exit 0 done, 1 failed, 2 wrong use or wrong configuration.

One file per command. What a command needs is imported when it runs, so that ``--help`` answers at once.
"""

from __future__ import annotations

import sys

from service.cli.application import application


def main() -> None:
    """Run the command line; this is what the ``beliefd`` script calls."""
    from service.cli.failure import reported

    sys.exit(reported(application))


__all__ = ["main"]
