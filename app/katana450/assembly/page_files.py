"""The files of our page as they are sent: the scripts of each document in one file.

Each request takes the browser and the server some milliseconds of the start.
"""

from __future__ import annotations

import base64
import hashlib
import re
from pathlib import Path

from katana450.disk_cache import kept
from katana450.server.viser_bridge.viser_page import OUR_SCRIPTS, SCRIPTS
from katana450.server.web.static_files import TYPES, File, contents

INDEX, THEME = "index.html", "theme.js"
"""Our page, and its first script, which sets the theme before anything is drawn."""

THEME_ELEMENT = b'<script src="static/theme.js"></script>'
"""Element of that script in the page, which contains the script when it is sent."""

DEFERRED_SCRIPT = re.compile(rb'<script src="static/([^"]+)" defer></script>\n')
"""Pattern of the element of a script that runs when the page is read."""

PAGE_SCRIPTS = "page-scripts.js"
"""Name of the file with all of these."""


def load() -> dict[str, File]:
    """Return every file of the page by its path, with those of its scripts."""
    found = contents()
    bundle = f'<script src="static/{PAGE_SCRIPTS}" defer></script>\n'.encode()
    index = found[INDEX].replace(THEME_ELEMENT, b"<script>%s</script>" % found[THEME])
    head, *names, rest = DEFERRED_SCRIPT.split(index)
    found[INDEX] = head + bundle + rest
    found[PAGE_SCRIPTS] = b"\n".join(found[name.decode()] for name in names if name)
    found[SCRIPTS] = b"\n".join(found[f"{name}.js"] for name in OUR_SCRIPTS)

    def packed() -> dict[str, File]:
        return {name: File.of(each, TYPES[Path(name).suffix]) for name, each in found.items()}

    return kept(packed, dict[str, File], *found, *found.values())


def source(script: File) -> str:
    """Return the source that allows ``script`` within a page, for its content security policy."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.content).digest()).decode()}'"
