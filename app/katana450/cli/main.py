"""The command line ``katana450``: commands of the core and of the extensions."""

from __future__ import annotations

import argparse
import errno
import sys
from collections.abc import Sequence

from katana450.assembly.log_output import drop_output
from katana450.cli.version import version
from katana450.errors import KatanaError
from katana450.extension import CliCommand, extensions, load, provided

CORE_COMMANDS = (
    CliCommand(
        "serve",
        "start the app and print its address",
        "katana450.cli.serve_options:add_serve_options",
        "katana450.cli.serve:serve",
    ),
)


NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EIO)
"""Errors of a full or broken disk to which the output is written."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return the exit status: 0 done, 1 failed, 2 wrong arguments."""
    arguments = sys.argv[1:] if arguments is None else arguments
    options, unknown = _parser(arguments).parse_known_args(arguments)
    # The options are sent to other processes, which cannot receive a parser.
    parser: argparse.ArgumentParser = vars(options).pop("parser")
    if unknown:
        # The parser of the command shows the usage of the command, and not that of all.
        parser.error(f"unrecognized arguments: {' '.join(unknown)}")
    command: CliCommand = options.command
    try:
        for prepare in provided("prepare"):
            prepare(options)
        status: int = load(command.run)(options)
        return status
    except KatanaError as error:
        print(f"katana450: {error}", file=sys.stderr)
        return 1
    except BrokenPipeError:
        # The reader has closed the pipe; write nothing more, not even at exit.
        sys.stderr.close()
        return 0
    except OSError as error:
        if error.errno not in NO_ROOM:
            raise
        drop_output(error)
        return 1


def _parser(arguments: Sequence[str] = ()) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="katana450", description="Teleoperate and simulate the Katana450 arm in a browser."
    )
    shown = version() if any(argument.startswith("--v") for argument in arguments) else ""
    parser.add_argument("--version", action="version", version=f"katana450 {shown}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    added = [command for extension in extensions() for command in extension.commands]
    offered: dict[str, CliCommand] = {}
    for command in (*CORE_COMMANDS, *added):
        if offered.setdefault(command.name, command) is not command:
            print(
                f"katana450: There are two commands {command.name}; the second is left out.",
                file=sys.stderr,
            )
    # To collect the options of the other commands too takes 10 ms.
    for name in offered.keys() & set(arguments[:1]) or offered:
        options = commands.add_parser(name, help=offered[name].help)
        load(offered[name].add_options)(options)
        options.set_defaults(command=offered[name], parser=options)
    return parser
