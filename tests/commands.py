"""Commands that tests start and wait for."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def completed(
    command: Sequence[str | Path],
    *,
    cwd: Path = ROOT,
    text: str | None = None,
    env: Mapping[str, str] | None = None,
    seconds: float = 60.0,
) -> subprocess.CompletedProcess[str]:
    """Run ``command`` to its end in the folder ``cwd``; return its status and what it printed.

    Args:
        command: its words.
        cwd: the folder in which it is started.
        text: what it reads from its standard input.
        env: variables beside those of this process.
        seconds: timeout. Raises TimeoutExpired after it.
    """
    return subprocess.run(
        command,
        cwd=cwd,
        input=text,
        env=os.environ | dict(env or {}),
        capture_output=True,
        text=True,
        timeout=seconds,
        check=False,
    )


def output(
    command: Sequence[str | Path],
    *,
    cwd: Path = ROOT,
    text: str | None = None,
    env: Mapping[str, str] | None = None,
    seconds: float = 60.0,
) -> str:
    """Return what ``command`` prints; it has to succeed. The arguments are those of completed."""
    done = completed(command, cwd=cwd, text=text, env=env, seconds=seconds)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def modules_after(code: str, cwd: Path = ROOT) -> set[str]:
    """Return the names of all modules that a fresh process has loaded after ``code``."""
    return set(
        output([sys.executable, "-c", f"{code}; import sys; print(*sys.modules)"], cwd=cwd).split()
    )
