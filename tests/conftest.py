"""What every test run needs: the kernels' cache where the product has it.

numba's own cache beside the sources does not notice when a function that was inlined from another file changes; the
product's is named by a digest of all that is compiled.
"""

from __future__ import annotations

from service import kernels

kernels.prepare()
