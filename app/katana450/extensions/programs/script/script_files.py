"""Scripts in folders: the library of the package, and the folder of a person."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from katana450.arm.control.arm import ArmModel
from katana450.atomic import bytes_of, write_files, writer_of
from katana450.errors import ConfigurationError, InputError
from katana450.extensions import programs
from katana450.extensions.programs.language.source import MAX_BYTES
from katana450.extensions.programs.script.script import parse

LIBRARY = Path(programs.__file__).parent / "library"
"""Folder of the scripts that come with the package."""

ENDING = ".yaml"
"""Suffix of script files."""

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 _-]{0,39}")
"""Pattern of the names under which scripts can be saved."""

MAX_SCRIPTS = 200
"""Maximum number of scripts of a folder that are listed, in order of their names."""


class Scripts:
    """The scripts of the library and, if given, of one folder."""

    def __init__(self, folder: Path | None = None) -> None:
        """Use ``folder`` too. Raises ConfigurationError if it is not a folder."""
        if folder is not None and not folder.is_dir():
            raise ConfigurationError(
                f"--programs needs a folder of scripts; {folder} is not a folder."
            )
        self._folder = folder

    @property
    def keeps(self) -> bool:
        """True if there is a folder to save in."""
        return self._folder is not None

    @property
    def paths(self) -> Mapping[str, Path]:
        """Paths of the scripts by name; those of the folder come first and have precedence."""
        library = sorted(LIBRARY.glob(f"*{ENDING}"))
        paths = {path.stem.replace("_", " ").capitalize(): path for path in library}
        if self._folder is not None:
            own = sorted(self._folder.glob(f"*{ENDING}"))[:MAX_SCRIPTS]
            paths = {**{path.stem: path for path in own}, **paths}
        return paths

    def offered(self, arm: ArmModel | None) -> tuple[str, ...]:
        """Return the names of the scripts of the folder, and of those of the library for ``arm``.

        ``arm``: None for an arm that is not known yet, which is offered all.
        """
        return tuple(
            name
            for name, path in self.paths.items()
            if arm is None or path.parent != LIBRARY or _is_for(path, arm)
        )

    def text(self, name: str) -> str:
        """Return the text of the script ``name``. Raises InputError if it cannot be read."""
        path = self.paths.get(name)
        if path is None:
            raise InputError(f"The script {name!r} no longer exists.")
        return script_text(path)

    def save(self, name: str, text: str, *, replaces: bool = False) -> Path:
        """Save a script and return its path; ``replaces`` an old one. Raises InputError."""
        if self._folder is None:
            raise InputError("This server has no folder for scripts: keep the script elsewhere.")
        path = self._folder / file_name(name)
        if path.exists() and not replaces:
            raise InputError(f"A script {name!r} exists already. Choose another name.")
        write_files({path: writer_of(text.encode())})
        return path


def _is_for(path: Path, arm: ArmModel) -> bool:
    """Return whether ``arm`` can do a script of the library: one with a tool is for five axes."""
    script = parse(script_text(path))
    return script.suits(arm) and (script.tool is None or arm.kinematics.is_pitched)


def library_file(name: str) -> Path:
    """Return the file of the script ``name`` of the library, such as ``circle``."""
    return LIBRARY / f"{name}{ENDING}"


def file_name(name: str) -> str:
    """Return the file name of the script ``name``. Raises InputError for an invalid name."""
    if not NAME.fullmatch(name):
        raise InputError("The name of a script may have up to 40 letters, digits, blanks, - and _.")
    return f"{name}{ENDING}"


def script_text(path: Path) -> str:
    """Return the text of a script file. Raises InputError if it cannot be read."""
    try:
        return bytes_of(path, MAX_BYTES).decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 text: {error.reason}.") from error
