"""Reading of an untrusted shape file in a disposable subprocess.

`read_shape_guarded` starts this module with the words FORMAT NAME UNIT UP MAIN. The subprocess
limits its memory and time before it reads the file from standard input, and writes a
``ShapeReading``.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from katana450.disk_cache import decoded, encoded
from katana450.errors import InputError, KatanaError
from katana450.extensions.convex_body import ConvexBody, convex_body
from katana450.extensions.importers.archive import ChoiceError
from katana450.extensions.importers.formats.shape_file import (
    MAX_MEMORY_BYTES,
    SECONDS,
    Format,
    ShapeFile,
    Up,
    check_file,
    label,
    read_shape,
)
from katana450.maths.planning.checkpoint import checkpoint
from katana450.platform_support import hanging_time, limit_resources

CHECK_EVERY = 0.1
"""[s] Interval at which a cancellation is checked."""


@dataclass(frozen=True, eq=False)
class ShapeReading:
    """The answer of the subprocess.

    Attributes:
        shape, body: the shape and its convex body; None if the file is refused.
        error: the reason for that.
        choices: paths of shape files, one of which must be chosen.
    """

    shape: ShapeFile | None = None
    body: ConvexBody | None = None
    error: str = ""
    choices: tuple[str, ...] = ()


def read_shape_guarded(
    data: bytes,
    format: Format,
    name: str,
    unit: float | None = None,
    up: Up | None = None,
    *,
    main: str = "",
) -> tuple[ShapeFile, ConvexBody]:
    """Return the result of `read_shape`, and its convex body, from a subprocess.

    The subprocess has `SECONDS` of processor time and, where the system supports it,
    `MAX_MEMORY_BYTES`. Raises InputError as `read_shape`, at these limits, and after a crash; and
    the error of a `checkpoint`, which ends the subprocess.
    """
    file = label(name)
    check_file(data, file, unit, format)
    words = ["" if unit is None else str(float(unit)), "" if up is None else up.value]
    answer = _parsed(data, [format.value, file, *words, main], file)
    if answer.choices:
        raise ChoiceError(answer.error, answer.choices)
    if answer.shape is None or answer.body is None:
        raise InputError(answer.error)
    return answer.shape, answer.body


def _parsed(data: bytes, words: list[str], file: str) -> ShapeReading:
    """Return the answer of a new subprocess that reads ``data``."""
    # One thread, because a pool for every core would take address space, which is limited.
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    with subprocess.Popen(
        [sys.executable, "-m", "katana450.extensions.importers.guarded_reading", *words],
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


def bind() -> None:
    """Limit the memory and time of this process, as far as the system supports it."""
    limit_resources(MAX_MEMORY_BYTES, round(SECONDS))


def answer(
    data: bytes, format: Format, name: str, unit: float | None, up: Up | None, main: str
) -> ShapeReading:
    """Return the answer for a file; arguments as those of `read_shape`."""
    try:
        shape = read_shape(data, format, name, unit, up, main=main)
        body = convex_body(shape.vertices * shape.scale).scaled(1.0 / shape.scale)
    except KatanaError as error:
        choices = error.choices if isinstance(error, ChoiceError) else ()
        return ShapeReading(error=str(error), choices=choices)
    return ShapeReading(shape, body)


def main(arguments: list[str]) -> None:
    """Read one file. The process fails only at the limits of memory and time."""
    bind()
    format, name, unit, up, chosen = arguments
    reading = answer(
        sys.stdin.buffer.read(),
        Format(format),
        name,
        float(unit) if unit else None,
        Up(up) if up else None,
        chosen,
    )
    sys.stdout.buffer.write(encoded(reading))


if __name__ == "__main__":
    main(sys.argv[1:])
