"""viser's own page with our scripts before its own, and the hashes that allow its scripts."""

from __future__ import annotations

import base64
import hashlib
import io
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import numpy.typing as npt
import viser
import zstandard
from PIL import Image
from starlette.datastructures import QueryParams

from katana450.errors import ConfigurationError
from katana450.server.viser_bridge.themes import THEMES, gradient
from katana450.server.web.security import content_policy

INDEX = Path(viser.__file__).parent / "client" / "build" / "index.html"

LOADER = re.compile(
    r'<script data-p="([^"]*)" data-ss="(\d+)" data-cs="(\d+)">(.*?)</script>', re.DOTALL
)
"""The only script of viser's page, which unpacks style and program from its own attribute."""

DIGITS = "!#$%()*+,-./0123456789:;=?@ABCDEFGHIJKLMNOPQRSTUVWXYZ[\\]^_abcdefghijklmnopqrstuvwxyz{|}~"
"""Digits of the base 88 in which viser's page contains its packed program."""

OUR_SCRIPTS = ("theme", "viser", "fields", "fit", "sheet", "names", "frame")
"""Names of our files in the order in which they run. The last one gets the themes."""


@dataclass(frozen=True)
class ViserPage:
    """The page as it is served, and the hashes of its inline scripts."""

    html: bytes
    script_hashes: tuple[str, ...]


def load() -> ViserPage:
    """Read the page from the installed viser.

    Its loader creates a script element with the program. A browser that runs only scripts with
    known hashes therefore needs the hashes of both. Raises ConfigurationError if the page has
    another structure.
    """
    html = INDEX.read_text(encoding="utf-8")
    found = LOADER.search(html)
    if found is None or html.count("<script") != 1:
        raise ConfigurationError(
            f"{INDEX} is not the page of the pinned viser: install the pinned version."
        )
    packed, style, program, loader = found.groups()
    unpacked = zstandard.ZstdDecompressor().decompress(
        _bytes(packed), max_output_size=int(style) + int(program)
    )
    ours = html[: found.start()] + _our_scripts() + html[found.start() :]
    hashes = (_hash(loader.encode()), _hash(unpacked[int(style) :]))
    return ViserPage(ours.encode(), hashes)


def policy(script_hashes: Sequence[str]) -> str:
    """Return the content security policy of viser's page.

    It allows the two scripts of the page by their hashes, and everything that they create.
    """
    return content_policy(
        default=("'none'",),
        script=("'self'", "'wasm-unsafe-eval'", "blob:", *script_hashes),
        # The loader creates the style sheet.
        style=("'unsafe-inline'",),
        img=("'self'", "data:", "blob:"),
        font=("data:",),
        media=("data:", "blob:"),
        connect=("'self'", "data:", "blob:"),
        worker=("blob:", "data:"),
        ends=("base-uri 'none'", "form-action 'none'", "frame-ancestors 'self'"),
    )


def objection(query: QueryParams, origin: str) -> str | None:
    """Return why viser's page is not served with ``query``, or None if it is.

    The address of viser's page can name a recording to play or a server to connect to. Recordings
    are refused, and only the server at ``origin``, such as ``ws://localhost:8080``, may be named.
    """
    if "playbackPath" in query:
        return "This server does not play recordings. Remove playbackPath from the address."
    for url in query.getlist("websocket"):
        parts = urlsplit(url)
        if f"{parts.scheme}://{parts.netloc}" != origin:
            return "The page may connect only to this server. Remove websocket from the address."
    return None


def _our_scripts() -> str:
    """Return the script elements, with the colours of each theme as in viser's messages."""
    rooms = {
        name: {
            "cell_color": theme.cell,
            "section_color": theme.section,
            "plane_color": theme.floor,
            "shadow_opacity": theme.shadow,
            "dark": theme.dark,
            "sky": _png(gradient(theme.sky, theme.floor)),
        }
        for name, theme in THEMES.items()
    }
    *first, last = (f'src="../static/{name}.js"' for name in OUR_SCRIPTS)
    last += f' data-rooms="{escape(json.dumps(rooms))}"'
    return "".join(f"<script {each}></script>" for each in (*first, last))


def _png(pixels: npt.NDArray[np.uint8]) -> str:
    """Return ``pixels`` (height, width, 3) as a PNG file in base 64."""
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "png")
    return base64.b64encode(file.getvalue()).decode()


def _hash(script: bytes) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(script).digest()).decode()}'"


def _bytes(text: str) -> bytes:
    """Decode base 88: each 5 digits give 4 bytes, and n remaining digits give n - 1 bytes."""
    value = np.zeros(128, dtype=np.uint64)
    value[[ord(digit) for digit in DIGITS]] = np.arange(len(DIGITS))
    digits: npt.NDArray[np.uint64] = value[np.frombuffer(text.encode("ascii"), np.uint8)]
    whole, left = divmod(len(digits), 5)
    powers = np.array([88**power for power in (4, 3, 2, 1, 0)], dtype=np.uint64)
    words = digits[: 5 * whole].reshape(whole, 5) @ powers
    rest = 0
    for digit in digits[5 * whole :]:
        rest = rest * 88 + int(digit)
    size = max(left - 1, 0)
    whole_words: bytes = words.astype(">u4").tobytes()
    last: bytes = (rest % 256**size).to_bytes(size, "big")
    return whole_words + last
