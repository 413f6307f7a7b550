"""The other files that a shape file names: its buffers, materials and inlined worlds."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterable, Mapping
from urllib.parse import unquote

SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:|//")
"""Beginning of an address on a network or of a kind of its own, which is never opened."""


class Companions:
    """The files of one upload or folder, by their paths in it. No other file is opened.

    Attributes:
        used: paths of the files that were read.
        missing: names of the files that are not there, in the order in which they are named. A name
            that leads to a place inside the folder is its path there.
    """

    def __init__(self, files: Mapping[str, bytes] | None = None, main: str = "") -> None:
        """``files``: contents by their paths; ``main``: path of the file that is read first."""
        self._files = dict(files or {})
        self._main = main
        self.used: dict[str, None] = {}
        self.missing: dict[str, None] = {}

    def find(self, urls: Iterable[str], beside: str = "") -> tuple[str, bytes] | None:
        """Return path and content of the first of ``urls`` that is there.

        They are named in the file at path ``beside``, the main file if it is left out. A file in
        another folder of the upload counts if its name is unique, because browsers drop the folders
        of chosen files. Returns None, and lists the names in ``missing``, without such a file.
        """
        names: list[str] = []
        for url in urls:
            if SCHEME.match(url):
                names.append(url)
                continue
            folder = posixpath.dirname(beside or self._main)
            wanted = [
                posixpath.normpath(posixpath.join(folder, name.replace("\\", "/")))
                for name in dict.fromkeys((url, unquote(url)))
            ]
            for path in (*wanted, *(self._alike(path, beside) for path in wanted)):
                if path in self._files:
                    self.used[path] = None
                    return path, self._files[path]
            names.append(wanted[-1])
        self.missing |= dict.fromkeys(names)
        return None

    def _alike(self, path: str, beside: str) -> str:
        """Return the only path with the same name in any folder and case; empty without one.

        Neither the main file nor the one that names it is meant.
        """
        name = posixpath.basename(path).casefold()
        others = self._files.keys() - {self._main, beside}
        found = [each for each in others if posixpath.basename(each).casefold() == name]
        return found[0] if len(found) == 1 and name else ""


def is_inside(path: str) -> bool:
    """Return whether a normalized ``path`` stays inside its folder."""
    return not (path.startswith(("/", "..")) or path in ("", ".") or re.search(r"[\\:\0]", path))
