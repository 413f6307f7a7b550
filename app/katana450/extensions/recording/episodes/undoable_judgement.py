"""The last judgement of an episode, while it can be undone."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.extensions.recording.episodes.episode import EpisodeOutcome

UNDO_SECONDS = 10.0
"""[s] Time in which the last judgement can be undone."""


@dataclass(frozen=True)
class UndoableJudgement:
    """The last judgement, discard or re-record.

    Attributes:
        number: the episode.
        before: its outcome before; None if it was discarded, or is the one that runs.
        until: time [s] from which it cannot be undone any more.
        replaced: for a re-record, the episodes that were to be replaced before it; else None.
    """

    number: int
    before: EpisodeOutcome | None
    until: float
    replaced: tuple[int, ...] | None = None
