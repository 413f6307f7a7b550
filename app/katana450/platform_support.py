"""Calls that exist only on some operating systems, each with its alternative on the others.

The rest of the package runs unchanged on Linux, macOS and Windows. ``tests/packaging`` checks
that no other module uses these calls.
"""

from __future__ import annotations

import os
import signal
import socket
import stat
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

if sys.platform != "win32":
    import fcntl
    import resource
else:
    import ctypes
    import msvcrt

PROMPT = -10
"""Niceness of a time-critical process, where the system allows it."""

BACKGROUND = 5
"""Niceness added to a process that can wait."""

NORMAL_CLASS, HIGH_CLASS, BELOW_NORMAL_CLASS = 0x20, 0x80, 0x4000
"""Priority classes of Windows."""

TIMER_MS = 1
"""[ms] Timer resolution of a time-critical process on Windows; the default there is 15.6."""


def raise_priority() -> None:
    """Give this process a high priority, where the system allows it."""
    if sys.platform == "win32":
        _set_priority_class(HIGH_CLASS)
        ctypes.windll.winmm.timeBeginPeriod(TIMER_MS)
    else:
        with suppress(PermissionError):
            os.setpriority(os.PRIO_PROCESS, 0, PROMPT)


def prefer_thread() -> None:
    """Give this thread the lowest real-time priority, on Linux, where the system allows it."""
    if sys.platform == "linux":
        # Some systems have no such priorities: musl, sandboxes.
        with suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(1))


def reset_priority() -> None:
    """Give this process the normal priority, where the system allows it."""
    if sys.platform == "win32":
        _set_priority_class(NORMAL_CLASS)
    else:
        # A person without rights cannot raise what was started by ``nice``.
        with suppress(PermissionError):
            os.setpriority(os.PRIO_PROCESS, 0, 0)


def lower_priority() -> None:
    """Give this process a lower priority than it has."""
    if sys.platform == "win32":
        _set_priority_class(BELOW_NORMAL_CLASS)
    else:
        os.nice(BACKGROUND)


def name_process(name: str) -> None:
    """Name this process for ``ps`` and ``top``, on Linux: at most 15 characters."""
    if sys.platform == "linux":
        with suppress(OSError):
            Path("/proc/self/comm").write_text(name, encoding="ascii")


def raise_open_file_limit(wanted: int) -> int | None:
    """Let this process open ``wanted`` files, or as many as the system allows.

    Returns:
        the number of files it may then open; None without a limit, as on Windows.
    """
    if sys.platform == "win32":
        return None
    else:  # noqa: RET505 - so that mypy follows either system
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        if soft == resource.RLIM_INFINITY:
            return None
        wanted = wanted if hard == resource.RLIM_INFINITY else min(hard, wanted)
        if soft < wanted:
            with suppress(OSError, ValueError):
                resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
                soft = wanted
        return soft


def limit_resources(memory: int, seconds: int) -> None:
    """Limit the memory [bytes] and the processor time [s] of this process.

    Windows limits neither, and macOS does not limit memory. The parent process must therefore
    limit the running time too.
    """
    if sys.platform != "win32":
        for name, maximum in (("RLIMIT_AS", memory), ("RLIMIT_CPU", seconds), ("RLIMIT_CORE", 0)):
            kind = getattr(resource, name, None)
            if kind is not None:
                _, hard = resource.getrlimit(kind)
                soft = maximum if hard == resource.RLIM_INFINITY else min(maximum, hard)
                # macOS refuses bounds below what the process has mapped.
                with suppress(ValueError, OSError):
                    resource.setrlimit(kind, (soft, hard))


def hanging_time(seconds: float) -> float:
    """Return the time [s] after which a process limited to ``seconds`` of processor time hangs.

    On a busy machine it takes longer than its processor time. On Windows nothing else limits it.
    """
    return seconds if sys.platform == "win32" else 8.0 * seconds


def stop_signals() -> list[signal.Signals]:
    """Return the signals that ask a process to end, from the terminal and from other programs."""
    names = ("SIGINT", "SIGTERM", "SIGBREAK")
    return [getattr(signal, name) for name in names if hasattr(signal, name)]


@contextmanager
def stop_signals_blocked() -> Iterator[None]:
    """Keep ``stop_signals`` from the processes that are started in the block.

    They take effect there after ``unblock_stop_signals``, and here after the block. Windows has no
    such call.
    """
    if sys.platform == "win32":
        yield
    else:
        before = signal.pthread_sigmask(signal.SIG_BLOCK, stop_signals())
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def unblock_stop_signals() -> None:
    """Let ``stop_signals`` take effect in this process."""
    if sys.platform != "win32":
        signal.pthread_sigmask(signal.SIG_UNBLOCK, stop_signals())


def without_interrupts() -> dict[str, Any]:
    """Return arguments of Popen for a process that does not receive Ctrl-C of the terminal."""
    if sys.platform == "win32":
        return {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
    else:  # noqa: RET505 - so that mypy follows either system
        return {"start_new_session": True}


def pipe_address(folder: Path, name: str) -> str:
    """Return the address of a listener for processes of this user, in the private ``folder``."""
    if sys.platform == "win32":
        return rf"\\.\pipe\{folder.name}-{name}"
    else:  # noqa: RET505 - so that mypy follows either system
        return str(folder / name)


def claim_port(sock: socket.socket) -> None:
    """Let ``sock`` bind a port whose last connections are closing, but no port that is in use."""
    if sys.platform == "win32":
        # On Windows SO_REUSEADDR would take the port from the program that listens on it.
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_EXCLUSIVEADDRUSE, 1)
    else:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)


def readable_by_others(about: os.stat_result) -> bool:
    """Return whether other users can read a file, by its mode.

    Always False on Windows, where the mode does not show it. The home folder of a user is closed
    to other users there.
    """
    return sys.platform != "win32" and bool(stat.S_IMODE(about.st_mode) & 0o077)


def create_file(path: Path, mode: int) -> int:
    """Create ``path`` for writing bytes and return its descriptor.

    Args:
        path: the new file.
        mode: its permissions, reduced by the umask; no effect on Windows.

    Raises:
        OSError: the file exists already or cannot be created.
    """
    return open_bytes(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)


def open_bytes(path: Path, flags: int, mode: int) -> int:
    """Open ``path`` as ``os.open`` does, for bytes. Raises OSError."""
    # Windows replaces line ends in a descriptor that is not binary.
    binary: int = getattr(os, "O_BINARY", 0)
    return os.open(path, flags | binary, mode)


def claim_file(descriptor: int) -> None:
    """Claim an open file for this process until it closes it or ends.

    Raises OSError if another process has claimed it.
    """
    if sys.platform == "win32":
        # The lock covers a byte far beyond the content, which others may read.
        position = os.lseek(descriptor, 0, os.SEEK_CUR)
        os.lseek(descriptor, 1 << 30, os.SEEK_SET)
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        os.lseek(descriptor, position, os.SEEK_SET)
    else:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def state_folder() -> Path:
    """Return the folder in which programs of this user keep their logs; it need not exist."""
    return _user_folder("XDG_STATE_HOME", ".local/state", "Application Support", "")


def cache_folder() -> Path:
    """Return the folder for what programs of this user can compute again; it need not exist."""
    return _user_folder("XDG_CACHE_HOME", ".cache", "Caches", "Cache")


def _user_folder(variable: str, default: str, darwin: str, windows: str) -> Path:
    """Return the folder named by ``variable``, or else the one of this system."""
    if sys.platform == "win32":
        local = os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local"
        return Path(local, windows)
    elif sys.platform == "darwin":  # noqa: RET505 - so that mypy follows either system
        return Path.home() / "Library" / darwin
    else:
        named = Path(os.environ.get(variable, ""))
        # The standard of these folders demands that a relative path is ignored.
        return named if named.is_absolute() else Path.home() / default


def only_this_user_writes(folder: Path) -> bool:
    """Return whether nobody but this user, and root, may write to ``folder`` or replace it.

    So the folders above it count too, and a missing one is as safe as these. On Windows the folders
    of a user are protected by inheritance, and the answer is always true. Raises OSError.
    """
    if sys.platform == "win32":
        return True
    else:  # noqa: RET505 - so that mypy follows either system
        for part in (folder, *folder.parents):
            if not part.exists():
                continue
            status = part.stat()
            writers = status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
            # In a folder above it like /tmp, nobody may replace what belongs to others.
            shared = writers and (part == folder or not status.st_mode & stat.S_ISVTX)
            if status.st_uid not in (os.getuid(), 0) or shared:
                return False
        return True


def _set_priority_class(priority: int) -> None:
    if sys.platform == "win32":
        kernel = ctypes.windll.kernel32
        # GetCurrentProcess returns the handle -1, which is as wide as a pointer.
        kernel.SetPriorityClass(ctypes.c_void_p(-1), priority)
