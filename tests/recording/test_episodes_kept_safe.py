"""Episodes are not lost with a missing ring."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from katana450.extensions.recording.episodes.episode_folder import EpisodeMarker
from tests.recording.episode_bench import Bench


def test_interrupted_episode_waits_until_its_ring_is_found(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    away = bench.ring_folder.with_name("away")
    monkeypatch.chdir(bench.ring_folder.parent)
    bench.ring_folder = Path("ring")
    bench.keeper = bench.made()
    bench.ask(do="start", task="stir")
    bench.move(100)
    bench.ring.sync()
    monkeypatch.chdir("/")
    away.with_name("ring").rename(away)
    assert "There is no folder" in bench.made().status()["notice"]
    assert len(bench.folder.markers()) == 1
    away.rename(away.with_name("ring"))
    bench.keeper = bench.made()
    assert "is kept as unfinished" in bench.keeper.status()["notice"]
    assert not bench.folder.markers()


def test_end_of_an_interrupted_episode_keeps_the_files_of_a_new_one(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.move(50)
    read, reading, may_end = bench.folder.markers, threading.Event(), threading.Event()

    def slowly() -> list[EpisodeMarker]:
        result = read()
        if threading.current_thread() is finishing:
            reading.set()
            assert may_end.wait(5.0)
        return result

    monkeypatch.setattr(bench.folder, "markers", slowly)
    # As the thread that finishes interrupted episodes.
    finishing = threading.Thread(target=bench.keeper._running.hold_needed)
    starting = threading.Thread(target=lambda: bench.ask(do="start", task="stir"))
    finishing.start()
    assert reading.wait(5.0)
    starting.start()
    starting.join(0.2)
    may_end.set()
    finishing.join()
    starting.join()
    assert bench.ring.held == bench.ring.newest
