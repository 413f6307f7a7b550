"""Environments of subprocesses without some extensions, or with other distributions."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

BLOCKING = """
import os, sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        for blocked in os.environ["BLOCKED"].split():
            if name == blocked or name.startswith(blocked + "."):
                raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Blocked())
"""


def write_blocking(folder: Path) -> None:
    """Write a module into ``folder`` that blocks the import of the packages in BLOCKED.

    It takes effect in processes that have the folder in PYTHONPATH. BLOCKED is a variable of the
    environment.
    """
    (folder / "sitecustomize.py").write_text(BLOCKING, encoding="utf-8")


@contextmanager
def without(folder: Path, *names: str) -> Iterator[None]:
    """Start processes without the extensions ``names`` inside the ``with`` block.

    ``folder`` is added to the search path of their modules.
    """
    write_blocking(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BLOCKED", " ".join(f"katana450.extensions.{name}" for name in names))
        patch.setenv("PYTHONPATH", str(folder))
        yield


def distribution(folder: Path, entry: str, module: str) -> Path:
    """Write another distribution into ``folder``, with ``module`` and its entry point."""
    information = folder / "weather-1.0.dist-info"
    information.mkdir(parents=True)
    lines = ("Metadata-Version: 2.1", "Name: weather", "Version: 1.0", "")
    (information / "METADATA").write_text("\n".join(lines), encoding="utf-8")
    points = f"[katana450.extensions]\nweather = {entry}\n"
    (information / "entry_points.txt").write_text(points, encoding="utf-8")
    (folder / "station.py").write_text(module, encoding="utf-8")
    return folder
