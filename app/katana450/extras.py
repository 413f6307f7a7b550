"""Libraries that only an extra of the package installs, and the command that adds them."""

from __future__ import annotations

import shlex
import sys
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from katana450.errors import ConfigurationError

PACKAGES = {
    "cameras": "opencv-python-headless",
    "datasets": "pyarrow rosbags",
    "films": "imageio-ffmpeg",
    "gallery": "robot-descriptions",
    "learn": "gymnasium",
    "meshes": "dracopy networkx",
    "pictures": "embreex",
    "serial": "pyserial",
}
"""The packages of each extra, for the command that adds it. With `katana450[NAME]`, pip would also
install 250 MB that yourdfpy requires and nothing uses.
"""


class MissingExtraError(ConfigurationError):
    """An extra of the package is not installed; the text has the command that installs it."""


def library(module: str, extra: str, purpose: str) -> Any:
    """Return the library ``module`` of an ``extra``, which ``purpose`` needs.

    ``purpose`` is in the plural, with a capital letter. Raises MissingExtraError.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise _missing(extra, purpose) from error


def require(module: str, extra: str, purpose: str) -> None:
    """Raise MissingExtraError as `library`, but do not load ``module``, which may take long."""
    if find_spec(module) is None:
        raise _missing(extra, purpose)


def _missing(extra: str, purpose: str) -> MissingExtraError:
    """Return the error of a missing ``extra``, made of its text alone so that it can be pickled."""
    python = shlex.quote(sys.executable)
    # Environments of uv have no pip.
    command = f"{python} -m pip install" if find_spec("pip") else f"uv pip install -p {python}"
    return MissingExtraError(f"{purpose} need the extra {extra!r}: {command} {PACKAGES[extra]}")
