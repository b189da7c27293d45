"""What makes a Linux process punctual: memory that stays, a processor at once, no collection of garbage.

Each permission may be missing (an ordinary user, a container). Then the process runs on without it, and says
in one line what was refused and what would grant it.
"""

from __future__ import annotations

import ctypes
import gc
import os
import resource
import signal
from collections.abc import Iterable
from pathlib import Path

_LIBC = ctypes.CDLL(None, use_errno=True)

# <linux/prctl.h>, <bits/mman-linux.h>, <malloc.h>, <linux/capability.h>
_PR_SET_PDEATHSIG = 1
_PR_SET_TIMERSLACK = 29
_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_CAP_IPC_LOCK = 14
_KEPT_BYTES = 256 * 1024 * 1024


def die_with_parent(parent: int) -> None:
    """Have the kernel kill this process when the one that started it ends, however it ends.

    Parameters
    ----------
    parent : int
        Process number of the starter: when it is gone already, this process exits here.
    """
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:
        raise SystemExit(f"the supervisor ({parent}) ended before this process had started")


def freeze_garbage() -> None:
    """Collect once, take everything alive out of the collector's sight, and switch it off."""
    gc.collect()
    gc.freeze()
    gc.disable()


def punctual(priority: int, cpus: Iterable[int]) -> list[str]:
    """Lock memory, sharpen the timer, and take the priority and the processors asked for.

    Parameters
    ----------
    priority : int
        SCHED_FIFO priority; 0: ordinary scheduling.
    cpus : Iterable[int]
        Processors to stay on; none: all.

    Returns
    -------
    list[str]
        One line for everything that was refused: what, why, and what would grant it.
    """
    _LIBC.prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    refusals = (_lock_memory(), _bind(frozenset(cpus)), _schedule(priority))
    return [refusal for refusal in refusals if refusal]


def _lock_memory() -> str:
    """Keep what has been touched in memory; what is mapped but never used (most of LLVM) is not pulled in."""
    _LIBC.mallopt(_M_TRIM_THRESHOLD, _KEPT_BYTES)
    _LIBC.mallopt(_M_MMAP_THRESHOLD, _KEPT_BYTES)
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    # Under a finite limit locking may succeed now and fail an allocation later: not worth it.
    if limit != resource.RLIM_INFINITY and not _capable(_CAP_IPC_LOCK):
        return (
            f"memory is not locked: limited to {limit // 1024} KiB; LimitMEMLOCK=infinity (systemd) "
            "or ulimit -l unlimited would allow it"
        )
    if _LIBC.mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT):
        return f"memory is not locked: {os.strerror(ctypes.get_errno())}"
    return ""


def _bind(cpus: frozenset[int]) -> str:
    if not cpus:
        return ""
    try:
        os.sched_setaffinity(0, cpus)
    except OSError as error:
        there = sorted(os.sched_getaffinity(0))
        return f"loop.cpus {sorted(cpus)}: {error.strerror}; processors to choose from: {there}"
    return ""


def _schedule(priority: int) -> str:
    if not priority:
        return ""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        return (
            f"loop.priority {priority}: {error.strerror}; LimitRTPRIO={priority} (systemd) or "
            f"ulimit -r {priority} would allow it"
        )
    return ""


def _capable(capability: int) -> bool:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("CapEff:"):
            return bool(int(line.split()[1], 16) >> capability & 1)
    return False
