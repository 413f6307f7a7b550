"""Processes that expand xacro, forked from one that has loaded it instead of started."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from contextlib import redirect_stdout
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from katana450.extensions.xacro import xacro_process

FORKS = get_context("forkserver")
FORKS.set_forkserver_preload([__name__])


def _expand(answer: Connection, words: list[str], environment: dict[str, str], path: str) -> None:
    """Do what the module does as a program, with the variables and modules of that."""
    os.environ.clear()
    os.environ.update(environment)
    sys.path[0:] = [path, *(folder for folder in sys.path if "site-packages" in folder)]
    xacro_process.HOME = Path(os.path.expanduser("~")).resolve()
    printed = io.StringIO()
    with redirect_stdout(printed):
        xacro_process.main(Path(words[0]), dict(word.split(":=", 1) for word in words[1:]))
    answer.send_bytes(printed.getvalue().encode())


def run_forked(
    command: list[str], *, cwd: Path, env: dict[str, str], **_: Any
) -> subprocess.CompletedProcess[bytes]:
    """Return what ``subprocess.run`` does, 0.2 s of processor time earlier."""
    assert command[2] == xacro_process.__name__
    answer, end = FORKS.Pipe(duplex=False)
    process = FORKS.Process(target=_expand, args=(end, command[3:], env, str(cwd)))
    process.start()
    end.close()
    output = b""
    try:
        output = answer.recv_bytes()
    except EOFError:
        assert process.exitcode != 0
    process.join()
    return subprocess.CompletedProcess(command, process.exitcode or 0, output, b"")
