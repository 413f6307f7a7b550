"""The commands of the core: those that are there without any extension."""

from __future__ import annotations

from argparse import Namespace

from katana450.cli.access_options import add_access_options
from katana450.cli.lines_options import add_fk_options, add_ik_options
from katana450.cli.serve_options import add_serve_options
from katana450.extension import CliCommand

# Each function imports what it needs when it is called: fk and ik answer without waiting for the
# libraries of the view.


def _serve(options: Namespace) -> int:
    from katana450.cli.serve import serve_with

    return serve_with(options)


def _fk(options: Namespace) -> int:
    from katana450.cli.lines import Kinematics, answer_lines

    in_base_frame = options.frame == "base"
    return answer_lines(Kinematics(options.urdf, options.tool, in_base_frame=in_base_frame).fk)


def _ik(options: Namespace) -> int:
    from katana450.cli.lines import Kinematics, answer_lines

    in_base_frame, metrics = options.frame == "base", options.metrics
    return answer_lines(
        Kinematics(options.urdf, options.tool, in_base_frame=in_base_frame, metrics=metrics).ik
    )


def _access(options: Namespace) -> int:
    from katana450.cli.access import access

    return access(options)


CORE_COMMANDS = (
    CliCommand("serve", "start the app and print its address", add_serve_options, _serve),
    CliCommand(
        "fk",
        "JSON lines from stdin to stdout, joints to poses: "
        '{"q": [5 angles, rad], "tool": "tcp"} a line',
        add_fk_options,
        _fk,
    ),
    CliCommand(
        "ik",
        'JSON lines from stdin to stdout, poses to joints: {"T": [[4x4, m]], "tool": "tcp"} a line',
        add_ik_options,
        _ik,
    ),
    CliCommand(
        "access", "give people links by which they may come in", add_access_options, _access
    ),
)
