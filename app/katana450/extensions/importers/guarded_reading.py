"""Reading of an untrusted shape file in a disposable subprocess."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from katana450.disk_cache import decoded
from katana450.errors import InputError
from katana450.extensions.convex_body import ConvexBody
from katana450.extensions.importers.archive import ChoiceError, is_inside, packed
from katana450.extensions.importers.formats.shape_file import (
    MAX_FILE_BYTES,
    MAX_MEMORY_BYTES,
    SECONDS,
    Format,
    ShapeFile,
    Up,
    check_file,
    label,
)
from katana450.maths.planning.checkpoint import checkpoint
from katana450.platform_support import hanging_time

CHECK_EVERY = 0.1
"""[s] Interval at which a cancellation is checked."""

MAX_PASSES = 8
"""Maximum number of readings of a file whose companions name further files."""

MAX_COMPANIONS = 500
"""Maximum number of files that a file may name."""


@dataclass(frozen=True, eq=False)
class ShapeReading:
    """The answer of the subprocess.

    Attributes:
        shape, body: the shape and its convex body; None if the file is refused.
        error: the reason for that.
        choices: paths of shape files, one of which must be chosen.
        missing: paths of files that are named and not there.
    """

    shape: ShapeFile | None = None
    body: ConvexBody | None = None
    error: str = ""
    choices: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()


ReadCompanion = Callable[[str, int], bytes | None]
"""A function that returns the content of a file by its path in the folder of the shape file, up to
one byte more than a maximum; None if it is not there.
"""


def read_shape_guarded(
    data: bytes,
    format: Format,
    name: str,
    unit: float | None = None,
    up: Up | None = None,
    *,
    main: str = "",
    companion: ReadCompanion | None = None,
) -> tuple[ShapeFile, ConvexBody]:
    """Return the result of `read_shape`, and its convex body, from a subprocess.

    The subprocess has `SECONDS` of processor time and, where the system supports it,
    `MAX_MEMORY_BYTES`. ``companion`` is asked for the files that the file names; their paths never
    lead out of its folder. Then the file is read again with them. Raises InputError as
    `read_shape`, at these limits, and after a crash; and the error of a `checkpoint`, which ends
    the subprocess.
    """
    file = label(name)
    check_file(data, file, unit, format)
    words = ["" if unit is None else str(float(unit)), "" if up is None else up.value]
    own = Path(name.replace("\\", "/")).name or f"shape.{format.value}"
    companions: dict[str, bytes] = {}
    answer = _parsed(data, [format.value, file, *words, main], file)
    # What a .zip names is in it.
    for _ in range(0 if format is Format.ZIP else MAX_PASSES):
        left = MAX_FILE_BYTES - len(data) - sum(map(len, companions.values()))
        more = _companions(answer, companion, companions.keys() | {own}, file, left)
        if not more:
            break
        companions |= more
        bundle = packed(own, {own: data} | companions)
        answer = _parsed(bundle, [Format.ZIP.value, file, *words, own], file)
    if answer.choices:
        raise ChoiceError(answer.error, answer.choices)
    if answer.shape is None or answer.body is None:
        raise InputError(answer.error)
    return answer.shape, answer.body


def _companions(
    answer: ShapeReading, companion: ReadCompanion | None, known: set[str], file: str, left: int
) -> dict[str, bytes]:
    """Return those files beside a file that it names and that are not ``known`` yet.

    Raises InputError once they have more than ``left`` bytes; no further one is then read.
    """
    if companion is None:
        return {}
    paths = [path for path in answer.missing if is_inside(path) and path not in known]
    if len(paths) + len(known) > MAX_COMPANIONS:
        raise InputError(f"{file} names more than {MAX_COMPANIONS} other files.")
    contents: dict[str, bytes] = {}
    for path in paths:
        content = companion(path, left)
        if content is None:
            continue
        contents[path] = content
        left -= len(content)
        if left < 0:
            raise InputError(
                f"{file} and the files that it names have over {MAX_FILE_BYTES // 1_000_000} MB."
            )
    return contents


def _parsed(data: bytes, words: list[str], file: str) -> ShapeReading:
    """Return the answer of a new subprocess that reads ``data``."""
    # One thread, because a pool for every core would take address space, which is limited.
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    with subprocess.Popen(
        [sys.executable, "-m", "katana450.extensions.importers.reading", *words],
        # The parent folder of the package.
        cwd=Path(__file__).resolve().parents[3],
        env=environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    ) as process:
        try:
            output = _output(process, data, file)
        except BaseException:
            process.kill()
            raise
    if process.returncode:
        raise InputError(
            f"{file} cannot be read: it needs more than {SECONDS:g} s of processor time or "
            f"{MAX_MEMORY_BYTES >> 20} MiB, or the file is corrupt. Try a simpler export."
        )
    return decoded(output, ShapeReading)


def _output(process: subprocess.Popen[bytes], data: bytes, file: str) -> bytes:
    """Return the output of ``process`` for ``data``. Raises InputError if it hangs."""
    # communicate() sends no further input after a timeout, so a separate thread sends all of it.
    threading.Thread(target=_send, args=(process.stdin, data), daemon=True).start()
    process.stdin = None
    limit = hanging_time(SECONDS)
    due = time.monotonic() + limit
    while True:
        checkpoint()
        try:
            return process.communicate(timeout=CHECK_EVERY)[0]
        except subprocess.TimeoutExpired as error:
            if time.monotonic() > due:
                raise InputError(
                    f"{file} takes longer than {limit:g} s to read. Try a simpler export."
                ) from error


def _send(pipe: IO[bytes], data: bytes) -> None:
    # A process that has ended reads nothing.
    with suppress(OSError), pipe:
        pipe.write(data)
