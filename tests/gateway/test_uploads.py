"""Test uploads that drip, take long or are abandoned, which end; and those of several files."""

from __future__ import annotations

import asyncio
import io
import json
import socket
import time
import zipfile
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from starlette.exceptions import HTTPException
from starlette.requests import Request

from katana450.arm.control.lease import Role
from katana450.extensions.importers.formats.shape_file import SECONDS
from katana450.extensions.importers.uploads import WAITING, WAITING_EACH
from katana450.server.web import bodies
from katana450.server.web.access_links import AccessFile
from katana450.server.web.bodies import BODY_SECONDS, body_of
from tests.browser.server import AppServer
from tests.exchange.shape_bytes import zipped
from tests.exchange.test_several_files import PARTS
from tests.gateway.client import HOUR, ask
from tests.gateway.site import open_site
from tests.gateway.virtual import VirtualServer

SLOW_MESHES = 20
"""Number of meshes in a scene that takes 100 s to read."""

BOX: bytes = trimesh.creation.box((20.0, 20.0, 20.0)).export(file_type="stl")


def bearer(file: AccessFile, role: Role) -> str:
    return f"Bearer {file.give('Uploader', role, time.time() + HOUR)}"


def head(server: AppServer, token: str, path: str, length: int) -> bytes:
    """Return the head of an upload."""
    return (
        f"POST /api/v1/{path} HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n"
        f"Authorization: {token}\r\nContent-Length: {length}\r\n\r\n"
    ).encode()


def star(count: int) -> bytes:
    """Return an OBJ file of one polygon, every second corner of which is concave."""
    angle = np.arange(count) * (2.0 * np.pi / count)
    radius = np.where(np.arange(count) % 2, 100.0, 60.0)
    rows = [
        f"v {r * np.cos(a):.6f} {r * np.sin(a):.6f} 0" for r, a in zip(radius, angle, strict=True)
    ]
    return "\n".join((*rows, "f " + " ".join(map(str, range(1, count + 1))))).encode()


def slow_scene() -> bytes:
    """Return a scene of files within the limits, each of which takes some seconds to read."""
    names = [f"star{number}.obj" for number in range(SLOW_MESHES)]
    rows = [
        f"  - {{name: s{number}, shape: mesh, mesh: {{file: {name}}}, pose: [0, 0, 0, 0, 0, 0]}}"
        for number, name in enumerate(names)
    ]
    packed, content = io.BytesIO(), star(64_000)
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("scene.yaml", "\n".join(("scene: 1", "objects:", *rows)))
        for name in names:
            archive.writestr(name, content)
    return packed.getvalue()


@pytest.mark.long
def test_abandoned_scene_stops_being_read(tmp_path: Path) -> None:
    scene = slow_scene()
    with open_site(tmp_path) as (server, file):
        token = bearer(file, Role.OPERATOR)
        with socket.create_connection(("127.0.0.1", server.port)) as left:
            left.sendall(head(server, token, "scene", len(scene)) + scene)
            time.sleep(1.0)
        began = time.monotonic()
        url = f"{server.url}/api/v1/mesh?name=box.stl"
        status, _, body = ask(url, data=BOX, Authorization=bearer(file, Role.OPERATOR))
        assert status == 200, body
        # The scene alone would take its 100 s.
        assert time.monotonic() - began < 2.0 * SECONDS
        assert "Traceback" not in server.output


async def drips(server: VirtualServer, token: str, name: str = "a.stl") -> int:
    """Send a byte of a large file and then nothing; return the status of the answer."""
    messages = [{"type": "http.request", "body": b"x", "more_body": True}]
    answered: list[int] = []

    async def receive() -> dict[str, Any]:
        if not messages:
            await asyncio.Event().wait()
        return messages.pop()

    async def send(message: Any) -> None:
        if message["type"] == "http.response.start":
            answered.append(message["status"])

    scope = server.scope(f"/api/v1/mesh?name={name}", {"authorization": token}) | {"method": "POST"}
    await server.app(scope, receive, send)
    return answered[0]


def test_dripping_uploads_give_their_places_away_and_leave_one_to_an_admin(
    guarded: VirtualServer, file: AccessFile
) -> None:
    async def act() -> None:
        tokens = [bearer(file, Role.OPERATOR) for _ in range(WAITING // WAITING_EACH)]
        began = guarded.loop.time()
        dripping = [
            asyncio.create_task(drips(guarded, token))
            for token in tokens
            for _ in range(WAITING_EACH)
        ]
        await asyncio.sleep(0.3 * BODY_SECONDS)
        assert not any(upload.done() for upload in dripping)
        assert await drips(guarded, tokens[0]) == 429
        assert await drips(guarded, bearer(file, Role.OPERATOR)) == 429
        admin = asyncio.create_task(drips(guarded, bearer(file, Role.ADMIN)))
        assert await asyncio.gather(*dripping, admin) == [408] * (WAITING + 1)
        assert guarded.loop.time() - began < 4.0 * BODY_SECONDS

    guarded.run(act())


def request_of(chunks: AsyncIterator[bytes]) -> Request:
    """Return a request whose body arrives as ``chunks``."""

    async def receive() -> Any:
        async for chunk in chunks:
            return {"type": "http.request", "body": chunk, "more_body": True}
        return {"type": "http.request", "body": b"", "more_body": False}

    return Request({"type": "http", "method": "POST", "headers": []}, receive)


def test_one_file_of_a_zip_is_chosen(local: VirtualServer) -> None:
    pair = zipped(dict.fromkeys(("a.wrl", "b.wrl"), PARTS["parts/x.wrl"]))

    def upload(query: str) -> tuple[int, dict[str, Any]]:
        status, _, body = local.ask(f"/api/v1/mesh?name=pair.zip{query}", data=pair)
        return status, json.loads(body)

    status, answer = upload("")
    assert (status, answer["choices"]) == (422, ["a.wrl", "b.wrl"])
    status, answer = upload("&main=b.wrl")
    assert (status, answer["name"], answer["scale"]) == (200, "b", 1.0)
    status, answer = upload("&main=..%2Fb.wrl")
    assert (status, "no file '../b.wrl'" in answer["why"]) == (422, True)


@pytest.mark.parametrize(("rate", "passes"), [(10_000.0, True), (2_000_000.0, False)])
def test_file_must_arrive_at_the_minimum_rate(
    monkeypatch: pytest.MonkeyPatch, rate: float, passes: bool
) -> None:
    monkeypatch.setattr(bodies, "BODY_SECONDS", 0.04)

    async def chunks() -> AsyncIterator[bytes]:
        for _ in range(10):
            yield bytes(1000)
            await asyncio.sleep(0.02)

    async def act() -> bytes:
        return await body_of(request_of(chunks()), 100_000, 60.0, rate)

    if passes:
        assert len(asyncio.run(act())) == 10_000
        return
    with pytest.raises(HTTPException) as refused:
        asyncio.run(act())
    assert refused.value.status_code == 408
