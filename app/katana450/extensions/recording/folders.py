"""Folders of recordings, and folders that appear complete or not at all."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from katana450.errors import InputError
from katana450.platform_support import claim_file, state_folder

SUFFIX = ".mcap"


def default_folder(port: int, content: str = "recordings") -> Path:
    """Return the folder of the ring, or of the episodes, of the server on ``port``."""
    return state_folder() / "katana450" / content / f"port-{port}"


def recordings_in(folder: Path) -> list[Path]:
    """Return the recordings in ``folder`` by their names, a server's oldest first."""
    return sorted(folder.glob(f"*{SUFFIX}"))


def claimed(file: BinaryIO) -> bool:
    """Claim the open ``file``, and return whether no other process has done so.

    Some file systems have no claims. There it counts as claimed.
    """
    try:
        claim_file(file.fileno())
    except (BlockingIOError, PermissionError):
        return False
    except OSError:
        pass
    return True


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """Yield a temporary folder beside ``path``, which becomes ``path`` at the end.

    An error removes it. If the process is killed it stays, hidden. Raises InputError if ``path``
    exists or cannot be created.
    """
    if path.exists():
        raise InputError(f"{path} exists already. Name a new folder; nothing is replaced.")
    if not path.parent.is_dir():
        raise InputError(f"There is no directory {path.parent}; create it, or name another folder.")
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    try:
        temporary.mkdir()
        try:
            yield temporary
            _sync(temporary)
            temporary.rename(path)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}.") from error


def _sync(folder: Path) -> None:
    """Bring all files of ``folder`` to the disk."""
    for file in folder.rglob("*"):
        if file.is_file():
            with file.open("rb+") as opened:
                os.fsync(opened.fileno())
