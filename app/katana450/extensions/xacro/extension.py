"""The extension ``xacro``: robot descriptions in the macro language of ROS."""

from __future__ import annotations

from pathlib import Path

from katana450.extension import Extension


def _expand(path: Path) -> bytes:
    from katana450.extensions.xacro.xacro_file import expanded

    return expanded(path)


EXTENSION = Extension("xacro", expand=_expand)
