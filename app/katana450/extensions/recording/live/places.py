"""Folder and file names of the ring, which is the recording of the last minutes."""

from __future__ import annotations

from pathlib import Path

from katana450.platform_support import state_folder

SUFFIX = ".mcap"


def default_folder(port: int) -> Path:
    """Return the folder of the ring of the server on ``port``."""
    return state_folder() / "katana450" / "recordings" / f"port-{port}"


def ring_files(folder: Path) -> list[Path]:
    """Return the files of the ring in ``folder``, the oldest first."""
    return sorted(folder.glob(f"*{SUFFIX}"))
