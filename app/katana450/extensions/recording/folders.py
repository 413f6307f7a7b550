"""Folders of recordings, temporary folders, and folders that appear complete or not at all.

A temporary folder is recognized as abandoned when its process was killed.
"""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from katana450.errors import InputError
from katana450.platform_support import claim_file, state_folder

SUFFIX = ".mcap"


def default_folder(port: int) -> Path:
    """Return the folder of the ring of the server on ``port``."""
    return state_folder() / "katana450" / "recordings" / f"port-{port}"


def default_episodes_folder(port: int) -> Path:
    """Return the folder of the episodes of the server on ``port``."""
    return state_folder() / "katana450" / "episodes" / f"port-{port}"


def recordings_in(folder: Path) -> list[Path]:
    """Return the recordings in ``folder`` by their names, a server's oldest first."""
    return sorted(folder.glob(f"*{SUFFIX}"))


CLAIM = ".claim"
"""Name of the file that a process claims in its folder until it ends, in whatever way."""


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


def claimed_folder(make: Callable[[], Path]) -> tuple[Path, BinaryIO]:
    """Return a new folder, and its open file that claims it. Raises OSError.

    ``make`` makes a folder with another name each time.
    """
    while True:
        folder = make()
        claim = open(folder / CLAIM, "wb")  # noqa: SIM115 - open as long as the folder is used
        # Another process may take the folder for an abandoned one, before the claim.
        if claimed(claim) and (folder / CLAIM).exists():
            return folder, claim
        claim.close()


def remove_abandoned(claims: Iterable[Path]) -> None:
    """Remove the folders of the files ``claims`` whose processes have ended."""
    for claim in claims:
        try:
            with claim.open("rb+") as file:
                claim_file(file.fileno())
                # While the claim is ours, so that nobody else begins with it.
                shutil.rmtree(claim.parent, ignore_errors=True)
        except OSError:
            # Its process still runs, or it is not ours to remove.
            continue
        # Windows removes no open file.
        shutil.rmtree(claim.parent, ignore_errors=True)


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
