"""What ``katana450`` understands, and which part of the program does it."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from katana450.cli.access_options import add_access_options
from katana450.cli.export_options import add_export_options
from katana450.cli.programs_options import add_demo_options, add_run_options
from katana450.cli.render_options import add_render_options
from katana450.cli.serve_options import add_serve_options
from katana450.cli.version import version
from katana450.cli.workspace_options import add_workspace_options
from katana450.errors import InputError, KatanaError
from katana450.resources import URDF_PATH
from katana450.settings import Settings

FRAMES = ("shoulder", "base")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status: 0 done, 1 could not, 2 not understood."""
    options = _parser().parse_args(arguments)
    try:
        # Imported when wanted: fk and ik answer without waiting for the view's libraries.
        if options.command == "serve":
            from katana450.cli.serve import serve

            settings = Settings(
                host=options.host,
                port=options.port,
                silence=options.silence,
                owner_silence=options.owner_silence,
                access=options.access,
                insecure=options.insecure,
                tls_cert=options.tls_cert,
                tls_key=options.tls_key,
                public_url=options.public_url,
                lines=options.lines,
                bare=options.bare,
                programs=options.programs,
            )
            return serve(
                settings,
                options.urdf,
                options.tool,
                options.workspace,
                options.scene,
                options.objects,
            )
        if options.command == "access":
            from katana450.cli.access import access

            return access(options)
        if options.command == "workspace":
            from katana450.cli.workspace import workspace

            return workspace(options)
        if options.command in ("run", "demo"):
            from katana450.cli import programs

            return programs.run(options) if options.command == "run" else programs.demo(options)
        if (
            options.command == "export"
            and options.format != "urdf"
            and (options.license or options.maintainer)
        ):
            raise InputError(
                f"A file of {options.format} states no licence and no maintainer; urdf does."
            )
        if options.command == "export" and options.format == "html":
            from katana450.cli.page import write_page

            return write_page(options)
        if options.command == "export":
            from katana450.cli.export import export

            return export(options)
        if options.command == "render":
            from katana450.cli.render import render

            return render(options)
        from katana450.cli.lines import Kinematics, answer_lines

        in_base_frame = options.frame == "base"
        kinematics = Kinematics(
            options.urdf,
            options.tool,
            in_base_frame=in_base_frame,
            badges=options.command == "ik" and options.badges,
        )
        return answer_lines(kinematics.fk if options.command == "fk" else kinematics.ik)
    except KatanaError as error:
        print(f"katana450: {error}", file=sys.stderr)
        return 1
    except BrokenPipeError:
        # The reader has heard enough; say nothing more, not even at exit.
        sys.stderr.close()
        return 0
    except KeyboardInterrupt:
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="katana450", description="Teleoperate and simulate the Katana450 arm in a browser."
    )
    parser.add_argument("--version", action="version", version=f"katana450 {version()}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    add_serve_options(commands.add_parser("serve", help="start the app and print its address"))
    for name, what in (
        ("fk", 'joints to poses: {"q": [5 angles, rad], "tool": "tcp"} a line'),
        ("ik", 'poses to joints: {"T": [[4x4, m]], "tool": "tcp"} a line'),
    ):
        lines = commands.add_parser(name, help=f"JSON lines from stdin to stdout, {what}")
        lines.add_argument(
            "--frame",
            choices=FRAMES,
            default=FRAMES[0],
            help="coordinates of T: the paper's frame {S} at the shoulder, or the base on the "
            "table (default: %(default)s)",
        )
        if name == "ik":
            lines.add_argument(
                "--badges",
                action="store_true",
                help='each solution with its way from "q" in the line (default: the zero posture) '
                "as distance_rad and time_s, its smallest_singular_value, and in contact the two "
                "parts that would meet there, or null",
            )
    add_workspace_options(
        commands.add_parser(
            "workspace", help="map where the tool can be, and how freely it can be turned there"
        )
    )
    exporting = commands.add_parser("export", help="write the arm as files for other programs")
    add_export_options(exporting)
    exporting.add_argument(
        "--urdf",
        type=Path,
        default=URDF_PATH,
        metavar="FILE",
        help="another mechanism: any tree of turning, sliding and mimicking joints "
        "(default: the Katana450)",
    )
    with_an_arm = [parser for parser in commands.choices.values() if parser is not exporting]
    add_access_options(
        commands.add_parser("access", help="give people links by which they may come in")
    )
    add_run_options(commands.add_parser("run", help="run a script of your own"))
    add_demo_options(commands.add_parser("demo", help="run an experiment of the paper"))
    add_render_options(
        commands.add_parser("render", help="a picture or a film of the arm, without a browser")
    )
    for command in with_an_arm:
        command.add_argument(
            "--urdf",
            type=Path,
            default=URDF_PATH,
            metavar="FILE",
            help="another arm: pan, three parallel axes, roll; `serve` drives any other tree joint "
            "by joint (default: the Katana450)",
        )
        command.add_argument(
            "--tool", metavar="LINK", help="link that targets are for (default: the last one)"
        )
    return parser
