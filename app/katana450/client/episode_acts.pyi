# Written by `python -m docs.stubs` from the classes of the requests about episodes.
from typing import Literal

from katana450.server.api.episode_requests import EpisodeRequest

METHODS: dict[str, type[EpisodeRequest]]

class EpisodeActs:
    def start(self, task: str | None = ...) -> int:
        """Begin an episode.

        Args:
            task: What is to be done; None for that of the last episode.
        """

    def stop(
        self,
        outcome: Literal["unjudged", "success", "failure"] = ...,
        number: int | None = ...,
    ) -> int:
        """End the episode that runs, and keep it in its file.

        Args:
            outcome: Its outcome, if it is known already.
            number: The episode; another one that runs is not ended. None for any.
        """

    def judge(
        self,
        outcome: Literal["unjudged", "success", "failure"],
        number: int | None = ...,
    ) -> int:
        """Judge an episode. One that runs is ended first.

        Args:
            outcome: The outcome.
            number: The episode; None for the one that runs, or else the last one.
        """

    def discard(self, number: int | None = ...) -> int:
        """Move an episode to the discarded ones. One that runs is ended first.

        Args:
            number: The episode; None for the one that runs, or else the last one.
        """

    def restore(self, number: int) -> int:
        """Bring a discarded episode back.

        Args:
            number: The episode.
        """

    def undo(self, number: int | None = ...) -> int:
        """Undo the last judgement, discard or re-record, up to 10 s after it.

        Args:
            number: The episode; what was done to another one since is not undone. None for any.
        """

    def rerecord(self, number: int | None = ...) -> int:
        """Begin an episode again. When the new one is kept, the old one is discarded.

        Args:
            number: The old episode; None for the one that runs, or else the last one. One that runs is
                ended first.
        """

    def describe(self, number: int, task: str | None = ..., note: str | None = ...) -> int:
        """Change the texts of an episode.

        Args:
            number: The episode.
            task: The new task; None to keep it.
            note: The new remarks; None to keep them.
        """

    def trim(self, number: int, start: float, end: float) -> int:
        """Give an episode another start and end. Nothing is deleted, so it can be widened again.

        Args:
            number: The episode.
            start: First moment, in seconds after the start of its file.
            end: Last moment, in seconds after the start of its file.
        """
