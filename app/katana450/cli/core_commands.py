"""The command of the core, which works without any extension."""

from __future__ import annotations

from katana450.extension import CliCommand

CORE_COMMANDS = (
    CliCommand(
        "serve",
        "start the app and print its address",
        "katana450.cli.serve_options:add_serve_options",
        "katana450.cli.serve:serve_with",
    ),
)
