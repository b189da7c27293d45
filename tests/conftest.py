"""What every test run needs: the kernels' cache where the product has it, and Ctrl-C as in a terminal.

numba's own cache beside the sources does not notice when a function that was inlined from another file changes; the
product's is named by a digest of all that is compiled.
"""

from __future__ import annotations

import signal

from service import kernels

kernels.prepare()
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # a shell starts what runs in the background so, and every program under test would inherit it
    signal.signal(signal.SIGINT, signal.default_int_handler)
