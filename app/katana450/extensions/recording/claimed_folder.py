"""Temporary folders of processes, which are recognized as abandoned when these were killed."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import BinaryIO

from katana450.platform_support import claim_file

CLAIM = ".claim"
"""Name of the file that a process claims in its folder until it ends, in whatever way."""


def claimed_folder(make: Callable[[], Path]) -> tuple[Path, BinaryIO]:
    """Return a new folder, and its open file that claims it. Raises OSError.

    ``make`` makes a folder with another name each time.
    """
    while True:
        folder = make()
        claim = open(folder / CLAIM, "wb")  # noqa: SIM115 - open as long as the folder is used
        try:
            claim_file(claim.fileno())
        except (BlockingIOError, PermissionError):
            # Another process takes the folder for an abandoned one, before the claim.
            claim.close()
            continue
        except OSError:
            # Some file systems have no claims.
            pass
        if (folder / CLAIM).exists():
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
