"""Pictures of an MJPEG camera, and what goes wrong with one."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import pytest

from katana450.arm.runtime.pipes.private_listener import PrivateAddress
from katana450.cli.main import main
from katana450.extensions.cameras import sources
from katana450.extensions.cameras.camera_link import CameraLink
from katana450.extensions.cameras.sources import CameraError, frames
from tests.cameras.mjpeg_camera import MjpegCamera, picture, stamp_of
from tests.exchange.tools import OPENCV, needs_package


@pytest.fixture
def camera() -> Iterator[MjpegCamera]:
    with MjpegCamera(fps=100.0) as running:
        yield running


@pytest.fixture
def answer() -> Iterator[tuple[str, list[bytes]]]:
    """Return the address of a server, and the list that is to have its whole answer."""
    content: list[bytes] = []
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def serve() -> None:
            connection, _ = listening.accept()
            with connection:
                connection.recv(65536)
                connection.sendall(content[0])

        threading.Thread(target=serve, daemon=True).start()
        yield f"http://127.0.0.1:{listening.getsockname()[1]}/stream", content


MJPEG = b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=--b\r\n\r\n"


def part(content: bytes, length: int | None = None) -> bytes:
    return (
        b"--b\r\nContent-Length: %d\r\n\r\n" % (len(content) if length is None else length)
        + content
    )


def test_pictures_come_in_their_order_with_the_times_of_their_receipt(camera: MjpegCamera) -> None:
    got = list(islice(frames(camera.url), 20))
    for place, (t, jpeg) in enumerate(got):
        number, sent = stamp_of(jpeg)
        assert number == place
        assert jpeg.endswith(picture(number)[2:])
        assert 0.0 < t - sent < 0.2


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"HTTP/1.1 401 Unauthorized\r\n\r\n", "answers 401 Unauthorized"),
        (b"HTTP/1.1 200 OK\r\nContent-Type: text/html\r\n\r\n<p>", "sends text/html, not MJPEG"),
        (MJPEG + b"--b\r\n\r\n" + picture(0), "without their length"),
        (MJPEG + part(b"GIF89a"), "are no JPEG files"),
        (MJPEG + part(picture(0)[:100], 200), "are no JPEG files"),
        (MJPEG + part(b"", 4_000_001), "pictures above 4 MB"),
        (MJPEG, "has ended its pictures"),
        (b"SSH-2.0-OpenSSH\r\n", "answers something that is no HTTP"),
        (MJPEG + b"--b\r\n" + b"A: b\r\n" * 200, "answers something that is no HTTP"),
    ],
)
def test_problem_is_a_sentence(
    answer: tuple[str, list[bytes]], content: bytes, problem: str
) -> None:
    address, contents = answer
    contents.append(content)
    with pytest.raises(CameraError, match=problem):
        list(frames(address))


def test_camera_that_is_silent_or_away_is_lost(
    camera: MjpegCamera, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sources, "TIMEOUT", 0.1)
    camera.fps = 0.0
    began = time.perf_counter()
    with pytest.raises(CameraError, match=r"has been silent for 0\.1 s"):
        next(frames(camera.url))
    assert time.perf_counter() - began < 2.0
    with socket.create_server(("127.0.0.1", 0)) as closed:
        port = closed.getsockname()[1]
    with pytest.raises(CameraError, match="cannot be reached: Connection refused"):
        next(frames(f"http://127.0.0.1:{port}/"))
    with pytest.raises(CameraError, match="invalid address"):
        next(frames("http://127.0.0.1:port/"))


def test_pages_that_come_and_go_share_one_thread() -> None:
    link = CameraLink(PrivateAddress("/nowhere", b""))
    for _ in range(5):
        with link.watching(lambda: None):
            pass
    with link.watching(lambda: None):
        assert [thread.name for thread in threading.enumerate()].count("cameras") == 1


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        (["table"], "'table' is not NAME=SOURCE"),
        (["on the table=0"], "is not NAME=SOURCE"),
        (["table=http://a/", "table=http://b/"], "Two cameras have the same name"),
        ([f"{name}=http://a/" for name in "abcde"], "There are 5 cameras, of at most 4"),
        (["table=/dev/video0"], "need the extra 'cameras'"),
        (["table=simulated:foot"], "no camera simulated:foot. Take simulated:wrist or simulated:o"),
    ],
)
def test_invalid_options_are_refused(
    options: list[str], problem: str, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [part for option in options for part in ("--camera", option)]
    with pytest.raises(SystemExit) as end:
        raise SystemExit(main(["serve", "--port", "0", "--no-record", *arguments]))
    assert end.value.code != 0
    assert problem in capsys.readouterr().err


FILM = """
import itertools, sys, cv2, numpy
from katana450.extensions.cameras.sources import CameraError, frames
out = cv2.VideoWriter(sys.argv[1], cv2.VideoWriter.fourcc(*"MJPG"), 50.0, (64, 48))
for level in range(0, 250, 25):
    out.write(numpy.full((48, 64, 3), level, numpy.uint8))
out.release()
try:
    for t, jpeg in frames(sys.argv[1]):
        picture = cv2.imdecode(numpy.frombuffer(jpeg, numpy.uint8), cv2.IMREAD_COLOR)
        print(t, round(picture.mean() / 25), *picture.shape)
except CameraError as error:
    print(error)
try:
    next(frames("/dev/video99"))
except CameraError as error:
    print(error)
"""


@pytest.mark.long
@needs_package(OPENCV)
def test_film_is_shown_at_its_pace_by_opencv(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", FILM, str(tmp_path / "film.avi")],
        env={**os.environ, "PYTHONPATH": str(OPENCV.folder)},
        check=True,
        capture_output=True,
        text=True,
    )
    *pictures, end, missing = done.stdout.splitlines()
    times, contents = zip(*(line.split(" ", 1) for line in pictures), strict=True)
    assert list(contents) == [f"{number} 48 64 3" for number in range(10)]
    assert float(times[-1]) - float(times[0]) >= 9 / 50
    assert end == "has ended its pictures"
    assert "no such device" in missing
