"""A page exports and verifies what a real server has recorded, with progress and cancel."""

from __future__ import annotations

import asyncio
import json
import os
import re
import signal
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from starlette.exceptions import HTTPException
from starlette.requests import Request

import katana450
from katana450.arm.control.lease import Role
from katana450.cli.main import main
from katana450.extensions import progress
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.recording_writer import MessageWriter
from katana450.extensions.recording.folders import recordings_in
from katana450.extensions.recording.live.jobs import RecordingRoutes
from katana450.extensions.recording.messages import COMMANDS
from katana450.extensions.recording.playback.store import PREFIX, RecordingStore
from katana450.server.service.identity import Identity
from katana450.server.web.http_api import RouteContext
from tests.browser.server import RECORDING_APP, AppServer
from tests.gateway.client import ask, enter
from tests.recording.recorded import record, swinging
from tests.waiting import until

POSTURES = ((0.3, -1.0, 1.4, 0.3, 0.0), (-0.3, -1.0, 1.4, 0.3, 0.5))


@pytest.fixture(scope="module")
def temporary(server_folder: Path) -> Path:
    """Return the folder for temporary files of the server."""
    return server_folder / "temporary"


@pytest.fixture(scope="module")
def server(shared_server: AppServer, server_folder: Path) -> AppServer:
    """Return a server that has recorded two motions."""
    with katana450.connect(shared_server.url, name="Ada") as client:
        for posture in POSTURES:
            client.joints(posture)
    # Each request for a recording starts a process.
    until(lambda: recordings_in(server_folder / "ring"))
    time.sleep(1.0)
    cookie = enter(shared_server.url)
    until(lambda: ask(f"{shared_server.url}/api/v1/recording", Cookie=cookie)[0] == 200)
    return shared_server


class Page:
    """Requests of one page."""

    def __init__(self, server: AppServer) -> None:
        self._root, self._cookie = f"{server.url}/api/v1/recording", enter(server.url)
        self._origin = server.url

    def ask(self, path: str, *, post: bool = False) -> tuple[int, bytes]:
        data = b"" if post else None
        answer = ask(f"{self._root}{path}", data=data, Cookie=self._cookie, Origin=self._origin)
        return answer[0], answer[2]

    def upload(self, path: Path) -> tuple[int, bytes]:
        """Open the recording at ``path`` for play back."""
        url = f"{self._origin}/api/v1/playback"
        answer = ask(url, data=path.read_bytes(), Cookie=self._cookie, Origin=self._origin)
        return answer[0], answer[2]

    def begun(self, query: str) -> str:
        """Return the name of the job of ``query``, which begins."""
        status, answer = self.ask(f"/jobs?{query}", post=True)
        assert status == 200, answer
        name: str = json.loads(answer)["job"]
        return name

    def ended(self, name: str) -> dict[str, Any]:
        """Return the state of the job ``name`` when it has ended."""
        deadline = time.monotonic() + 90.0
        while True:
            status, answer = self.ask(f"/jobs/{name}")
            assert status == 200, answer
            state: dict[str, Any] = json.loads(answer)
            if state["status"] != "working":
                return state
            assert time.monotonic() < deadline
            time.sleep(0.1)

    def made(self, query: str) -> bytes:
        """Return the file of the job of ``query``."""
        name = self.begun(query)
        state = self.ended(name)
        assert state["status"] == "done", state
        assert state["fraction"] == 1.0
        status, content = self.ask(f"/jobs/{name}/file")
        assert status == 200
        return content


@pytest.fixture
def page(server: AppServer) -> Page:
    return Page(server)


def test_difference_is_stated_with_its_time_and_size(page: Page, tmp_path: Path) -> None:
    path, changed = tmp_path / "all.mcap", tmp_path / "changed.mcap"
    path.write_bytes(page.ask("")[1])
    with RecordingFile.open(path) as file, changed.open("wb") as out:
        copy, count = MessageWriter(out, file.metadata, file.attachments()), 0
        for message in file.messages(*file.counts()):
            count += message.topic == COMMANDS
            other = message.data.replace(b'"digest":"', b'"digest":"0')
            copy.copy(message._replace(data=other) if count == 60 else message)
        copy.finish()
    status, answer = page.upload(changed)
    assert status == 200, answer
    name = json.loads(answer)["name"]
    state = page.ended(page.begun(f"do=verify&of={name}"))
    assert re.match(r"first difference at t = [0-9.]+ s, 0 rad; 1 of [0-9]+ ticks", state["words"])


@pytest.mark.long
@pytest.mark.parametrize(("format", "start"), [("mp4", b""), ("rosbag2", b"PK")])
def test_further_formats_are_exported(page: Page, format: str, start: bytes) -> None:
    content = page.made(f"do={format}&last=0.5")
    assert content.startswith(start)
    assert len(content) > 1000


@pytest.mark.parametrize("format", ["csv", "rosbag2"])
def test_progress_of_an_export_never_moves_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, format: str
) -> None:
    path, out = tmp_path / "run.mcap", tmp_path / f"run.{format}"
    record(path, 120, commands=swinging)
    fractions: list[float] = []
    monkeypatch.setattr(progress, "_listeners", [fractions.append])
    assert main(["record", "export", str(path), "--format", format, "--out", str(out)]) == 0
    assert len(fractions) > 20
    assert fractions == sorted(fractions)
    assert 0.0 <= fractions[0] < 0.1
    assert 0.9 < fractions[-1] <= 1.0


def folders(temporary: Path) -> list[Path]:
    """Return the folders of jobs in ``temporary``."""
    return [path for path in temporary.glob(f"{PREFIX}*/*") if path.is_dir()]


def test_job_that_is_cancelled_leaves_nothing(page: Page, temporary: Path) -> None:
    others = {path.name for path in temporary.iterdir()}
    name = page.begun("do=mp4")
    until(lambda: len(list(folders(temporary)[-1].iterdir())) > 0)
    # One at a time.
    status, answer = page.ask("/jobs?do=csv", post=True)
    assert status == 429
    assert b"Wait, or cancel it" in answer
    assert page.ask(f"/jobs/{name}/file")[0] == 409
    before = len(folders(temporary))
    assert page.ask(f"/jobs/{name}/cancel", post=True)[0] == 204
    assert len(folders(temporary)) == before - 1
    assert page.ended(name)["status"] == "cancelled"
    assert page.ask(f"/jobs/{name}/file")[0] == 409
    assert page.ask(f"/jobs/{name}/cancel", post=True)[0] == 204
    assert page.ask("/jobs/none")[0] == 404
    assert {path.name for path in temporary.iterdir()} == others
    # The next one begins at once.
    assert page.made("do=csv")


def test_wrong_requests_are_refused(page: Page) -> None:
    for query, status, words in (
        ("", 400, "`do` is one of verify, csv"),
        ("do=exe", 400, "not 'exe'"),
        ("do=csv&from=x", 400, "`from` is a number"),
        ("do=csv&of=none", 404, "no longer has that recording"),
    ):
        answer = page.ask(f"/jobs?{query}", post=True)
        assert answer[0] == status, query
        assert words in answer[1].decode()
    assert page.ask("/jobs/../../x")[0] == 404
    state = page.ended(page.begun("do=csv&from=9e9"))
    assert state["status"] == "failed"
    assert "There is nothing from" in state["words"]


def test_viewers_get_no_recording_and_begin_no_job(tmp_path: Path) -> None:
    who = Identity("session", "Vera", Role.VIEWER)
    context = RouteContext(None, None, lambda _: who, None, None)  # type: ignore[arg-type]
    request = Request({"type": "http", "query_string": b"do=csv", "headers": [], "path_params": {}})
    for route in RecordingRoutes(context, RecordingStore(tmp_path)).routes():
        with pytest.raises(HTTPException) as caught:
            asyncio.run(route.endpoint(request))
        assert caught.value.status_code == 403


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="/proc")
def test_job_ends_with_a_server_that_is_killed(tmp_path: Path) -> None:
    folder, temporary = tmp_path / "ring", tmp_path / "temporary"
    temporary.mkdir()
    environment = {**os.environ, "TMPDIR": str(temporary)}
    server = AppServer((*RECORDING_APP, "--record", str(folder)), environment=environment)
    with server:
        with katana450.connect(server.url, name="Ada") as client:
            client.joints(POSTURES[0])
        page = Page(server)
        until(lambda: page.ask("")[0] == 200)
        page.begun("do=mp4")

        def working() -> list[int]:
            return [
                int(path.name)
                for path in Path("/proc").iterdir()
                if path.name.isdigit()
                and str(temporary) in _environment(path)
                and "job_process" in _command(path)
            ]

        until(working)
        assert folders(temporary)
        os.killpg(server.pid, signal.SIGKILL)
        until(lambda: not working())


def _command(process: Path) -> str:
    try:
        return (process / "cmdline").read_bytes().decode()
    except OSError:
        return ""


def _environment(process: Path) -> str:
    try:
        return (process / "environ").read_bytes().decode()
    except OSError:
        return ""
