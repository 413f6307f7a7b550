"""The extension ``loops``: a file with closed loops is solved before a command reads it."""

from __future__ import annotations

from argparse import Namespace

from katana450.extension import Extension


def _prepare(options: Namespace) -> None:
    urdf = getattr(options, "urdf", None)
    if urdf is None:
        return
    try:
        data = urdf.read_bytes()
    except (OSError, AttributeError):
        # The reader of the file explains why.
        return
    if b"<loop_joint" in data:
        from katana450.extensions.loops.solved_file import solved_file

        options.urdf = solved_file(urdf)


EXTENSION = Extension("loops", prepare=_prepare)
