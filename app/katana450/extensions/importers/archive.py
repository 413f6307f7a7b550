"""An upload of several files as one .zip: a shape file, and the files that it names."""

from __future__ import annotations

import io
import posixpath
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterable, Mapping
from urllib.parse import unquote

from katana450.errors import InputError
from katana450.extensions.export.files import zipped

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

    def find(self, urls: Iterable[str], naming_file: str = "") -> tuple[str, bytes] | None:
        """Return path and content of the first of ``urls`` that is there.

        They are named in the file at path ``naming_file``, the main file if it is left out. A file
        in another folder of the upload counts if its name is unique, because browsers drop the
        folders of chosen files. Returns None, and lists the names in ``missing``, without such a
        file.
        """
        names: list[str] = []
        for url in urls:
            if SCHEME.match(url):
                names.append(url)
                continue
            folder = posixpath.dirname(naming_file or self._main)
            wanted = [
                posixpath.normpath(posixpath.join(folder, name.replace("\\", "/")))
                for name in dict.fromkeys((url, unquote(url)))
            ]
            for path in (*wanted, *(self._alike(path, naming_file) for path in wanted)):
                if path in self._files:
                    self.used[path] = None
                    return path, self._files[path]
            names.append(wanted[-1])
        self.missing |= dict.fromkeys(names)
        return None

    def _alike(self, path: str, naming_file: str) -> str:
        """Return the only path with the same name in any folder and case; empty without one.

        Neither the main file nor the one that names it is meant.
        """
        name = posixpath.basename(path).casefold()
        others = self._files.keys() - {self._main, naming_file}
        matches = [
            candidate for candidate in others if posixpath.basename(candidate).casefold() == name
        ]
        return matches[0] if len(matches) == 1 and name else ""


def is_inside(path: str) -> bool:
    """Return whether a normalized ``path`` stays inside its folder."""
    return not (path.startswith(("/", "..")) or path in ("", ".") or re.search(r"[\\:\0]", path))


MAX_ARCHIVE_BYTES = 60_000_000
"""[bytes] Maximum size of a .zip, and of the files in it that are unpacked."""

MAX_FILES = 1000
"""Maximum number of files in a .zip."""

COMPANION_SUFFIXES = ("bin", "mtl")
"""Suffixes of files that shape files name, and that are no shapes themselves."""

SCENE = "scene.yaml"
"""A file that makes a .zip a scene instead."""


class ChoiceError(InputError):
    """One of several shape files must be chosen.

    Attributes:
        choices: their paths.
    """

    def __init__(self, text: str, choices: Iterable[str]) -> None:
        super().__init__(text)
        self.choices = tuple(choices)


def contents(
    data: bytes, name: str, max_files: int, wanted: Callable[[str], str | None]
) -> tuple[dict[str, bytes], str]:
    """Return the contents of files of a .zip by their paths, and its comment.

    Args:
        data: content of the .zip.
        name: its name, for messages.
        max_files: maximum number of files.
        wanted: returns the path under which a file is returned, by its name; None to leave it.

    Raises InputError for a .zip that cannot be read.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            entries = archive.infolist()
            if len(entries) > max_files:
                raise InputError(f"{name} has more than {max_files} files.")
            chosen = [(path, entry) for entry in entries if (path := wanted(entry.filename))]
            if len(dict(chosen)) < len(chosen):
                raise InputError(f"Two files of {name} have the same name.")
            for _, entry in chosen:
                # zipfile unpacks other methods without a bound: 300 bytes can become gigabytes.
                if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                    raise InputError(
                        f"{entry.filename[:80]} in the .zip is compressed by a method other than "
                        "Deflate. Pack it as a plain .zip."
                    )
            # zipfile never unpacks more than the size that is declared here.
            if sum(entry.file_size for _, entry in chosen) > MAX_ARCHIVE_BYTES:
                raise InputError(
                    f"{name} has more than {MAX_ARCHIVE_BYTES // 1_000_000} MB when unpacked."
                )
            files = {path: archive.read(entry) for path, entry in chosen}
            return files, archive.comment.decode("utf-8", "replace")
    except (zipfile.BadZipFile, zipfile.LargeZipFile, RuntimeError, zlib.error) as error:
        reason = str(error)[:80].rstrip(".")
        raise InputError(f"{name} cannot be read as a .zip: {reason}.") from error
    except (OSError, EOFError, ValueError, struct.error) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{name} is corrupt: {str(error)[:80]}.") from error


def unpacked(
    data: bytes, name: str, suffixes: Iterable[str], main: str = ""
) -> tuple[str, dict[str, bytes]]:
    """Return the path of the shape file in a .zip, and the contents of its files by their paths.

    Pictures and other files that no reader opens are not unpacked. The shape file is ``main``, or
    the one that the comment of the .zip names, or the only one in the highest folder.

    Args:
        data: content of the .zip.
        name: its name, for messages.
        suffixes: suffixes of shape files.
        main: path of the shape file, if it is known.

    Raises ChoiceError if there are several, and InputError for a .zip that cannot be read.
    """
    shapes = tuple(f".{suffix}" for suffix in suffixes)
    endings = (*shapes, *(f".{suffix}" for suffix in COMPANION_SUFFIXES))

    def wanted(file: str) -> str | None:
        if file == SCENE:
            raise InputError(f"{name} is a scene, not an object: load it as a scene.")
        path = posixpath.normpath(file.replace("\\", "/"))
        is_read = is_inside(path) and path.lower().endswith(endings) and not file.endswith("/")
        is_hidden = posixpath.basename(path).startswith(".") or path.startswith("__MACOSX/")
        return path if is_read and not is_hidden else None

    files, comment = contents(data, name, MAX_FILES, wanted)
    listed = [path for path in files if path.lower().endswith(shapes)]
    return _main(listed, name, main or (comment if comment in listed else "")), files


def _main(listed: list[str], name: str, main: str) -> str:
    """Return the path of the shape file among those ``listed``."""
    if main:
        if main not in listed:
            raise InputError(f"There is no file {main[:80]!r} in {name}.")
        return main
    if not listed:
        raise InputError(f"There is no file in {name} that can be read as a shape.")
    depth = min(path.count("/") for path in listed)
    top = [path for path in listed if path.count("/") == depth]
    alike = [path for path in top if _stem(path) == _stem(name)]
    for candidates in (top, alike):
        if len(candidates) == 1:
            return candidates[0]
    few = ", ".join(posixpath.basename(path) for path in top[:8])
    more = f" and {len(top) - 8} more" if len(top) > 8 else ""
    raise ChoiceError(f"There are several shapes: choose one of {few}{more}.", top)


def _stem(path: str) -> str:
    return posixpath.splitext(posixpath.basename(path))[0].casefold()


def packed(main: str, files: Mapping[str, bytes]) -> bytes:
    """Return a .zip of ``files``, whose comment is ``main``: the path of a shape file, or empty."""
    return zipped(files, main)
