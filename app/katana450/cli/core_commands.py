"""The commands of the core, which work without any extension."""

from __future__ import annotations

from argparse import Namespace

from katana450.cli.access_options import add_access_options
from katana450.cli.go_options import add_go_options
from katana450.cli.lines_options import add_fk_options, add_ik_options
from katana450.cli.people_options import add_people_options
from katana450.cli.serve_options import add_serve_options
from katana450.extension import CliCommand

# Each function imports its modules when it is called, so that fk and ik do not load the libraries
# of the view.


def _serve(options: Namespace) -> int:
    from katana450.cli.serve import serve_with

    return serve_with(options)


def _fk(options: Namespace) -> int:
    from katana450.cli.lines import Kinematics, answer_lines

    in_base_frame = options.frame == "base"
    return answer_lines(Kinematics(options.urdf, options.tool, in_base_frame=in_base_frame).fk)


def _ik(options: Namespace) -> int:
    from katana450.cli.lines import Kinematics, answer_lines
    from katana450.maths.kinematics.priority import Priority

    return answer_lines(
        Kinematics(
            options.urdf,
            options.tool,
            in_base_frame=options.frame == "base",
            all_metrics=options.metrics,
            priority=Priority[options.priority.upper()],
            with_nearest=options.nearest,
        ).ik
    )


def _access(options: Namespace) -> int:
    from katana450.cli.access import access

    return access(options)


def _people(options: Namespace) -> int:
    from katana450.cli.people import people

    return people(options)


def _go(options: Namespace) -> int:
    from katana450.cli.go import go

    return go(options)


CORE_COMMANDS = (
    CliCommand("serve", "start the app and print its address", add_serve_options, _serve),
    CliCommand(
        "go", "move the tool on a running server, by a detour if necessary", add_go_options, _go
    ),
    CliCommand(
        "fk",
        "JSON lines from stdin to stdout, joints to poses: "
        '{"q": [5 angles, rad], "tool": "tcp"} per line',
        add_fk_options,
        _fk,
    ),
    CliCommand(
        "ik",
        "JSON lines from stdin to stdout, poses to joints: "
        '{"T": [[4x4, m]], "tool": "tcp"} per line, or "p" with "wxyz", "xyzw", "rpy", or "pitch" '
        'and "roll"',
        add_ik_options,
        _ik,
    ),
    CliCommand("access", "give people links with which they sign in", add_access_options, _access),
    CliCommand("people", "list who is connected, disconnect and mute", add_people_options, _people),
)
