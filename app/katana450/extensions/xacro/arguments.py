"""Arguments of a xacro file on the command line."""

from __future__ import annotations

from argparse import Namespace


def expand_with_arguments(options: Namespace) -> None:
    """Expand the file now if there are arguments for it, and name the result in its place."""
    if getattr(options, "xacro_arg", None):
        from katana450.extensions.xacro.xacro_file import expanded_file

        options.urdf = expanded_file(options.urdf, dict(options.xacro_arg))
