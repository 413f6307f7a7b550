"""URDF files that tests write: a text, or a text with one part replaced."""

from __future__ import annotations

from pathlib import Path


def saved(folder: Path, text: str, name: str = "robot.urdf") -> Path:
    """Write ``text`` to a file in ``folder`` and return its path."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def edited(folder: Path, text: str, old: str, new: str) -> Path:
    """Write ``text`` with ``new`` in the place of ``old``, which it must contain."""
    assert old in text
    return saved(folder, text.replace(old, new), "arm.urdf")
