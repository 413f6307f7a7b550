"""The extension ``xacro``: robot descriptions in the macro language of ROS."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from katana450.extension import Extension


def _expand(path: Path) -> bytes:
    from katana450.extensions.xacro.xacro_file import expanded

    return expanded(path)


def _with_arguments(options: Namespace) -> None:
    """Expand the file now if there are arguments for it, and name the result in its place."""
    if getattr(options, "xacro_arg", None):
        from katana450.extensions.xacro.xacro_file import expanded_file

        options.urdf = expanded_file(options.urdf, dict(options.xacro_arg))


EXTENSION = Extension("xacro", expand=_expand, prepare=_with_arguments)
