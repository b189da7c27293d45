"""The machine code of all kernels, linked at once.

numba loads a kernel from its cache in 3 ms, most of which is for compiling others that call it: it parses the
kernel's bitcode and lists its symbols. And before the first it sets up its compiler, which takes 0.15 s. A process that
compiles nothing needs neither. It hands the object code of all kernels to numba's linker, and makes of each entry point
what numba would have made (``CPUContext.get_executable``). The machine code is the same to the byte, in the same order.

It is as valid as numba's cache is: for this version of numba, for this processor, and while the kernels' files are of
the same time and size. Whoever keeps it keeps it beside that cache.
"""

from __future__ import annotations

import ctypes
import importlib
import sys
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

import llvmlite.binding as llvm
import numba
from numba.core import sigutils
from numba.core.registry import cpu_target
from numba.core.runtime.nrt import rtsys

from filters.kernels.compile import Pending

_LAST = "define void @beliefd_linked() { ret void }"
_context = cast(Any, cpu_target).target_context
_functions = cast(Any, importlib.import_module("numba._dynfunc"))


class Code(NamedTuple):
    """The machine code of one kernel."""

    name: str
    stamp: tuple[float, int]
    """Time and size of its file."""
    symbol: str
    """Entry point."""
    environments: tuple[str, ...]
    """Where it looks for numba's environments, which only Python objects would need."""
    text: bytes
    """Object code."""


class Library(NamedTuple):
    """The machine code of kernels, and what it is valid for."""

    platform: tuple[str, ...]
    codes: tuple[Code, ...]


class Linked(NamedTuple):
    """What of numba's result of a compilation a call needs."""

    signature: Any
    entry_point: Callable[..., Any]
    objectmode: bool


def library(kernels: Sequence[Pending]) -> Library:
    """Return the machine code of kernels that are compiled, and in numba's cache.

    Raises
    ------
    LookupError
        One of them is not in the cache, or its machine code is not all that it needs.
    """
    return Library(_platform(), tuple(_code(kernel) for kernel in kernels))


def link(kernels: Sequence[Pending], made: Library) -> bool:
    """Take the machine code of a library, all of it or nothing; say which.

    Nothing is taken where it is not valid here, or one of ``kernels`` is not in it, or is compiled already.
    """
    codes = {code.name: code for code in made.codes}
    if made.platform != _platform() or any(
        kernel.compiled or kernel.name not in codes or codes[kernel.name].stamp != _stamp(kernel)
        for kernel in kernels
    ):
        return False
    cast(Any, rtsys).initialize(_context)
    engine = _engine()
    for kernel in kernels:
        engine.add_object_file(llvm.ObjectFileRef.from_data(codes[kernel.name].text))
        engine.finalize_object()
    # A symbol that is missing ends the process, but only when the linker is used again: now, and not at the first call.
    engine.add_module(llvm.parse_assembly(_LAST))
    engine.finalize_object()
    for kernel in kernels:
        kernel.take(_entered(kernel, codes[kernel.name]))
    return True


def _entered(kernel: Pending, code: Code) -> Linked:
    """Return a kernel whose machine code is linked."""
    engine = _engine()
    module, _, name = kernel.name.rpartition(".")
    environment = _functions.Environment(vars(sys.modules[module]))
    for symbol in code.environments:
        pointer = ctypes.c_void_p.from_address(engine.get_global_value_address(symbol))
        pointer.value = id(environment)
    entry = _functions.make_function(
        sys.modules[module],
        name,
        f"compiled wrapper for {name!r}",
        engine.get_function_address(code.symbol),
        environment,
        (environment,),
    )
    arguments, returned = cast(Any, sigutils).normalize_signature(kernel.signature)
    return Linked(returned(*arguments), entry, objectmode=False)


def _code(kernel: Pending) -> Code:
    cache = cast(Any, kernel.dispatcher)._cache
    payload = cache._cache_file.load(cache._index_key(kernel.signature, _context.codegen()))
    if payload is None:
        raise LookupError(f"{kernel.name}: it is not in numba's cache")
    (_, _, (text, _)), description, own, *_, beginnings, others = payload
    environments = {environment.env_name: environment for environment in (own, *others)}
    if beginnings or any(environment.consts for environment in environments.values()):
        raise LookupError(f"{kernel.name}: it needs more than its machine code")
    return Code(kernel.name, _stamp(kernel), description.llvm_cpython_wrapper_name, tuple(environments), text)


def _stamp(kernel: Pending) -> tuple[float, int]:
    return cast(Any, kernel.dispatcher)._cache._cache_file._source_stamp


def _platform() -> tuple[str, ...]:
    return (numba.__version__, sys.version, *map(str, _context.codegen().magic_tuple()))


def _engine() -> Any:
    return _context.codegen()._engine._ee
