"""Static files of the page: read and compressed once, with an ETag of their content."""

from __future__ import annotations

import gzip
import hashlib
import re
from dataclasses import dataclass
from pathlib import Path

from starlette.requests import Request
from starlette.responses import Response

from katana450.resources import STATIC

TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".svg": "image/svg+xml",
}

COMMENT = re.compile(
    rb"""^[ \t]*(?://.*|/\*\*(?:[^*]|\*(?!/))*\*/)$|(?<=[;,{]) // [^"'`\n]*$""", re.MULTILINE
)
"""Pattern of a comment in a script: on lines of its own, or at the end of a line without quotes."""


@dataclass(frozen=True)
class File:
    """A static file, ready to be sent.

    Attributes:
        content: its content.
        packed: content compressed by gzip.
        media_type: type of its content.
        tag: ETag.
    """

    content: bytes
    packed: bytes
    media_type: str
    tag: str

    @classmethod
    def of(cls, content: bytes, media_type: str) -> File:
        """Return the file with ``content``."""
        tag = f'"{hashlib.sha256(content).hexdigest()[:20]}"'
        return cls(content, gzip.compress(content, mtime=0), media_type, tag)

    def answer(self, request: Request, policy: str | None = None) -> Response:
        """Return the response to ``request``: 304 if the browser already has the content."""
        headers = {"ETag": self.tag, "Cache-Control": "no-cache", "Vary": "Accept-Encoding"}
        if policy is not None:
            headers["Content-Security-Policy"] = policy
        if self.tag in request.headers.get("if-none-match", ""):
            return Response(status_code=304, headers=headers)
        if "gzip" in request.headers.get("accept-encoding", ""):
            headers["Content-Encoding"] = "gzip"
            return Response(self.packed, headers=headers, media_type=self.media_type)
        return Response(self.content, headers=headers, media_type=self.media_type)


def contents(folder: Path = STATIC) -> dict[str, bytes]:
    """Return the content of every file of the page by its path in ``folder``.

    Comments of scripts, a quarter of what would be sent, become blank lines: lines keep their
    numbers.
    """
    return {
        file.relative_to(folder).as_posix(): COMMENT.sub(_blank, text)
        if file.suffix == ".js"
        else text
        for file in sorted(folder.rglob("*"))
        if file.suffix in TYPES
        for text in (file.read_bytes().replace(b"\r\n", b"\n"),)
    }


def _blank(comment: re.Match[bytes]) -> bytes:
    return b"\n" * comment[0].count(b"\n")
