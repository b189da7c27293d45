"""Where the compiled kernels are kept, and how they come to be there.

Compiling takes tens of seconds and must happen once: at installation, not at the first start of a vehicle.
The cache lies in a folder whose name is a digest of what the machine code depends on (the kernels' sources,
the compiler, the processor), so that a new version or a moved disk never meets code that is not its own.
"""

from __future__ import annotations

import hashlib
import os
import platform
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from service import machine_code

_KEPT = 3
"""How many digests a cache keeps: the newest, and those of two other versions that may still be in use."""

_DAEMON = ("service.estimator",)
"""What the loop imports; its kernels come with it."""

_NEEDLESS = ("scipy.linalg", "coverage")
"""What numba imports if it is there, and no kernel uses: linear algebra, and a tool of its own developers. It takes a
fifth of a start."""

_KERNEL = re.compile(rb"(?m)^@(kernel|function|part)\b")
_IMPORT = re.compile(r"(?m)^from (filters(?:\.\w+)*) import (\([^)]*\)|.*)")

Progress = Callable[[str, int, int], None]
"""Called with the name of a kernel, how many are done, and how many there are."""


def _processor() -> str:
    """Return what tells processors apart whose machine code differs."""
    wanted = ("model name", "flags", "Features", "CPU part")
    try:
        lines = (
            Path("/proc/cpuinfo")
            .read_text(encoding="utf-8", errors="replace")
            .split("\n\n", 1)[0]
            .splitlines()
        )
    except OSError:
        lines = []
    return platform.machine() + "\n".join(line for line in lines if line.startswith(wanted))


def _imported(source: bytes, folder: Path) -> Iterator[Path]:
    """Return the files of ``filters`` that a source imports from; by its text, for parsing costs a start 0.1 s."""
    for module, names in _IMPORT.findall(source.decode()):
        for name in (module, *(f"{module}.{name}" for name in re.findall(r"\w+", names))):
            path = folder.joinpath(*name.split(".")[1:])
            yield path / "__init__.py"
            if path != folder:
                yield path.with_suffix(".py")


def _sources() -> dict[str, bytes]:
    """Return what the machine code is made of: the files that hold kernels, and what they import.

    A filter that only calls kernels may change without their being compiled anew.
    """
    # found without importing it: once imported, its kernels have chosen their cache
    found = find_spec("filters")
    folder = Path(str(found.origin)).parent if found and found.origin else Path()
    wanted = [path for path in folder.rglob("*.py") if _KERNEL.search(path.read_bytes())]
    sources: dict[str, bytes] = {}
    while wanted:
        path = wanted.pop()
        name = path.relative_to(folder).as_posix()
        if name not in sources and path.is_file():
            sources[name] = path.read_bytes()
            wanted += _imported(sources[name], folder)
    return dict(sorted(sources.items()))


def digest() -> str:
    """Return 12 hexadecimal digits for the kernels' sources, the compiler and the processor."""
    total = hashlib.sha256()
    for name, source in _sources().items():
        total.update(name.encode() + b"\0" + source)
    for fact in (
        version("numba"),
        version("llvmlite"),
        version("numpy"),
        platform.python_version(),
        _processor(),
    ):
        total.update(fact.encode() + b"\0")
    return total.hexdigest()[:12]


def _places() -> Iterator[Path]:
    """Return the folders that may hold the cache, best first."""
    granted = os.environ.get("CACHE_DIRECTORY")  # systemd's CacheDirectory=, a list with colons
    if granted:
        yield Path(granted.split(":")[0])
    shared = os.environ.get("XDG_CACHE_HOME")
    if shared:
        yield Path(shared) / "beliefd"
    home = Path("~").expanduser()
    if home.is_absolute():
        yield home / ".cache" / "beliefd"
    yield Path(tempfile.gettempdir()) / f"beliefd-{os.getuid()}"


def _made(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK) and folder.stat().st_uid == os.getuid()


def prepare() -> Path:
    """Choose the folder of the compiled kernels and tell numba, before anything imports ``filters``.

    Returns
    -------
    Path
        The folder. Processes started from here inherit it. A ``NUMBA_CACHE_DIR`` that is set already stands.

    Raises
    ------
    RuntimeError
        numba is already imported, and would not see it.
    OSError
        No folder can be written to.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen:
        return Path(chosen)
    if "numba" in sys.modules:
        raise RuntimeError("service.kernels.prepare() must run before numba is imported")
    name = f"kernels-{digest()}"
    for place in _places():
        folder = place / name
        if _made(folder):
            os.environ["NUMBA_CACHE_DIR"] = str(folder)
            return folder
    raise OSError("no folder for the compiled kernels: set CACHE_DIRECTORY to one that can be written to")


def _prune(folder: Path) -> None:
    """Remove the caches of older versions beside ``folder``."""
    if not folder.name.startswith("kernels-"):
        return
    caches = sorted(folder.parent.glob("kernels-*"), key=lambda path: path.stat().st_mtime, reverse=True)
    for stale in caches[_KEPT:]:
        if stale != folder:
            shutil.rmtree(stale, ignore_errors=True)


def warm(progress: Progress) -> Path:
    """Compile the kernels of the daemon that are not in the cache yet; return the cache's folder."""
    return _warm(lambda: _DAEMON, progress)


def warm_all(progress: Progress) -> Path:
    """Compile every kernel of ``filters``, also of the ones that the daemon does not run."""
    return _warm(_every_module, progress)


def _every_module() -> Sequence[str]:
    from filters.kernels import every_module

    return every_module()


@contextmanager
def _without(names: Sequence[str]) -> Generator[None]:
    """Have an import of these packages fail, unless they are there already."""
    hidden = [name for name in names if name not in sys.modules]
    sys.modules.update(dict.fromkeys(hidden))  # pyright: ignore[reportCallIssue, reportArgumentType]
    try:
        yield
    finally:
        for name in hidden:
            if sys.modules.get(name) is None:
                sys.modules.pop(name, None)


def _warm(modules: Callable[[], Sequence[str]], progress: Progress) -> Path:
    folder = prepare()
    with _without(_NEEDLESS):
        from filters.kernels import compile_all, gather

        kernels = gather(modules())
        linked = machine_code.link(folder, kernels)
        compile_all((), progress)  # those that are not linked
        if kernels and not linked:
            machine_code.keep(folder, kernels)
    os.utime(folder)
    _prune(folder)
    return folder
