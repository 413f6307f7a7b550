"""Requests about episodes by several people: none reaches another episode than the one meant."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import katana450
from katana450.client.files import EpisodeClient, LostError, Site
from katana450.errors import InputError
from katana450.extensions.recording.episodes import running_episode
from katana450.extensions.recording.episodes.episode import Episode, EpisodeOutcome, episodes_of
from katana450.extensions.recording.episodes.keeper import EpisodeKeeper
from katana450.extensions.recording.episodes.routes import EpisodeRoutes
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.folders import recordings_in
from katana450.extensions.recording.messages import EPISODES
from katana450.server.web.http_api import RouteContext
from tests.recording.episode_bench import Bench


def attempt(bench: Bench, **stop: object) -> None:
    """Record an episode and end it."""
    bench.ask(do="start", task="pour")
    bench.move(40)
    bench.ask(**{"do": "stop", **stop})


def numbers(bench: Bench) -> tuple[list[int], list[int]]:
    """Return the numbers of the kept and of the discarded episodes."""
    stored, discarded = bench.folder.kept(), bench.folder.discarded()
    return [entry.episode.number for entry in stored], [entry.episode.number for entry in discarded]


def test_request_for_an_episode_that_has_ended_reaches_no_other(bench: Bench) -> None:
    attempt(bench)
    bench.ask(do="start", task="stir")
    bench.move(40)
    for request in ("stop", "rerecord"):
        with pytest.raises(InputError, match="Episode 2 runs now, not episode 1, which has ended"):
            bench.ask(do=request, number=1)
    # Only the one that was seen is judged, while the other one continues.
    bench.ask(do="judge", number=1, outcome="success")
    assert bench.keeper.status()["running"]["number"] == 2
    bench.ask(do="stop", number=2)
    assert bench.folder.find(1).episode.outcome is EpisodeOutcome.SUCCESS
    assert bench.folder.find(2).episode.outcome is EpisodeOutcome.UNJUDGED


def test_part_of_the_last_minutes_is_kept_while_an_episode_runs(bench: Bench) -> None:
    bench.move(50)
    bench.ask(do="start", task="pick")
    bench.move(150)
    offset = 1e-9 * int(bench.header.metadata["utc_offset_ns"])
    start, end = 1000.5 + offset, bench.t + offset
    episode = bench.ask(do="keep", start=start, end=end + 60.0)
    assert (episode["number"], episode["outcome"], episode["task"]) == (2, "success", "pick")
    (opened,) = (katana450.open(file.path) for file in bench.folder.kept())
    assert (opened.start, opened.end) == pytest.approx((1000.5, bench.t), abs=1e-6)
    assert opened.verify().identical
    with pytest.raises(InputError, match="before its start"):
        bench.ask(do="keep", start=end, end=start)
    with pytest.raises(InputError, match="There is nothing"):
        bench.ask(do="keep", start=start - 600.0, end=start - 300.0)
    assert bench.ask(do="stop")["number"] == 1
    assert numbers(bench) == ([1, 2], [])


def test_judgements_are_in_the_last_minutes_too(bench: Bench) -> None:
    attempt(bench)
    bench.ask(do="judge", outcome="failure")
    bench.ask(do="describe", number=1, note="spilled")
    bench.ring.close()
    (path,) = recordings_in(bench.ring_folder)
    with RecordingFile.open(path) as file:
        messages = [message.data for message in file.messages(EPISODES)]
    kinds = [json.loads(message)["kind"] for message in messages]
    assert kinds == ["begun", "ended", "judged", "noted"]
    (episode,) = episodes_of(messages)
    assert (episode.outcome, episode.note) == (EpisodeOutcome.FAILURE, "spilled")


def test_interrupted_episode_is_finished_while_others_are_recorded(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.ask(do="start", task="long")
    bench.move(60)
    bench.ring.sync()
    may_finish, cut_out = threading.Event(), running_episode.cut_out

    def slow(*args: Any) -> Episode:
        assert may_finish.wait(20.0)
        return cut_out(*args)

    monkeypatch.setattr(running_episode, "cut_out", slow)
    run = bench.header.metadata["utc_offset_ns"]
    bench.keeper = EpisodeKeeper(bench.folder, bench.ring, bench.ring_folder, run, lambda: bench.t)
    # It has returned although the first episode is not saved yet, and still holds its files.
    first = bench.ring.held
    monkeypatch.setattr(running_episode, "cut_out", cut_out)
    assert bench.ask(do="start", task="next")["number"] == 2
    assert bench.ring.held == first
    may_finish.set()
    bench.keeper.finishing.join(20.0)
    bench.move(40)
    bench.ask(do="stop")
    assert numbers(bench) == ([1, 2], [])
    assert bench.folder.find(1).episode.outcome is EpisodeOutcome.UNFINISHED
    assert bench.ring.held is None


def test_people_who_only_watch_do_not_learn_where_files_are(tmp_path: Path) -> None:
    (tmp_path / "episode-0001.mcap").write_bytes(b"broken")
    hub = SimpleNamespace(shown={})
    context = RouteContext(hub, None, None, None, None)  # type: ignore[arg-type]
    routes = EpisodeRoutes(context, tmp_path, None)  # type: ignore[arg-type]
    for paths in (True, False):
        answer = json.dumps(routes._listed(paths=paths))
        assert "episode-0001.mcap" in answer
        assert (str(tmp_path) in answer) is paths


def test_problem_of_the_folder_is_shown_without_its_path(bench: Bench) -> None:
    bench.ask(do="start", task="pour")
    bench.move(40)
    bench.folder.path(1).mkdir()
    with pytest.raises(InputError, match=str(bench.folder.folder)):
        bench.ask(do="stop")
    problem = bench.keeper.status()["problem"]
    assert "episode-0001.mcap cannot be written" in problem
    assert str(bench.folder.folder) not in problem
    bench.folder.path(1).rmdir()


@contextmanager
def answering(content: bytes) -> Iterator[str]:
    """Serve ``content`` in answer to every request, and yield the address."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.end_headers()
            self.wfile.write(content)

        do_POST = do_GET  # noqa: N815 - the name that the class calls

        def log_message(self, *_: object) -> None:
            pass

    with HTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.mark.parametrize("content", [b"{}", b"[1]", b"not JSON", b'{"number": "x"}', b"\xff"])
def test_answer_that_is_not_understood_is_an_error_of_this_project(content: bytes) -> None:
    with answering(content) as url:
        client = EpisodeClient(Site(url))
        for act in (client.start, client.list):
            with pytest.raises(LostError, match="is not understood"):
                act()
