"""Waiting for a number in memory that another thread writes: for microseconds that sleeping would make tens of.

The interpreter's lock is not held meanwhile. The load is atomic, or the compiler would look only once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from filters.kernels.compile import INTERPRETED, kernel


def _load_typed(_context: Any, array: Any, index: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        found = context.make_array(signature.args[0])(context, builder, arguments[0])
        return builder.load_atomic(builder.gep(found.data, [arguments[1]]), "acquire", 8)

    return types.int64(array, index), generate


def _load_plainly(array: NDArray[np.int64], index: int) -> int:
    return int(array[index])


_load: Callable[[NDArray[np.int64], int], int] = (
    _load_plainly if INTERPRETED else cast(Any, intrinsic)(_load_typed)
)


@kernel("boolean(int64[::1], int64, int64, int64, int64)", exact=True)
def changed(numbers: NDArray[np.int64], place: int, known: int, looks: int, linger: int) -> bool:
    """Look at ``numbers[place]`` until it is not ``known`` any more, at most ``looks`` times; say whether it changed.

    Having seen it, look idly ``linger`` times more: who wrote it may hold the interpreter's lock for a moment yet, and
    to wait for that is to sleep.
    """
    for _ in range(looks):
        if _load(numbers, place) != known:
            left = linger
            while left > 0 and _load(numbers, place) != known:
                left -= 1
            return True
    return False
