"""Scripts in folders: those that come along, and a person's own."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from katana450.atomic import write_files, writer_of
from katana450.errors import ConfigurationError, InputError
from katana450.extensions import programs
from katana450.extensions.programs.source import MAX_BYTES

LIBRARY = Path(programs.__file__).parent / "library"
"""Of those that come along."""

ENDING = ".yaml"

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 _-]{0,39}")

MAX_SCRIPTS = 200
"""Scripts of one folder that are shown, by their names."""


class Scripts:
    """Those of the library, and of one folder if there is one."""

    def __init__(self, folder: Path | None = None) -> None:
        """Raises ConfigurationError when `folder` is none."""
        if folder is not None and not folder.is_dir():
            raise ConfigurationError(f"--programs takes a folder of scripts; {folder} is none.")
        self._folder = folder

    @property
    def keeps(self) -> bool:
        """Whether there is a folder to save in."""
        return self._folder is not None

    @property
    def paths(self) -> Mapping[str, Path]:
        """By their names; a person's own go before those of the library."""
        found = {_shown(path): path for path in sorted(LIBRARY.glob(f"*{ENDING}"))}
        if self._folder is not None:
            own = sorted(self._folder.glob(f"*{ENDING}"))[:MAX_SCRIPTS]
            found = {**{path.stem: path for path in own}, **found}
        return found

    def text(self, name: str) -> str:
        """Of the script called `name`. Raises InputError where it cannot be read."""
        path = self.paths.get(name)
        if path is None:
            raise InputError(f"There is no script {name!r} any more.")
        return text_of(path)

    def save(self, name: str, text: str) -> Path:
        """A new script in the folder. Raises InputError where that cannot be."""
        if self._folder is None:
            raise InputError(
                "There is no folder for scripts: start the server with --programs DIR."
            )
        path = self._folder / file_name(name)
        if path.exists():
            raise InputError(f"There is a script {name!r} already; give this one another name.")
        write_files({path: writer_of(text.encode())})
        return path


def file_name(name: str) -> str:
    """Return the file name of a script. Raises InputError for a name that cannot be one."""
    if not NAME.fullmatch(name):
        raise InputError("A script's name has up to 40 letters, digits, blanks, - and _.")
    return f"{name}{ENDING}"


def text_of(path: Path) -> str:
    """The text of a script. Raises InputError for a file that holds none."""
    try:
        with path.open("rb") as file:
            return file.read(MAX_BYTES + 1).decode("utf-8")
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is no text in UTF-8: {error.reason}.") from error


def _shown(path: Path) -> str:
    return path.stem.replace("_", " ").capitalize()
