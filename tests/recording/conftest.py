"""Fixtures of the tests of recordings."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from katana450.extensions.recording.episodes import running_episode
from tests.recording.episode_bench import Bench


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    """Return a ring with a keeper of episodes, which does not wait for late records."""
    monkeypatch.setattr(running_episode, "LATE_SECONDS", 0.0)
    found = Bench(tmp_path)
    yield found
    found.keeper.close()
    found.ring.close()
