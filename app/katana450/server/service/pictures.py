"""The connections by which windows get pictures, and the ages of what they show."""

from __future__ import annotations

from typing import Protocol


class MeasuresAge(Protocol):
    """Interface for the age of a window's picture; ``Flow`` implements it."""

    def age(self, t: float) -> float:
        """Return the age of the picture [s] at time ``t`` [s]."""


class ShownPictures:
    """The connections of pages to viser, each with the window that it belongs to."""

    def __init__(self) -> None:
        """Begin without connections."""
        self._windows: dict[MeasuresAge, str] = {}

    def show(self, key: str, picture: MeasuresAge) -> None:
        """Add a connection of the window ``key``. ``picture`` measures the age of its picture."""
        self._windows[picture] = key

    def hide(self, picture: MeasuresAge) -> None:
        """Remove a closed connection."""
        del self._windows[picture]

    @property
    def watching(self) -> int:
        """Number of browsers that get pictures."""
        return len(self._windows)

    def age(self, key: str, t: float) -> float:
        """Return the age of the picture that the window ``key`` shows at ``t`` [s]."""
        pictures = [each for each, window in self._windows.items() if window == key]
        return pictures[-1].age(t) if pictures else 0.0
