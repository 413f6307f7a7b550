"""The recordings that a server plays back: its own last minutes, and files that people opened."""

from __future__ import annotations

import secrets
import shutil
import weakref
from collections import OrderedDict
from pathlib import Path
from tempfile import mkdtemp

from katana450.errors import InputError
from katana450.extensions.recording.folders import SUFFIX, recordings_in
from katana450.extensions.recording.playback.opened_run import OpenedRun
from katana450.extensions.recording.playback.run import PlaybackRun

RING = "ring"
"""Name of the last minutes that the server has recorded itself."""

MAX_FILE_BYTES = 200_000_000
"""Maximum size of a file: three hours of motion without a pause."""

PREFIX = "katana450-opened-"
"""Start of the names of the temporary folders of servers."""

AnyRun = PlaybackRun | OpenedRun
"""The last minutes, or an opened file."""

MAX_FILES = 4
"""Number of opened files that are kept; the one that was opened first is closed."""


class RecordingStore:
    """Runs by their names. For use in one thread, except for the runs themselves."""

    def __init__(self, ring: Path | None) -> None:
        """Offer the ring in the folder ``ring``, if there is one."""
        self.ring = ring
        self._temporary = Path(mkdtemp(prefix=PREFIX))
        weakref.finalize(self, shutil.rmtree, self._temporary, ignore_errors=True)
        self._ring = None if ring is None else PlaybackRun(lambda: recordings_in(ring))
        self._files: OrderedDict[str, tuple[Path, OpenedRun]] = OrderedDict()

    def run(self, name: str) -> AnyRun:
        """Return the run ``name``. Raises InputError if there is none."""
        if name == RING:
            if self._ring is None:
                raise InputError("This server records nothing, so there are no last minutes.")
            return self._ring
        if name not in self._files:
            raise InputError("The server no longer has that recording. Open its file again.")
        return self._files[name][1]

    def file(self, name: str) -> Path:
        """Return the file of the opened recording ``name``. Raises InputError."""
        self.run(name)
        return self._files[name][0]

    def new_path(self) -> Path:
        """Return the path for a file that is being received."""
        return self._temporary / f"{secrets.token_hex(8)}{SUFFIX}"

    def new_folder(self) -> Path:
        """Return a new folder for a file that is being made."""
        return Path(mkdtemp(dir=self._temporary))

    def add(self, path: Path, run: OpenedRun) -> str:
        """Keep ``run`` of the file ``path``, and return its name."""
        self._files[path.stem] = path, run
        while len(self._files) > MAX_FILES:
            _, (old, run) = self._files.popitem(last=False)
            run.close()
            old.unlink(missing_ok=True)
        return path.stem


def opened(path: Path) -> OpenedRun:
    """Return the run in the file ``path``. Raises InputError if it is not a recording."""
    run = OpenedRun(path)
    try:
        run.update()
    except InputError as error:
        # The path is one of this server, which says nothing to the person.
        raise InputError(str(error).replace(str(path), "The file")) from error
    if not run.spans:
        raise InputError("The file is not a recording of katana450, or has no motion.")
    return run
