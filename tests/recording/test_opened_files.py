"""Files that people send to a server or take from it: bounded in time, and removed in the end."""

from __future__ import annotations

import asyncio
import gc
import json
import tempfile
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from starlette.exceptions import HTTPException
from starlette.requests import Request

from katana450.arm.control.lease import Role
from katana450.extensions.recording.live.jobs import RecordingRoutes
from katana450.extensions.recording.playback import routes as routes_module
from katana450.extensions.recording.playback.routes import OTHER, PlaybackRoutes
from katana450.extensions.recording.playback.store import RecordingStore
from katana450.resources import URDF_PATH
from katana450.server.service.identity import Identity
from katana450.server.web.bodies import TOO_SLOW
from katana450.server.web.http_api import RouteContext
from tests.recording.recorded import record

Receive = Callable[[], Awaitable[dict[str, Any]]]


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("run") / "run.mcap"
    record(path, 120)
    return path.read_bytes()


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of temporary files, which is empty."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def context() -> RouteContext:
    who = Identity("session", "Ada", Role.OPERATOR)
    hub = SimpleNamespace(recorder=SimpleNamespace(note=lambda *_: None))
    options = SimpleNamespace(urdf=None)
    return RouteContext(hub, None, lambda _: who, None, options)  # type: ignore[arg-type]


def uploaded(store: RecordingStore, receive: Receive) -> dict[str, Any]:
    """Return the answer to a file whose parts ``receive`` returns."""
    upload = PlaybackRoutes(context(), store).routes()[0].endpoint  # type: ignore[attr-defined]
    scope = {
        "type": "http", "method": "POST", "path": "/api/v1/playback", "query_string": b"",
        "headers": [], "server": ("127.0.0.1", 8080), "client": ("127.0.0.1", 5),
    }  # fmt: skip
    answer: dict[str, Any] = json.loads(asyncio.run(upload(Request(scope, receive))).body)
    return answer


def parts(*bodies: bytes, then: float = 0.0) -> Receive:
    """Return a function that returns ``bodies``, and waits ``then`` [s] before the end."""
    left = list(bodies)

    async def receive() -> dict[str, Any]:
        if left:
            return {"type": "http.request", "body": left.pop(0), "more_body": True}
        await asyncio.sleep(then)
        return {"type": "http.request", "body": b"", "more_body": False}

    return receive


def test_upload_that_stalls_ends_and_leaves_nothing(
    temporary: Path, tmp_path: Path, content: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(routes_module, "STALL_TIMEOUT", 0.2)
    store = RecordingStore(tmp_path)
    began = time.monotonic()
    with pytest.raises(HTTPException) as caught:
        uploaded(store, parts(content[:1000], then=30.0))
    assert caught.value.status_code == TOO_SLOW
    assert time.monotonic() - began < 10.0
    assert not list(temporary.rglob("*.mcap"))
    # One that is slow but continues is received.
    monkeypatch.setattr(routes_module, "STALL_TIMEOUT", 1.0)
    assert uploaded(store, parts(content[:1000], content[1000:], then=0.5))["name"]


def test_file_of_another_robot_is_opened_with_a_note(
    temporary: Path, tmp_path: Path, content: bytes
) -> None:
    del temporary
    other = tmp_path / "other.urdf"
    other.write_bytes(URDF_PATH.read_bytes() + b"<!-- longer links -->")
    for store, note in ((RecordingStore(tmp_path), ""), (RecordingStore(tmp_path, other), OTHER)):
        assert uploaded(store, parts(content))["note"] == note


def test_files_are_removed_with_their_store(temporary: Path, tmp_path: Path) -> None:
    store = RecordingStore(tmp_path)
    store.new_path().write_bytes(b"in use")
    assert len(list(temporary.glob("*/*.mcap"))) == 1
    del store
    gc.collect()
    assert not list(temporary.iterdir())


@pytest.mark.long
def test_download_is_sent_in_parts_and_removed(
    temporary: Path, tmp_path: Path, content: bytes
) -> None:
    ring = tmp_path / "ring"
    ring.mkdir()
    (ring / "1.mcap").write_bytes(content)
    store = RecordingStore(ring)
    download = RecordingRoutes(context(), store).routes()[0].endpoint
    scope = {"type": "http", "method": "GET", "query_string": b"", "headers": []}
    sent: list[dict[str, Any]] = []

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    async def fetch() -> None:
        answer = await download(Request(scope))
        assert len(list(temporary.rglob("katana450.mcap"))) == 1
        await answer(scope, parts(), send)

    asyncio.run(fetch())
    assert b"".join(message.get("body", b"") for message in sent).startswith(b"\x89MCAP")
    assert not list(temporary.rglob("katana450.mcap"))

    async def lost(_: dict[str, Any]) -> None:
        raise OSError("The client has left.")

    async def broken() -> None:
        answer = await download(Request(scope))
        await answer(scope, parts(), lost)

    with pytest.raises(OSError, match="has left"):
        asyncio.run(broken())
    assert not list(temporary.rglob("katana450.mcap"))
