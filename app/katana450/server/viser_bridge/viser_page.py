"""viser's own page, unpacked, with our scripts before its own.

viser's page unpacks itself in the browser, from its own attribute: the program is then compiled in
one piece while nothing else happens. As a file of its own it is compiled while it arrives.
"""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import urlsplit

import zstandard
from starlette.datastructures import QueryParams

from katana450.disk_cache import kept
from katana450.errors import ConfigurationError
from katana450.server.web.security import content_policy
from katana450.server.web.static_files import File

_VISER = find_spec("viser")
INDEX = Path((_VISER and _VISER.origin) or "").parent / "client" / "build" / "index.html"

LOADER = re.compile(
    r'<script data-p="([^"]*)" data-ss="(\d+)" data-cs="(\d+)">(.*?)</script>', re.DOTALL
)
"""The only script of viser's page, which unpacks style and program from its own attribute."""

DIGITS = "!#$%()*+,-./0123456789:;=?@ABCDEFGHIJKLMNOPQRSTUVWXYZ[\\]^_abcdefghijklmnopqrstuvwxyz{|}~"
"""Digits of the base 88 in which viser's page contains its packed program."""

DECODER = re.compile(r'const gzWasm="((?:[^"\\]|\\.)*)"')
"""The decoder of zstd in the loader, packed by gzip. viser's program expects it compiled."""

PROGRAM, DECODER_FILE = "program.js", "zstd.wasm"
"""Names of the files beside the page."""

LOADING = f"""<link rel="modulepreload" href="{PROGRAM}">
<link rel="preload" href="{DECODER_FILE}" as="fetch" crossorigin>"""
"""Elements that load the files before ``static/viser.js`` needs them."""

SCRIPTS = "viser-scripts.js"
"""Name of the file with our modules for viser's page. Its element gets the themes."""


@dataclass(frozen=True)
class ViserPage:
    """The page as it is served, and the files beside it by name."""

    html: File
    files: Mapping[str, File]


def load() -> ViserPage:
    """Read the page from the installed viser.

    Raises ConfigurationError if the page has another structure.
    """
    data = INDEX.read_bytes()

    def page() -> ViserPage:
        head, rest, files = _unpacked(data.decode())
        html = f"{head}{LOADING}{_our_script()}{rest}".encode()
        return ViserPage(File.of(html, "text/html; charset=utf-8"), files)

    # Computing it imports numpy and viser.
    return kept(page, ViserPage, data, zstandard.__version__)


def _unpacked(html: str) -> tuple[str, str, Mapping[str, File]]:
    """Return the page before and after the place of our scripts, and its files."""
    loader = LOADER.search(html)
    decoder = DECODER.search("" if loader is None else loader[4])
    if loader is None or decoder is None or html.count("<script") != 1:
        raise ConfigurationError(
            f"{INDEX} is not the page of the pinned viser: install the pinned version."
        )
    packed, style_size, size = loader[1], int(loader[2]), int(loader[3])
    decompress = zstandard.ZstdDecompressor().decompress
    both = decompress(_bytes(packed), max_output_size=style_size + size)
    style, program = both[:style_size].decode(), both[style_size:]
    wasm = gzip.decompress(_bytes(decoder[1].replace("\\\\", "\\")))
    files = {
        PROGRAM: File.of(program, "text/javascript; charset=utf-8"),
        DECODER_FILE: File.of(wasm, "application/wasm"),
    }
    head, rest = html[: loader.start()], html[loader.end() :]
    return f"{head}<style>{style}</style>", rest, files


def policy() -> str:
    """Return the content security policy of viser's page."""
    return content_policy(
        default=("'none'",),
        script=("'self'", "'wasm-unsafe-eval'", "blob:"),
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


def _our_script() -> str:
    """Return the script element, with the colours of each theme as in viser's messages."""
    from katana450.server.viser_bridge.themes import THEMES, sky

    rooms = {
        name: {
            "cell_color": theme.cell,
            "section_color": theme.section,
            "plane_color": theme.floor,
            "shadow_opacity": theme.shadow,
            "dark": theme.dark,
            "sky": base64.b64encode(sky(theme)).decode(),
        }
        for name, theme in THEMES.items()
    }
    return f'<script src="../static/{SCRIPTS}" data-rooms="{escape(json.dumps(rooms))}"></script>'


def _bytes(text: str) -> bytes:
    """Decode base 88: each 5 digits give 4 bytes, and n remaining digits give n - 1 bytes."""
    import numpy as np

    value = np.zeros(128, dtype=np.uint64)
    value[[ord(digit) for digit in DIGITS]] = np.arange(len(DIGITS))
    digits = value[np.frombuffer(text.encode("ascii"), np.uint8)]
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
