"""The one typed doorway to numba.

A *kernel* is a small function over columns with one explicit signature: it is compiled when its module is
imported, or loaded from numba's cache. A *function* is scalar arithmetic that a kernel calls and LLVM
inlines. A *part* is what several kernels have in common, compiled as if each had it written out. None reads
anything but its arguments, so all run as plain Python too (``NUMBA_DISABLE_JIT=1``), slowly.

Two sets of floating-point flags, because the compiler may reorder one and not the other:

- functions are polynomials and range reductions whose order of operations matters; only contraction to fused
  multiply-add and indifference to the sign of zero are allowed;
- kernels sum over particles; there reassociation is what lets the sum run in vector registers.

Neither claims the absence of infinities and NaN: a particle far away may have the log weight minus infinity.
Division never raises (``error_model="numpy"``), or loops would not vectorise.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, ParamSpec, Protocol, TypeVar, cast

import numba
import numpy as np
from numba.core import config
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]
Int32Array = NDArray[np.int32]
Progress = Callable[[str, int, int], None]
F = TypeVar("F", bound=Callable[..., Any])
P = ParamSpec("P")
R = TypeVar("R")

FUNCTION_FLAGS = frozenset({"nsz", "contract"})
KERNEL_FLAGS = frozenset({"nsz", "contract", "arcp", "reassoc"})
INTERPRETED = bool(cast(Any, config).DISABLE_JIT)


class Compiled(Protocol):
    """What of numba's result of a compilation is used here."""

    @property
    def entry_point(self) -> Callable[..., Any]:
        """What Python calls."""
        ...


class Dispatcher(Protocol):
    """What of numba's dispatcher is used here."""

    py_func: Callable[..., Any]
    overloads: Mapping[object, Compiled]
    direct: Callable[..., Any]

    def compile(self, sig: str) -> object:
        """Compile one signature, or load it from the cache."""
        ...

    def add_overload(self, cres: object) -> None:
        """Take what a compilation came to."""
        ...

    def disable_compile(self) -> None:
        """Refuse other signatures; convert arguments to the one there is."""
        ...


class Kernel(Protocol[P, R]):
    """A kernel as its callers see it.

    Attributes
    ----------
    direct : callable
        The same without numba's choice of a signature, which takes as long as the arithmetic of a hundred particles.
        Nobody looks at the arguments then: the arrays must be of the kernel's types and contiguous. So it is for
        callers whose arrays are their own, as a particle set's are.
    """

    direct: Callable[P, R]

    def __call__(self, *arguments: P.args, **named: P.kwargs) -> R:
        """Call it with arguments of its types; others raise ``TypeError``."""
        ...


class Pending:
    """A kernel that is known and, perhaps, not yet compiled."""

    def __init__(self, name: str, signature: str, dispatcher: Dispatcher) -> None:
        self.name = name
        self.signature = signature
        self.dispatcher = dispatcher
        self.compiled = False

    def compile(self) -> None:
        """Compile it, or load it from the cache, once."""
        if not self.compiled:
            self.dispatcher.compile(self.signature)
            self._settle()

    def take(self, made: Compiled) -> None:
        """Take the machine code of an earlier compilation, see :mod:`filters.kernels.linking`."""
        if not self.compiled:
            self.dispatcher.add_overload(made)
            self._settle()

    def _settle(self) -> None:
        self.dispatcher.disable_compile()
        self.dispatcher.direct = next(iter(self.dispatcher.overloads.values())).entry_point
        self.compiled = True


_kernels: dict[str, Pending] = {}
_deferring = False


def kernel(signature: str, *, exact: bool = False) -> Callable[[Callable[P, R]], Kernel[P, R]]:
    """Make a kernel of a function over columns.

    Parameters
    ----------
    signature : str
        numba's notation, for example ``"void(float32[::1], int64, int64)"``. Other arguments are converted to
        it.
    exact : bool
        Keep the order of floating-point operations as written: for sums that must come out the same as an
        oracle's.
    """
    flags = FUNCTION_FLAGS if exact else KERNEL_FLAGS
    compiler = cast(Callable[..., Callable[[Callable[P, R]], Any]], numba.njit)(
        fastmath=set(flags), nogil=True, cache=True, error_model="numpy"
    )

    def decorate(python: Callable[P, R]) -> Kernel[P, R]:
        compiled = compiler(python)
        compiled.direct = compiled
        if not INTERPRETED:
            name = f"{python.__module__}.{python.__name__}"
            _kernels[name] = Pending(name, signature, cast(Dispatcher, compiled))
            if not _deferring:
                _kernels[name].compile()
        return cast(Kernel[P, R], compiled)

    return decorate


def function(python: F) -> F:
    """Make scalar arithmetic that kernels call; LLVM inlines it into each."""
    compiler = cast(Callable[..., Callable[[F], Any]], numba.njit)(
        fastmath=set(FUNCTION_FLAGS), error_model="numpy", forceinline=True
    )
    return cast(F, compiler(python))


def part(python: F) -> F:
    """Make what several kernels have in common: part of each, with the flags of each."""
    return cast(F, cast(Callable[..., Callable[[F], Any]], numba.njit)(inline="always")(python))


@contextmanager
def _deferred() -> Generator[None]:
    global _deferring  # noqa: PLW0603  the decorator runs at import, where no argument can reach it
    before, _deferring = _deferring, True
    try:
        yield
    finally:
        _deferring = before


def every_module() -> list[str]:
    """Return the names of all modules of ``filters``."""
    package = importlib.import_module("filters")
    return [module.name for module in pkgutil.walk_packages(package.__path__, "filters.")]


def gather(modules: Sequence[str]) -> list[Pending]:
    """Import modules, and return every kernel that is known then; what came with them is not compiled yet."""
    with _deferred():
        for module in modules:
            importlib.import_module(module)
    return list(_kernels.values())


def compile_all(modules: Sequence[str], progress: Progress | None = None) -> int:
    """Import modules and compile every kernel they come with, or load it from the cache.

    Parameters
    ----------
    modules : sequence of str
        Such as :func:`every_module` says, or those that a program needs.
    progress : callable, optional
        Told ``(name, index, total)`` before each kernel, with ``index`` from 0, and once more with
        ``index == total`` and an empty name when all are there.

    Returns
    -------
    int
        How many kernels there are.
    """
    kernels = gather(modules)
    total = len(kernels)
    for index, pending in enumerate(kernels):
        if progress is not None:
            progress(pending.name, index, total)
        pending.compile()
    if progress is not None:
        progress("", total, total)
    return total
