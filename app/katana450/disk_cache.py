"""Values that take long to compute, kept in files of this user between starts.

Reading a robot imports trimesh, which takes longer than everything else at the
start of a server. A value that is kept needs neither.

A file is found by a hash of the inputs, of the version of Python and the libraries, and of the size
and time of every file of this package, so an old value is never used. Its content begins with its
own hash: a damaged file counts as missing. It holds plain values and arrays in MessagePack, which
can run no code when they are read. Where nothing can be written, or where others can, each start
computes the values.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import msgspec

from katana450.atomic import write_files, writer_of
from katana450.errors import InputError
from katana450.platform_support import cache_folder, only_this_user_writes

if TYPE_CHECKING:
    import numpy as np

T = TypeVar("T")

MAX_FILES = 500
"""Number of files after which those that were not used for longest are deleted."""

LIBRARIES = ("mujoco_core", "numpy", "trimesh", "yourdfpy")
"""Libraries whose version may change a value."""

HASH_LENGTH = hashlib.sha256().digest_size


def kept(make: Callable[[], T], kind: type[T], *inputs: bytes | str | np.ndarray[Any, Any]) -> T:
    """Return the value of ``make``, from the disk if it was computed before from ``inputs``.

    Args:
        make: computes the value, which depends on ``inputs`` alone. Its name is part of the hash.
        kind: type of the value: plain values, arrays and paths, alone and in data classes, named
            tuples, tuples, lists and dictionaries.
        inputs: everything on which the value depends.
    """
    folder = _folder()
    if folder is None:
        return make()
    name = f"{make.__module__}.{make.__qualname__}"
    file = folder / _digest((_surroundings(), name, *inputs)).hex()
    with suppress(OSError, DamagedError):
        stored: T = _loaded(file.read_bytes(), kind)
        with suppress(OSError):
            os.utime(file)
        return stored
    value = make()
    with suppress(OSError, InputError):
        _store(file, value)
    return value


class DamagedError(Exception):
    """Bytes that do not hold the value."""


def _digest(parts: Iterable[bytes | str | np.ndarray[Any, Any]]) -> bytes:
    total = hashlib.sha256()
    for part in parts:
        if isinstance(part, (str, bytes)):
            data = part.encode() if isinstance(part, str) else part
        else:
            data = f"{part.dtype} {part.shape} ".encode() + part.tobytes()
        # With its length, so that no two lists of parts have the same bytes.
        total.update(f"{len(data)} ".encode() + data)
    return total.digest()


@cache
def _surroundings() -> bytes:
    """Return a hash of the code and the libraries that compute the values."""
    # By `os`, because `pathlib` takes four times as long for 700 files.
    package = os.path.dirname(__file__)
    known = sorted(
        f"{folder.removeprefix(package)}/{name} {status.st_size} {status.st_mtime_ns}"
        for folder, _, names in os.walk(package)
        for name in names
        if name.endswith(".py")
        for status in (os.stat(f"{folder}/{name}"),)
    )
    # The folders that state the versions. `importlib.metadata` takes five times as long.
    folders = {entry.name for folder in sys.path for entry in Path(folder).glob("*-info")}
    versions = sorted(entry for entry in folders if entry.partition("-")[0] in LIBRARIES)
    return _digest([sys.version, *versions, *known])


@cache
def _folder() -> Path | None:
    """Return the folder of the files; None if it cannot be created or others may write to it."""
    try:
        # Resolved, so that nobody can lead to another folder later.
        folder = (cache_folder() / "katana450").resolve()
        # Nothing is created in the home of another user, which sudo may keep.
        if not only_this_user_writes(folder):
            return None
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        return folder if only_this_user_writes(folder) else None
    except (OSError, RuntimeError):
        return None


def _loaded(data: bytes, kind: type[T]) -> T:
    """Return the value in the content of a file. Raises DamagedError."""
    if hashlib.sha256(data[HASH_LENGTH:]).digest() != data[:HASH_LENGTH]:
        raise DamagedError
    return decoded(data[HASH_LENGTH:], kind)


def _store(file: Path, value: object) -> None:
    """Write ``value`` whole or not at all. Raises InputError."""
    content = encoded(value)
    write_files({file: writer_of(hashlib.sha256(content).digest() + content)}, mode=0o600)
    files = sorted(file.parent.iterdir(), key=lambda path: path.stat().st_mtime)
    for old_file in files[:-MAX_FILES]:
        old_file.unlink(missing_ok=True)


def encoded(value: object) -> bytes:
    """Return ``value`` as bytes from which ``decoded`` restores it. Raises TypeError."""
    return msgspec.msgpack.encode(value, enc_hook=_plain)


def decoded(data: bytes, kind: type[T]) -> T:
    """Return the value of the type ``kind``; see ``kept``. Raises DamagedError; runs no code."""
    try:
        return msgspec.msgpack.decode(data, type=kind, dec_hook=_restored)
    except (msgspec.MsgspecError, TypeError, ValueError) as error:
        raise DamagedError from error


def _plain(value: Any) -> object:
    """Return a path or an array as plain values. Raises TypeError for anything else."""
    if isinstance(value, Path):
        return str(value)
    import numpy as np

    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        return value.dtype.str, value.shape, value.flags.writeable, value.tobytes()
    raise TypeError(f"{type(value).__name__} cannot be kept on the disk.")


def _restored(kind: Any, plain: Any) -> Any:
    """Return the path or the array that ``_plain`` turned into ``plain``."""
    if kind is Path:
        return Path(plain)
    import numpy as np

    dtype, shape, writeable, data = plain
    array = np.frombuffer(data, np.dtype(dtype)).reshape(shape)
    return array.copy() if writeable else array
