"""The commands of the core, which work without any extension."""

from __future__ import annotations

from argparse import Namespace

from katana450.cli.access_options import add_access_options
from katana450.cli.go_options import add_go_options
from katana450.cli.people_options import add_people_options
from katana450.cli.serve_options import add_serve_options
from katana450.extension import CliCommand

# Each function imports its modules when it is called, so that no command loads the libraries of
# another.


def _serve(options: Namespace) -> int:
    from katana450.cli.serve import serve_with

    return serve_with(options)


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
    CliCommand("access", "give people links with which they sign in", add_access_options, _access),
    CliCommand("people", "list who is connected, disconnect and mute", add_people_options, _people),
)
