"""Folders that appear complete or not at all."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from katana450.errors import InputError
from katana450.extensions.recording.claimed_folder import (
    CLAIM,
    claimed_folder,
    remove_abandoned,
)


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """Yield a temporary folder beside ``path``, which becomes ``path`` at the end.

    An error removes it. If the process is killed it stays, hidden, until the next export to
    ``path`` removes it. Raises InputError if ``path`` exists or cannot be created.
    """
    if path.exists():
        raise InputError(f"{path} exists already. Name a new folder; nothing is replaced.")
    if not path.parent.is_dir():
        raise InputError(f"There is no directory {path.parent}; create it, or name another folder.")
    remove_abandoned(path.parent.glob(f".{_escaped(path.name)}.????????/{CLAIM}"))
    try:
        temporary, claim = claimed_folder(lambda: _made_beside(path))
        try:
            with claim:
                yield temporary
                with suppress(PermissionError):
                    # While it is claimed; Windows removes no open file.
                    (temporary / CLAIM).unlink()
            (temporary / CLAIM).unlink(missing_ok=True)
            _sync(temporary)
            temporary.rename(path)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}.") from error


def _made_beside(path: Path) -> Path:
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    temporary.mkdir()
    return temporary


def _escaped(name: str) -> str:
    """Return ``name`` as a pattern that matches only itself."""
    return "".join(f"[{c}]" if c in "*?[" else c for c in name)


def _sync(folder: Path) -> None:
    """Bring all files of ``folder`` to the disk."""
    for file in folder.rglob("*"):
        if file.is_file():
            with file.open("rb+") as opened:
                os.fsync(opened.fileno())
