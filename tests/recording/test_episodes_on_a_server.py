"""Episodes of a real server: by the client, through kills, without a lost one."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

import katana450
from katana450.cli.main import main
from katana450.client import RefusedError
from katana450.client.files import EpisodeClient, Site
from katana450.extensions.recording.episodes.episode import EpisodeOutcome
from katana450.extensions.recording.episodes.episode_folder import EpisodeFolder
from tests.browser.server import RECORDING_APP, AppServer, ServerError
from tests.gateway.client import ask, enter
from tests.recording.test_recorder import POSTURES, RECORDER
from tests.waiting import until


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "episodes"


@pytest.fixture
def command(tmp_path: Path, folder: Path) -> tuple[str, ...]:
    # A busy machine delays the heartbeats of its processes, for which the arm would pause.
    return (
        *RECORDING_APP,
        "--silence",
        "2.0",
        "--record",
        str(tmp_path / "ring"),
        "--episodes",
        str(folder),
    )


@pytest.fixture
def server(command: tuple[str, ...]) -> Iterator[AppServer]:
    with AppServer(command) as running:
        yield running


def started(server: AppServer, task: str) -> EpisodeClient:
    """Begin an episode, for which the server waits until the process that records is there."""
    client = EpisodeClient(Site(server.url, name="Ada"))
    client.start(task)
    return client


def move(server: AppServer, *postures: tuple[float, ...]) -> float:
    """Drive the arm, and return the time of the last motion."""
    with katana450.connect(server.url, name="Ada") as arm:
        for posture in postures:
            arm.joints(posture)
    return time.perf_counter()


@pytest.mark.long
def test_client_records_episodes(
    server: AppServer, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert f"episodes in {folder}" in server.output
    client = started(server, "pour")
    with pytest.raises(RefusedError, match="Episode 1 runs already"):
        client.start()
    move(server, *POSTURES)
    client.stop("success")
    (episode,) = client.list()
    assert (episode.number, episode.task, episode.outcome) == (1, "pour", "success")
    assert episode.end - episode.start > 1.0
    capsys.readouterr()
    client.describe(1, note="half a cup")
    client.trim(1, 0.1, 0.9)
    client.judge("failure")
    client.judge("success")
    (episode,) = client.list()
    assert (episode.outcome, episode.note) == ("success", "half a cup")
    assert episode.end - episode.start == pytest.approx(0.8)
    client.discard(1)
    assert not client.list()
    client.restore(1)
    with pytest.raises(RefusedError, match="There is no episode 7"):
        client.discard(7)
    address, cookie = f"{server.url}/api/v1/episodes", enter(server.url)
    assert ask(f"{address}/99", Cookie=cookie)[0] == 404
    for body, status in (("{", 422), ('{"do": "win"}', 422), ('{"do": "stop"}', 409)):
        answer = ask(address, data=body.encode(), Cookie=cookie, Origin=server.url)
        assert answer[0] == status, answer[2]
    # A page of another site has the cookie and another origin.
    answer = ask(address, data=b'{"do": "start"}', Cookie=cookie, Origin="http://elsewhere")
    assert answer[0] == 403, answer[2]
    client.download(1, tmp_path / "mine.mcap")
    (downloaded,) = katana450.open(tmp_path / "mine.mcap").episodes
    assert downloaded.outcome is EpisodeOutcome.SUCCESS
    assert downloaded.by.name == "Ada"
    assert downloaded.length == pytest.approx(0.8)
    server.stop()
    assert main(["record", "list", str(folder)]) == 0
    assert "episode 1, success: pour" in capsys.readouterr().out


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL")
def test_next_server_finishes_the_episode_of_a_killed_one(
    command: tuple[str, ...], folder: Path
) -> None:
    with AppServer(command) as server:
        started(server, "cut off")
        move(server, *POSTURES)
        time.sleep(1.5)
        processes = [server.pid, server.child(RECORDER), server.arm, server.front]
        for process in processes:
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        with suppress(ServerError):
            server.stop()
    with AppServer(command) as server:
        started(server, "next")
        until(lambda: EpisodeFolder(folder).kept())
    (entry, *_) = EpisodeFolder(folder).kept()
    assert entry.episode.task == "cut off"
    assert entry.episode.length > 1.0


def test_server_that_ends_finishes_its_episode(server: AppServer, folder: Path) -> None:
    started(server, "last")
    move(server, *POSTURES)
    server.stop()
    assert "Traceback" not in server.output
    (entry,) = EpisodeFolder(folder).kept()
    assert entry.episode.outcome is EpisodeOutcome.UNFINISHED
    assert entry.episode.length > 1.0
