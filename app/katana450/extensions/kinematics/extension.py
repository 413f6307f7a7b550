"""The extension ``kinematics``: forward and inverse kinematics for other programs."""

from __future__ import annotations

from argparse import Namespace

from katana450.extension import CliCommand, Extension
from katana450.extensions.kinematics.options import add_fk_options, add_ik_options


def _fk(options: Namespace) -> int:
    from katana450.extensions.kinematics.json_lines import answer_lines
    from katana450.extensions.kinematics.lines_of import lines_of

    return answer_lines(lines_of(options).fk)


def _ik(options: Namespace) -> int:
    from katana450.extensions.kinematics.json_lines import answer_lines
    from katana450.extensions.kinematics.lines_of import lines_of

    return answer_lines(lines_of(options).ik)


EXTENSION = Extension(
    "kinematics",
    commands=(
        CliCommand(
            "fk",
            "JSON lines from stdin to stdout, joints to poses: "
            '{"q": [angles, rad], "tool": "tcp"} per line',
            add_fk_options,
            _fk,
        ),
        CliCommand(
            "ik",
            "JSON lines from stdin to stdout, poses to joints: "
            '{"T": [[4x4, m]], "tool": "tcp"} per line, or "p" with "wxyz", "xyzw", "rpy", or '
            '"pitch" and "roll"',
            add_ik_options,
            _ik,
        ),
    ),
)
