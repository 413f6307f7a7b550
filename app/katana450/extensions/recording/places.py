"""Folders of recordings, and the names of the files in them."""

from __future__ import annotations

from pathlib import Path

from katana450.platform_support import state_folder

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
