"""The extension ``server_commands``: who may use a server, and who is connected."""

from __future__ import annotations

from argparse import Namespace
from typing import TYPE_CHECKING

from katana450.extension import CliCommand, Extension, ServeExtension
from katana450.extensions.server_commands.access_options import add_access_options
from katana450.extensions.server_commands.people_options import add_people_options

if TYPE_CHECKING:
    from katana450.server.service.request_handler import RequestHandler


def _access(options: Namespace) -> int:
    from katana450.extensions.server_commands.access import access

    return access(options)


def _people(options: Namespace) -> int:
    from katana450.extensions.server_commands.people import people

    return people(options)


def _handler() -> type[RequestHandler]:
    from katana450.extensions.server_commands.people_requests import PeopleRequests

    return PeopleRequests


EXTENSION = Extension(
    "server_commands",
    (
        CliCommand(
            "access", "give people links with which they sign in", add_access_options, _access
        ),
        CliCommand(
            "people", "list who is connected, and disconnect people", add_people_options, _people
        ),
    ),
    ServeExtension(handler=_handler),
)
