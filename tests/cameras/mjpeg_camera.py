"""A camera in the network: a real HTTP server that sends MJPEG, for tests and tries by hand.

``python -m tests.cameras.mjpeg_camera PORT`` runs one until Ctrl-C.
"""

from __future__ import annotations

import io
import struct
import sys
import threading
import time
from functools import cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Self

from PIL import Image, ImageDraw

PICTURES = 30
"""Number of different pictures, which are sent one after the other."""


@cache
def picture(number: int, size: tuple[int, int] = (640, 480)) -> bytes:
    """Return a JPEG file on which a bar moves from the left to the right with ``number``."""
    image = Image.linear_gradient("L").resize(size).convert("RGB")
    x = size[0] * (number % PICTURES) / PICTURES
    ImageDraw.Draw(image).rectangle((x, 0, x + 20, size[1]), fill=(200, 30, 30))
    file = io.BytesIO()
    image.save(file, "JPEG", quality=80)
    return file.getvalue()


COMMENT = struct.Struct(">2sHdd")
"""Comment of a JPEG file with the number of its picture and the time at which it was sent [s]."""


def stamped(jpeg: bytes, number: int) -> bytes:
    """Return ``jpeg`` with ``number`` and the present time on the clock of the session [s]."""
    size = COMMENT.size - 2
    return jpeg[:2] + COMMENT.pack(b"\xff\xfe", size, number, time.perf_counter()) + jpeg[2:]


def stamp_of(jpeg: bytes) -> tuple[int, float]:
    """Return the number and the time of a picture that was stamped."""
    _, _, number, t = COMMENT.unpack_from(jpeg, 2)
    return int(number), t


class MjpegCamera:
    """A context manager around the server.

    Attributes:
        url: its address.
        fps: pictures a second; 0 while it is silent.
    """

    def __init__(self, port: int = 0, fps: float = 30.0) -> None:
        camera = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=picture")
                self.end_headers()
                number, due = 0, time.perf_counter()
                while not camera.ended.is_set():
                    if not camera.fps:
                        time.sleep(0.01)
                        continue
                    jpeg = stamped(picture(number % PICTURES), number)
                    head = f"--picture\r\nContent-Type: image/jpeg\r\nContent-Length: {len(jpeg)}"
                    try:
                        self.wfile.write(f"{head}\r\n\r\n".encode() + jpeg + b"\r\n")
                    except OSError:
                        return
                    number, due = number + 1, max(due + 1.0 / camera.fps, time.perf_counter())
                    time.sleep(max(due - time.perf_counter(), 0.0))

            def log_message(self, *_: Any) -> None:
                """Print nothing."""

        self.fps, self.ended = fps, threading.Event()
        self._server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
        self.url = f"http://127.0.0.1:{self._server.server_port}/stream"

    def __enter__(self) -> Self:
        threading.Thread(target=self._server.serve_forever, daemon=True).start()
        return self

    def __exit__(self, *_error: object) -> None:
        self.ended.set()
        self._server.shutdown()
        self._server.server_close()


if __name__ == "__main__":
    with MjpegCamera(int(sys.argv[1])) as running:
        print(running.url, flush=True)
        running.ended.wait()
