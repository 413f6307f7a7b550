"""Pictures of one camera as JPEG files: from an address in the network, a device, or a film."""

from __future__ import annotations

import base64
import time
from collections.abc import Iterator
from http.client import (
    HTTPConnection,
    HTTPException,
    HTTPResponse,
    HTTPSConnection,
    parse_headers,
)
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote, urlsplit

from katana450.errors import KatanaError
from katana450.extras import library

EXTRA = "cameras"
"""Name of the extra, see ``needs_extra``."""

PURPOSE = "Cameras of this machine, of RTSP, and films"
"""Cameras that need the extra, as the subject of a sentence."""

SIMULATED = "simulated:"
"""Beginning of the address of a camera of the simulation, before its view."""

BROWSER = "browser"
"""Address of a camera that a person shares on the page."""

MAX_FRAME_BYTES = 4_000_000
"""[bytes] Maximum size of a picture; one of 640x480 takes 20 to 60 kB."""

MAX_LINE_BYTES = 8192

TIMEOUT = 3.0
"""[s] Silence after which a camera counts as lost, and is connected again."""

SIZE = 640, 480
"""[px] Width and height that a device is asked for."""

QUALITY = 80
"""Quality of the JPEG files that are made here, of 100."""

JPEG = b"\xff\xd8"
"""First bytes of every JPEG file."""


class CameraError(KatanaError):
    """A camera sends no pictures, for a reason that goes into a sentence after its name."""


class CameraFrame(NamedTuple):
    """A picture.

    Attributes:
        t: time of its receipt on the clock of the session [s].
        jpeg: the picture as a JPEG file.
    """

    t: float
    jpeg: bytes


def is_mjpeg(address: str) -> bool:
    """Return whether ``address`` is one of MJPEG over HTTP."""
    return urlsplit(address).scheme in ("http", "https")


def needs_extra(address: str) -> bool:
    """Return whether the camera at ``address`` is read by a library of the extra."""
    return not (is_mjpeg(address) or address == BROWSER or address.startswith(SIMULATED))


def frames(address: str) -> Iterator[CameraFrame]:
    """Yield the pictures of the camera at ``address``, as they come.

    Raises CameraError when it cannot be reached or sends no more, and MissingExtraError.
    """
    return _mjpeg_frames(address) if is_mjpeg(address) else _captured_frames(address)


def _mjpeg_frames(address: str) -> Iterator[CameraFrame]:
    url = urlsplit(address)
    kind = HTTPSConnection if url.scheme == "https" else HTTPConnection
    try:
        connection = kind(url.hostname or "", url.port, timeout=TIMEOUT)
    except (ValueError, HTTPException) as error:
        raise CameraError(f"has an invalid address: {error}") from error
    headers = {}
    if url.username is not None:
        pair = f"{unquote(url.username)}:{unquote(url.password or '')}"
        headers["Authorization"] = f"Basic {base64.b64encode(pair.encode()).decode()}"
    try:
        query = f"?{url.query}" if url.query else ""
        connection.request("GET", f"{url.path or '/'}{query}", headers=headers)
        response = connection.getresponse()
        if response.status != 200:
            raise CameraError(f"answers {response.status} {response.reason}")
        media_type = response.headers.get_content_type()
        boundary = response.headers.get_param("boundary")
        if media_type != "multipart/x-mixed-replace" or not isinstance(boundary, str):
            raise CameraError(f"sends {media_type}, not MJPEG (multipart/x-mixed-replace)")
        # Some cameras put the dashes of the separator into its name.
        separator = b"--" + boundary.removeprefix("--").encode()
        while True:
            jpeg = _next_part(response, separator)
            yield CameraFrame(time.perf_counter(), jpeg)
    except TimeoutError as error:
        raise CameraError(f"has been silent for {TIMEOUT:g} s") from error
    except HTTPException as error:
        raise CameraError("answers something that is no HTTP") from error
    except OSError as error:
        raise CameraError(f"cannot be reached: {error.strerror or error}") from error
    finally:
        connection.close()


def _next_part(response: HTTPResponse, separator: bytes) -> bytes:
    """Return the next picture of ``response``. Raises CameraError at its end, and OSError."""
    while not (line := response.readline(MAX_LINE_BYTES)).startswith(separator):
        if not line:
            raise CameraError("has ended its pictures")
    length = parse_headers(response).get("Content-Length", "")
    if not length.isdecimal():
        raise CameraError("sends pictures without their length (Content-Length)")
    if int(length) > MAX_FRAME_BYTES:
        raise CameraError(f"sends pictures above {MAX_FRAME_BYTES // 1_000_000} MB")
    jpeg = response.read(int(length))
    if not jpeg.startswith(JPEG) or len(jpeg) < int(length):
        raise CameraError("sends pictures that are no JPEG files")
    return jpeg


def _captured_frames(address: str) -> Iterator[CameraFrame]:
    cv2 = library("cv2", EXTRA, PURPOSE)
    capture = cv2.VideoCapture(int(address) if address.isdecimal() else address)
    is_film = Path(address).is_file()
    try:
        if not capture.isOpened():
            raise CameraError("cannot be opened: there is no such device, film or address")
        if not is_film:
            capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG"))
            for name, pixels in zip(("WIDTH", "HEIGHT"), SIZE, strict=True):
                capture.set(getattr(cv2, f"CAP_PROP_FRAME_{name}"), pixels)
            # Otherwise pictures wait in a queue, and are old when they are read.
            capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        period = 1.0 / (capture.get(cv2.CAP_PROP_FPS) or 30.0)
        while True:
            t = time.perf_counter()
            is_read, picture = capture.read()
            if not is_read:
                raise CameraError("has ended its pictures")
            if is_film:
                time.sleep(max(t + period - time.perf_counter(), 0.0))
            t = time.perf_counter()
            _, jpeg = cv2.imencode(".jpg", picture, (cv2.IMWRITE_JPEG_QUALITY, QUALITY))
            yield CameraFrame(t, jpeg.tobytes())
    finally:
        capture.release()
