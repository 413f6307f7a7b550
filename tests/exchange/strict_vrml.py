"""A reader of VRML97 that refuses whatever the standard, or an export of this project, lacks."""

from __future__ import annotations

import re

from katana450.errors import InputError
from katana450.extensions.export.vrml_node import World
from katana450.extensions.export.vrml_text import HEADER
from katana450.extensions.importers.vrml_reader import Reader


def read_world(text: str) -> World:
    """Return the content of a file. Raises InputError, with the line of an error in a node."""
    if not re.match(f"{re.escape(HEADER)}(?![^ \r\n])", text):
        raise InputError(f"A world must begin with {HEADER!r}.")
    return Reader(text, "The file").world()
