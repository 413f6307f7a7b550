"""Calls that exist only on some systems are in one module, and their alternatives work."""

from __future__ import annotations

import ast
import errno
import os
import re
import signal
import socket
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import katana450
from katana450 import platform_support
from tests.commands import output

APP = Path(katana450.__file__).parent
ALLOWED = {
    "platform_support.py": None,
    # Calls a library that each system has.
    "maths/collision/engine.py": {"ctypes"},
    # Queries the kernel about one socket, and has an answer for systems without that call.
    "arm/runtime/readiness.py": {"TCP_INFO", "poll", "POLLIN", "POLLOUT"},
    # Asks a library of numpy and the system what they are, and reports "unknown" without an answer.
    "extensions/recording/files/header.py": {"ctypes", "/proc/cpuinfo"},
}
MODULES = {"curses", "fcntl", "grp", "msvcrt", "pty", "pwd", "resource", "syslog", "termios", "tty"}
MODULES |= {"ctypes", "winreg", "_winapi"}
NAMES = {
    "O_BINARY",
    "O_NOFOLLOW",
    "POLLIN",
    "POLLOUT",
    "SO_EXCLUSIVEADDRUSE",
    "SO_REUSEADDR",
    "SO_REUSEPORT",
    "TCP_INFO",
    "AF_UNIX",
    "add_reader",
    "add_signal_handler",
    "add_writer",
    "chown",
    "creationflags",
    "epoll",
    "fork",
    "forkserver",
    "getloadavg",
    "getrlimit",
    "geteuid",
    "getuid",
    "killpg",
    "kqueue",
    "mkfifo",
    "nice",
    "poll",
    "preexec_fn",
    "sched_getaffinity",
    "sched_setaffinity",
    "sched_setscheduler",
    "sched_param",
    "setpriority",
    "setsid",
    "start_new_session",
    "symlink_to",
    "uname",
    "windll",
}
PATHS = ("/tmp", "/proc", "/dev", "/etc")
WORDS = re.compile("|".join(sorted(MODULES | NAMES | {"signal", *PATHS})))
"""Text without any of them uses no such call."""

SIGNALS = {"SIGINT", "SIG_IGN", "signal"}
"""Attributes of the module ``signal`` that every system has."""


def used_names(source: str) -> Iterator[str]:
    """Yield the modules, names and paths in ``source`` that exist only on some systems."""
    for node in ast.walk(ast.parse(source)) if WORDS.search(source) else ():
        match node:
            case ast.Import(names=names):
                yield from MODULES & {name.name.partition(".")[0] for name in names}
            case ast.ImportFrom(module=str(module)):
                yield from MODULES & {module.partition(".")[0]}
            case ast.Attribute(value=ast.Name(id="signal"), attr=attr) if attr not in SIGNALS:
                yield attr
            case ast.Attribute(value=ast.Name(id="self")):
                continue
            # Other things than select and os have methods of these names.
            case ast.Attribute(value=value, attr="poll" | "fork") if ast.unparse(value) not in (
                "select",
                "os",
            ):
                continue
            case ast.Attribute(attr=attr) if attr in NAMES:
                yield attr
            case ast.keyword(arg=str(arg)) if arg in NAMES:
                yield arg
            case ast.Constant(value=str(text)) if text in NAMES - {"fork", "poll", "nice"}:
                yield text
            case ast.Constant(value=str(text)) if text.startswith(PATHS):
                yield text


def test_one_module_makes_calls_that_only_some_systems_have() -> None:
    for path in sorted(APP.rglob("*.py")):
        allowed = ALLOWED.get(path.relative_to(APP).as_posix(), set())
        if allowed is not None:
            names = set(used_names(path.read_text(encoding="utf-8")))
            assert names <= allowed, f"{path}: put this into platform_support.py"


@pytest.fixture
def windows(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, tuple[Any, ...]]]:
    """Pretend to be Windows; return the recorded calls of its libraries, with arguments."""
    calls: list[tuple[str, tuple[Any, ...]]] = []

    class Library:
        def __getattr__(self, name: str) -> Any:
            return lambda *words: calls.append((name, words))

    library = SimpleNamespace(kernel32=Library(), winmm=Library())
    loaded = SimpleNamespace(windll=library, c_void_p=lambda value: value)
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(platform_support, "ctypes", loaded, raising=False)
    monkeypatch.delattr(platform_support, "resource", raising=False)
    monkeypatch.delattr(os, "setpriority", raising=False)
    monkeypatch.setattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0x200, raising=False)
    return calls


def test_priorities_on_windows(windows: list[tuple[str, tuple[Any, ...]]]) -> None:
    platform_support.raise_priority()
    platform_support.reset_priority()
    platform_support.lower_priority()
    assert windows == [
        ("SetPriorityClass", (-1, platform_support.HIGH_CLASS)),
        ("timeBeginPeriod", (1,)),
        ("SetPriorityClass", (-1, platform_support.NORMAL_CLASS)),
        ("SetPriorityClass", (-1, platform_support.BELOW_NORMAL_CLASS)),
    ]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has classes of priority")
def test_process_that_was_started_by_nice_keeps_its_priority() -> None:
    program = (
        "import os; from katana450.platform_support import reset_priority; os.nice(5); "
        "os.geteuid() or os.setuid(65534); reset_priority(); print(os.getpriority(0, 0))"
    )
    assert int(output([sys.executable, "-c", program])) > 0


@pytest.mark.skipif(
    sys.platform != "linux", reason="only Linux has real-time priorities of threads"
)
def test_thread_keeps_its_priority_where_none_is_allowed() -> None:
    program = (
        "import os, resource; from katana450.platform_support import prefer_thread; "
        "resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0)); os.geteuid() or os.setuid(65534); "
        "prefer_thread(); print(os.sched_getscheduler(0) == os.SCHED_OTHER)"
    )
    assert output([sys.executable, "-c", program]) == "True\n"


@pytest.mark.skipif(
    sys.platform != "linux", reason="only Linux has real-time priorities of threads"
)
def test_system_without_real_time_priorities_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(*_: object) -> None:
        raise OSError(errno.ENOSYS, "Function not implemented")

    monkeypatch.setattr(os, "sched_setscheduler", missing)
    platform_support.prefer_thread()


@pytest.mark.usefixtures("windows")
def test_windows_has_no_limits() -> None:
    platform_support.limit_resources(1, 1)
    assert platform_support.raise_open_file_limit(10**9) is None


@pytest.mark.usefixtures("windows")
def test_windows_keeps_the_terminal_from_a_process() -> None:
    assert platform_support.without_interrupts() == {"creationflags": 0x200}


@pytest.mark.usefixtures("windows")
def test_windows_claims_a_port_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socket, "SO_EXCLUSIVEADDRUSE", -5, raising=False)
    options: list[tuple[int, int, int]] = []
    platform_support.claim_port(
        SimpleNamespace(setsockopt=lambda *words: options.append(words))  # type: ignore[arg-type]
    )
    assert options == [(socket.SOL_SOCKET, -5, 1)]


def test_modes_of_windows_never_show_other_readers(
    tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    path = tmp_path / "links.json"
    path.touch()
    path.chmod(0o644)
    about = path.stat()
    if sys.platform != "win32":
        assert platform_support.readable_by_others(about)
    request.getfixturevalue("windows")
    assert not platform_support.readable_by_others(about)


def test_files_are_created_as_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened_flags: list[int] = []
    create = os.open

    def opened(path: Path, flags: int, mode: int) -> int:
        opened_flags.append(flags)
        return create(path, flags & ~(1 << 20), mode)

    monkeypatch.setattr(os, "O_BINARY", 1 << 20, raising=False)
    monkeypatch.setattr(os, "open", opened)
    path = tmp_path / "file"
    os.close(platform_support.create_file(path, 0o600))
    assert opened_flags[0] & (1 << 20)
    if sys.platform != "win32":
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
    with pytest.raises(FileExistsError):
        platform_support.create_file(path, 0o600)


def test_stop_signals_are_those_of_the_system(monkeypatch: pytest.MonkeyPatch) -> None:
    assert set(platform_support.stop_signals()) >= {signal.SIGINT, signal.SIGTERM}
    monkeypatch.setattr(signal, "SIGBREAK", 21, raising=False)
    assert 21 in platform_support.stop_signals()
