"""Folders that appear complete or not at all."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from katana450.errors import InputError
from katana450.platform_support import claim_file

CLAIM = ".claim"
"""Name of the file that a running export has claimed in its temporary folder."""


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
    _remove_abandoned(path)
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    try:
        temporary.mkdir()
        try:
            with (temporary / CLAIM).open("wb") as claim:
                with suppress(OSError):
                    # Some file systems have no claims.
                    claim_file(claim.fileno())
                yield temporary
            (temporary / CLAIM).unlink()
            _sync(temporary)
            temporary.rename(path)
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}.") from error


def _remove_abandoned(path: Path) -> None:
    """Remove the temporary folders of exports to ``path`` that were killed."""
    for claim in path.parent.glob(f".{_escaped(path.name)}.????????/{CLAIM}"):
        try:
            with claim.open("rb+") as file:
                claim_file(file.fileno())
        except OSError:
            # Its export still runs, or it is not ours to remove.
            continue
        shutil.rmtree(claim.parent, ignore_errors=True)


def _escaped(name: str) -> str:
    """Return ``name`` as a pattern that matches only itself."""
    return "".join(f"[{c}]" if c in "*?[" else c for c in name)


def _sync(folder: Path) -> None:
    """Bring all files of ``folder`` to the disk."""
    for file in folder.rglob("*"):
        if file.is_file():
            with file.open("rb+") as opened:
                os.fsync(opened.fileno())
