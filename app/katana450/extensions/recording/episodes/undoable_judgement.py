"""The last judgement of an episode, while it can be undone."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.extensions.recording.episodes.episode import EpisodeOutcome

UNDO_SECONDS = 10.0
"""[s] Time in which the last judgement can be undone."""


@dataclass(frozen=True)
class UndoableJudgement:
    """The last judgement or discard.

    Attributes:
        number: the episode.
        before: its outcome before; None if it was discarded.
        until: time [s] from which it cannot be undone any more.
    """

    number: int
    before: EpisodeOutcome | None
    until: float
