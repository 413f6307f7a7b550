"""Test uploads that drip, take long or are abandoned: they end, and others get their turn."""

from __future__ import annotations

import asyncio
import io
import socket
import time
import zipfile
from collections.abc import AsyncIterator, Iterator
from typing import Any

import pytest
import trimesh
from starlette.exceptions import HTTPException
from starlette.requests import Request

from katana450.arm.control.lease import Role
from katana450.extensions.importers.shape_file import SECONDS
from katana450.extensions.importers.uploads import WAITING, WAITING_EACH
from katana450.server.web import bodies
from katana450.server.web.access_links import AccessFile
from katana450.server.web.bodies import BODY_SECONDS, body_of
from tests.browser.server import APP, AppServer
from tests.exchange.test_reading_time import star
from tests.gateway.attack import answered, silent
from tests.gateway.client import HOUR, ask

SLOW_MESHES = 20
"""Number of meshes in a scene that takes 100 s to read."""

BOX: bytes = trimesh.creation.box((20.0, 20.0, 20.0)).export(file_type="stl")


@pytest.fixture(scope="module")
def links(tmp_path_factory: pytest.TempPathFactory) -> AccessFile:
    return AccessFile.create(tmp_path_factory.mktemp("uploads") / "access.json")


@pytest.fixture(scope="module")
def server(links: AccessFile) -> Iterator[AppServer]:
    with AppServer((*APP, "--access", str(links.path))) as server:
        yield server


def bearer(links: AccessFile, role: Role) -> str:
    return f"Bearer {links.give('Uploader', role, time.time() + HOUR)}"


def head(server: AppServer, token: str, path: str, length: int) -> bytes:
    """Return the head of an upload."""
    return (
        f"POST /api/v1/{path} HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n"
        f"Authorization: {token}\r\nContent-Length: {length}\r\n\r\n"
    ).encode()


def slow_scene() -> bytes:
    """Return a scene of files within the limits, each of which takes too long to read."""
    names = [f"star{number}.obj" for number in range(SLOW_MESHES)]
    rows = [
        f"  - {{name: s{number}, shape: mesh, mesh: {{file: {name}}}, pose: [0, 0, 0, 0, 0, 0]}}"
        for number, name in enumerate(names)
    ]
    packed, content = io.BytesIO(), star(50_000)
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("scene.yaml", "\n".join(("scene: 1", "objects:", *rows)))
        for name in names:
            archive.writestr(name, content)
    return packed.getvalue()


@pytest.mark.long
def test_abandoned_scene_stops_being_read(server: AppServer, links: AccessFile) -> None:
    scene = slow_scene()
    with socket.create_connection(("127.0.0.1", server.port)) as left:
        left.sendall(head(server, bearer(links, Role.OPERATOR), "scene", len(scene)) + scene)
        time.sleep(1.0)
    began = time.monotonic()
    token = bearer(links, Role.OPERATOR)
    status, _, body = ask(f"{server.url}/api/v1/mesh?name=box.stl", data=BOX, Authorization=token)
    assert status == 200, body
    # The scene alone would take its 100 s.
    assert time.monotonic() - began < 2.0 * SECONDS
    assert "Traceback" not in server.output


def test_dripping_upload_gives_its_place_away(server: AppServer, links: AccessFile) -> None:
    token = bearer(links, Role.OPERATOR)
    drip = head(server, token, "mesh?name=a.stl", 10_000_000) + b"x"
    with silent(server.port, WAITING_EACH, drip) as dripping:
        until = time.monotonic() + 4.0 * BODY_SECONDS
        for each in dripping:
            each.settimeout(max(until - time.monotonic(), 0.1))
            assert each.recv(4096).startswith(b"HTTP/1.1 408 ")


def test_admin_uploads_while_others_drip_in_all_places(
    server: AppServer, links: AccessFile
) -> None:
    drips = [
        head(server, bearer(links, Role.OPERATOR), "mesh?name=a.stl", 10_000_000) + b"x"
        for _ in range(WAITING // WAITING_EACH)
    ]
    with (
        silent(server.port, WAITING_EACH, drips[0]) as a,
        silent(server.port, WAITING_EACH, drips[1]) as b,
    ):
        assert answered([*a, *b], 0.3 * BODY_SECONDS) == 0
        url = f"{server.url}/api/v1/mesh?name=box.stl"
        operator, admin = (bearer(links, role) for role in (Role.OPERATOR, Role.ADMIN))
        assert ask(url, data=BOX, Authorization=operator)[0] == 429
        assert ask(url, data=BOX, Authorization=admin)[0] == 200


def request_of(chunks: AsyncIterator[bytes]) -> Request:
    """Return a request whose body arrives as ``chunks``."""

    async def receive() -> Any:
        async for chunk in chunks:
            return {"type": "http.request", "body": chunk, "more_body": True}
        return {"type": "http.request", "body": b"", "more_body": False}

    return Request({"type": "http", "method": "POST", "headers": []}, receive)


@pytest.mark.parametrize(("rate", "passes"), [(2_000.0, True), (2_000_000.0, False)])
def test_file_must_arrive_at_the_minimum_rate(
    monkeypatch: pytest.MonkeyPatch, rate: float, passes: bool
) -> None:
    monkeypatch.setattr(bodies, "BODY_SECONDS", 0.2)

    async def chunks() -> AsyncIterator[bytes]:
        for _ in range(10):
            yield bytes(1000)
            await asyncio.sleep(0.1)

    async def act() -> bytes:
        return await body_of(request_of(chunks()), 100_000, 60.0, rate)

    if passes:
        assert len(asyncio.run(act())) == 10_000
        return
    with pytest.raises(HTTPException) as refused:
        asyncio.run(act())
    assert refused.value.status_code == 408
