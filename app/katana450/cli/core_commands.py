"""The command of the core, which works without any extension."""

from __future__ import annotations

from argparse import Namespace

from katana450.cli.serve_options import add_serve_options
from katana450.extension import CliCommand


def _serve(options: Namespace) -> int:
    from katana450.cli.serve import serve_with

    return serve_with(options)


CORE_COMMANDS = (
    CliCommand("serve", "start the app and print its address", add_serve_options, _serve),
)
