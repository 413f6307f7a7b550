"""Cameras of a real server: their pictures with their ages, and the arm without them."""

from __future__ import annotations

import io
import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from PIL import Image
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.sync.connection import Connection

import katana450
from katana450.arm.control.lease import Role
from katana450.extensions.cameras.camera_link import AGE
from katana450.server.web.access_links import AccessFile
from tests.browser.server import APP, AppServer
from tests.cameras.mjpeg_camera import MjpegCamera, picture
from tests.gateway.client import ask, enter
from tests.gateway.test_access import give
from tests.waiting import until


@pytest.fixture(scope="module")
def camera() -> Iterator[MjpegCamera]:
    with MjpegCamera() as running:
        yield running


@pytest.fixture(scope="module")
def server(camera: MjpegCamera) -> Iterator[AppServer]:
    with AppServer(
        (
            *(*APP, f"--camera=table={camera.url}", "--camera=away=http://127.0.0.1:9/"),
            *("--camera=mine=browser", "--camera=hand=simulated:wrist"),
        )
    ) as it:
        yield it


@contextmanager
def opened(server: AppServer, name: str, query: str = "") -> Iterator[Connection]:
    with connect(f"{server.url.replace('http', 'ws')}/api/v1/cameras/{name}{query}") as socket:
        yield socket


def asked(socket: Connection) -> tuple[float, bytes] | str:
    """Ask for the next picture; return its age [s] and its file, or why there is none."""
    socket.send("")
    message = socket.recv(10.0)
    if isinstance(message, str):
        return message
    return AGE.unpack_from(message)[0], message[AGE.size :]


def wait_for_picture(socket: Connection) -> None:
    until(lambda: not isinstance(asked(socket), str))


def test_pictures_are_new_and_a_slow_page_gets_fewer(server: AppServer) -> None:
    with opened(server, "table") as socket:
        wait_for_picture(socket)
        got = [asked(socket) for _ in range(30)]
        assert len({part[1] for part in got if isinstance(part, tuple)}) == 30
        # None waits for a page that does not ask.
        time.sleep(1.0)
        answer = asked(socket)
        assert isinstance(answer, tuple)
        assert 0.0 <= answer[0] < 0.8


def test_simulated_hand_sees_where_the_arm_is(server: AppServer) -> None:
    with opened(server, "hand") as socket:
        wait_for_picture(socket)
        before = asked(socket)
        with katana450.connect(server.url) as arm:
            arm.nudge(1, 0.3)
        assert isinstance(before, tuple)
        until(lambda: asked(socket)[1] != before[1])
        # At rest the same picture comes again, as new as the state.
        until(lambda: asked(socket)[1] == asked(socket)[1])
        answer = asked(socket)
        assert isinstance(answer, tuple)
        assert answer[0] < 1.0
        assert Image.open(io.BytesIO(answer[1])).size == (320, 240)


def test_camera_that_cannot_be_reached_says_why(server: AppServer) -> None:
    with opened(server, "away") as socket:
        until(lambda: "cannot be reached: Connection refused" in str(asked(socket)))
    with opened(server, "none") as socket, pytest.raises(ConnectionClosed, match="no camera none"):
        asked(socket)


def share(server: AppServer, query: str, jpeg: bytes, camera: str = "mine") -> tuple[int, str]:
    """Send a picture as a page does; return the status and the answer."""
    address = f"{server.url}/api/v1/cameras/{camera}?{query}"
    status, _, text = ask(address, data=jpeg, Cookie=enter(server.url), Origin=server.url)
    return status, text.decode()


def test_picture_that_a_page_shares_is_shown_with_its_age(server: AppServer) -> None:
    with opened(server, "mine") as socket:
        until(lambda: "Nobody shares this camera yet." in str(asked(socket)))
        assert share(server, "page=a&age=0.2", picture(3)) == (204, "")
        answer = asked(socket)
        assert isinstance(answer, tuple)
        assert 0.2 <= answer[0] < 2.0
        assert answer[1] == picture(3)
    status, why = share(server, "page=b&age=0", picture(3))
    assert status == 409
    assert "Another window shares" in why
    for query, jpeg, camera_name, code in (
        ("page=a&age=0", b"GIF", "mine", 422),
        ("page=a&age=11", picture(3), "mine", 422),
        ("page=a&age=x", picture(3), "mine", 422),
        ("page=a&age=0", bytes(1_000_001), "mine", 413),
        ("page=a&age=0", picture(3), "table", 404),
    ):
        assert share(server, query, jpeg, camera_name)[0] == code


def test_arm_is_driven_while_the_process_of_the_cameras_is_away(server: AppServer) -> None:
    with opened(server, "table") as socket:
        wait_for_picture(socket)
        os.kill(server.child("katana450 cam"), signal.SIGKILL)
        with katana450.connect(server.url, name="Ada") as arm:
            arm.nudge(1, 0.1)
        wait_for_picture(socket)


@pytest.mark.long
def test_viewers_see_no_camera_that_is_for_drivers(camera: MjpegCamera, tmp_path: Path) -> None:
    file = AccessFile.create(tmp_path / "access.json")
    tokens = {role: give(file, role) for role in (Role.VIEWER, Role.OPERATOR)}
    options = f"--camera=table={camera.url}", "--cameras-for=drivers", f"--access={file.path}"
    with AppServer((*APP, *options)) as server:
        with opened(server, "table", f"?token={tokens[Role.OPERATOR]}") as socket:
            wait_for_picture(socket)
        for query, why in ((f"?token={tokens[Role.VIEWER]}", "who may drive"), ("", "token")):
            with (
                opened(server, "table", query) as socket,
                pytest.raises(ConnectionClosed, match=why),
            ):
                asked(socket)
