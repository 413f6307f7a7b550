"""Reading and atomic writing of files: each one is written completely or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import BinaryIO

from katana450.errors import InputError
from katana450.platform_support import create_file

Writer = Callable[[BinaryIO], object]


def bytes_of(path: Path, maximum: int = -1) -> bytes:
    """Return the file at ``path``, or with a ``maximum`` up to one byte more than that.

    Raises InputError.
    """
    try:
        with path.open("rb") as file:
            return file.read(-1 if maximum < 0 else maximum + 1)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from error


def writer_of(content: bytes) -> Writer:
    """Return a writer of the bytes ``content``."""
    return lambda file: file.write(content)


def write_files(writers: Mapping[Path, Writer], mode: int = 0o666) -> None:
    """Write all files to temporary files, then move them to their paths, over existing files.

    An error while writing leaves the old files unchanged.

    Args:
        writers: the writer of the content of each path.
        mode: permissions of the new files, reduced by the umask.

    Raises:
        InputError: a file cannot be written.
    """
    with ExitStack() as stack:
        written: list[tuple[Path, Path]] = []
        for path, write in writers.items():
            try:
                temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
                stack.callback(temporary.unlink, missing_ok=True)
                with os.fdopen(create_file(temporary, mode), "wb") as file:
                    write(file)
                    file.flush()
                    os.fsync(file.fileno())
            except OSError as error:
                raise _refusal(path, error) from error
            written.append((temporary, path))
        for temporary, path in written:
            try:
                temporary.replace(path)
            except OSError as error:
                raise _refusal(path, error) from error


def check_writable(path: Path) -> None:
    """Raise InputError if no file can be created at `path`; call it before a long computation."""
    if path.is_dir():
        raise InputError(f"{path} is a directory; name a file.")
    if not path.parent.is_dir():
        raise InputError(f"There is no directory {path.parent}; create it, or name another file.")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"The directory {path.parent} is not writable.")


def _refusal(path: Path, error: OSError) -> InputError:
    return InputError(f"{path} cannot be written: {error.strerror or error}.")
