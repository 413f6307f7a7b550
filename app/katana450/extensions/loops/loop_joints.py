"""The choice of files with closed loops, which loads nothing for all others."""

from __future__ import annotations

from argparse import Namespace


def solve_loops(options: Namespace) -> None:
    """Let ``options`` name a file without loops, if that of the robot has some."""
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
