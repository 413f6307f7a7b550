"""A ring on a test clock, with the ticks of a random session, and the episodes marked in it."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

from katana450.arm.runtime.tick import TickRecord
from katana450.extensions.recording.episodes.episode import EpisodeGiver
from katana450.extensions.recording.episodes.episode_folder import EpisodeFolder
from katana450.extensions.recording.episodes.keeper import EpisodeKeeper
from katana450.extensions.recording.live.ring import Ring
from katana450.server.api.episode_requests import episode_request
from tests.recording.recorded import header, run

ADA = EpisodeGiver("Ada", "operator")


@cache
def motion() -> tuple[TickRecord, ...]:
    """Return the ticks of a random session."""
    records: list[TickRecord] = []
    run(450, 9, records.append, odd=False)
    return tuple(records)


class Bench:
    """A ring on a test clock, and the episodes that are marked in it."""

    def __init__(self, folder: Path) -> None:
        self.t = 1000.0
        self.ring_folder, self.folder = folder / "ring", EpisodeFolder(folder / "episodes")
        self.header = header()
        self.ring = Ring(self.ring_folder, self.header)
        self.records = list(motion())
        self.folder.claim()
        self.keeper = self.made()

    def made(self) -> EpisodeKeeper:
        run_name = self.header.metadata["utc_offset_ns"]
        keeper = EpisodeKeeper(self.folder, self.ring, self.ring_folder, run_name, lambda: self.t)
        keeper.finishing.join()
        return keeper

    def move(self, ticks: int) -> None:
        """Record the next ``ticks``."""
        for record in self.records[:ticks]:
            self.ring.put(record)
            self.t = record.t
        del self.records[:ticks]

    def ask(self, **request: object) -> dict[str, object]:
        return self.keeper.handle(episode_request(json.dumps(request)), ADA)
