"""The part of the view that plays back: it knows the windows, and has no controls."""

from __future__ import annotations

from katana450.extensions.recording.playback.drawing import PlaybackWindows
from katana450.extensions.recording.playback.routes import WINDOWS
from katana450.server.view.panel_folder import FolderContext
from katana450.server.viser_bridge.gestures import Gestures


class PlaybackFolder:
    """A folder without controls: those of play back are in the page around viser."""

    def __init__(self, context: FolderContext) -> None:
        """Let the windows of ``context`` play back."""
        if isinstance(context.gestures, Gestures):
            WINDOWS[context.hub] = PlaybackWindows(
                context.server,
                context.robot,
                context.gestures,
                lambda: context.hub.present().session,
            )

    def follow(self) -> None:
        """Do nothing: what is played back follows its window, not the arm."""
