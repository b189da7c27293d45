"""The process that makes one density: a cloud on its input, JSON on its output, and it is gone.

``python -m service.publish.extraction EXTRACTOR TIME < cloud > density.json``; the cloud is rows of four float32 as on
the wire. It leaves with 1 and the reason on its error output if the cloud does not do.
"""

from __future__ import annotations

import sys

import msgspec
import numpy as np

from service.density import extract


def main(extractor: str, time: str) -> int:
    """Extract, and return the exit code."""
    rows = np.frombuffer(sys.stdin.buffer.read(), "<f4").reshape(-1, 4).astype(np.float64)
    try:
        density = extract(extractor, rows, float(time))
    except ValueError as error:
        sys.stderr.write(str(error))
        return 1
    sys.stdout.buffer.write(msgspec.json.encode(density))
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
