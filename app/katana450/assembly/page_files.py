"""The files of our page as they are sent: the modules that a document loads at first in one file.

Each request takes the browser and the server some milliseconds of the start.
"""

from __future__ import annotations

import base64
import hashlib
import posixpath
import re
from collections.abc import Mapping
from pathlib import Path

from katana450.disk_cache import kept
from katana450.server.viser_bridge.viser_page import SCRIPTS
from katana450.server.web.static_files import TYPES, File, contents

INDEX, THEME = "index.html", "theme.js"
"""Our page, and its first module, which sets the theme before anything is drawn."""

THEME_ELEMENT = b'<script type="module" src="static/theme.js"></script>'
"""Element of that module in the page, which contains it when it is sent."""

PAGE_ELEMENT = b'<script type="module" src="static/page.js"></script>'
"""Element of the module of our page, which loads the others."""

PAGE_SCRIPTS = "page-scripts.js"
"""Name of the file with all modules that our page loads at first."""

ENTRIES = {PAGE_SCRIPTS: "page.js", SCRIPTS: "frame.js"}
"""Modules of our page and of viser's, by the names of the files with all that they import."""

STATIC_IMPORT = re.compile(
    rb'^import (?:(?:\* as (\w+)|(\{[^}]*\})) from )?"([^"]+)";$', re.MULTILINE
)
DYNAMIC_IMPORT = re.compile(rb'\bimport\("(\.[^"]+)"\)')
EXPORT = re.compile(rb"^export (?=(?:const|class|(?:async )?function) (\w+))", re.MULTILINE)
UNKNOWN = re.compile(rb"^(?:export|import)\b(?! ?\().*$", re.MULTILINE)
"""Patterns of the forms of import and export that are put together, and of all others."""


def load() -> dict[str, File]:
    """Return every file of the page by its path, with the modules of each document in one file."""
    files = contents()
    theme = b"<script>%s</script>" % put_together(THEME, files)
    page = f'<script src="static/{PAGE_SCRIPTS}" defer></script>'.encode()
    files[INDEX] = files[INDEX].replace(THEME_ELEMENT, theme).replace(PAGE_ELEMENT, page)
    files |= {name: put_together(entry, files) for name, entry in ENTRIES.items()}

    def packed() -> dict[str, File]:
        return {name: File.of(text, TYPES[Path(name).suffix]) for name, text in files.items()}

    return kept(packed, dict[str, File], *files, *files.values())


def put_together(entry: str, files: Mapping[str, bytes]) -> bytes:
    """Return the module ``entry`` and all that it imports as one script without imports.

    Each module is a function that returns its exports, after those that it imports. What is
    imported later, by ``import()``, stays a file. Raises ValueError for an import or export that
    is not understood.
    """
    numbers: dict[str, int] = {}
    parts: list[bytes] = []

    def add(path: str) -> int:
        """Add the module at ``path`` after its imports; return its number."""
        if path not in numbers:
            folder = posixpath.dirname(path)
            exports = [match[1] for match in EXPORT.finditer(files[path])]

            def imported(match: re.Match[bytes]) -> bytes:
                number = add(posixpath.normpath(posixpath.join(folder, match[3].decode())))
                names = match[1] or (match[2] or b"").replace(b" as ", b": ")
                return b"const %s = m%d;" % (names, number) if names else b""

            def later(match: re.Match[bytes]) -> bytes:
                target = posixpath.normpath(posixpath.join(folder, match[1].decode()))
                return b'import("./%s")' % target.encode()

            body = DYNAMIC_IMPORT.sub(
                later, STATIC_IMPORT.sub(imported, EXPORT.sub(b"", files[path]))
            )
            unknown = UNKNOWN.search(body)
            if unknown is not None:
                raise ValueError(f"{path} cannot be put together: {unknown[0].decode()}")
            number = numbers[path] = len(numbers)
            parts.append(
                b"const m%d = (() => {\n%s\nreturn { %s };\n})();\n"
                % (number, body, b", ".join(exports))
            )
        return numbers[path]

    add(entry)
    return b'(() => {\n"use strict";\n%s})();\n' % b"".join(parts)


def source(page: File) -> str:
    """Return the source that allows the script in ``page``, for its content security policy."""
    script = page.content.partition(b"<script>")[2].partition(b"</script>")[0]
    return f"'sha256-{base64.b64encode(hashlib.sha256(script).digest()).decode()}'"
