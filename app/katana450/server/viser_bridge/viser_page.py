"""viser's own page, with our scripts in front of its own, and the hashes that let both run."""

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
"""The one script of the page: it unpacks style and program out of its own attribute."""

DIGITS = "!#$%()*+,-./0123456789:;=?@ABCDEFGHIJKLMNOPQRSTUVWXYZ[\\]^_abcdefghijklmnopqrstuvwxyz{|}~"

OUR_SCRIPTS = ("theme", "viser", "fields", "fit", "sheet", "frame")
"""Names of our files in the order in which they run; the last one is given the themes."""


@dataclass(frozen=True)
class ViserPage:
    """The page as it is served; ``script_hashes`` are those of its inline scripts."""

    html: bytes
    script_hashes: tuple[str, ...]


def load() -> ViserPage:
    """Read it from the installed viser. Raises ConfigurationError for one that is built otherwise.

    The program is a script element that the loader makes, so a browser that runs only scripts of
    known hashes asks for the hash of both.
    """
    html = INDEX.read_text(encoding="utf-8")
    found = LOADER.search(html)
    if found is None or html.count("<script") != 1:
        raise ConfigurationError(f"{INDEX} is not built as that of the pinned viser: install it.")
    packed, style, program, loader = found.groups()
    unpacked = zstandard.ZstdDecompressor().decompress(
        _bytes(packed), max_output_size=int(style) + int(program)
    )
    ours = html[: found.start()] + _our_scripts() + html[found.start() :]
    hashes = (_hash(loader.encode()), _hash(unpacked[int(style) :]))
    return ViserPage(ours.encode(), hashes)


def policy(script_hashes: Sequence[str]) -> str:
    """Return the content security policy of viser's page.

    It allows the page's two scripts, known by their hashes, and what they make.
    """
    return content_policy(
        default=("'none'",),
        script=("'self'", "'wasm-unsafe-eval'", "blob:", *script_hashes),
        # The loader makes the style sheet.
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

    viser's page plays the recording and runs the messages of the server that its address names.
    Only the server at ``origin``, such as ``ws://localhost:8080``, may be named.
    """
    if "playbackPath" in query:
        return "Recordings are not played here."
    for url in query.getlist("websocket"):
        parts = urlsplit(url)
        if f"{parts.scheme}://{parts.netloc}" != origin:
            return "The page may speak to this server alone."
    return None


def _our_scripts() -> str:
    """The script elements, with each theme's colours as viser's messages hold them."""
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
    """Return a PNG file of ``pixels`` (height, width, 3) in base 64."""
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "png")
    return base64.b64encode(file.getvalue()).decode()


def _hash(script: bytes) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(script).digest()).decode()}'"


def _bytes(text: str) -> bytes:
    """Four bytes for each five digits to base 88, and one less than there are left over."""
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
