"""The part of the view that plays back: it knows the windows, and has no controls."""

from __future__ import annotations

from weakref import WeakKeyDictionary

from katana450.server.service.hub import Hub
from katana450.server.view.panel_folder import FolderContext

CONTEXTS: WeakKeyDictionary[Hub, FolderContext] = WeakKeyDictionary()
"""The context of the view of each server, which has one once its scene is there."""


class PlaybackFolder:
    """A folder without controls: those of play back are in the page around viser."""

    def __init__(self, context: FolderContext) -> None:
        """Let the windows of ``context`` play back."""
        CONTEXTS[context.hub] = context

    def follow(self) -> None:
        """Do nothing: what is played back follows its window, not the arm."""
