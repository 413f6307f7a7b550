"""``katana450 access``, which gives people links, and ``people``, which disconnects them."""

from __future__ import annotations

import os
import time
from argparse import Namespace

from katana450.arm.control.lease import Role
from katana450.client import connect
from katana450.errors import ConfigurationError
from katana450.extensions.server_commands.options import TOKEN_VARIABLE
from katana450.server.api import answers
from katana450.server.web.access_links import AccessFile
from katana450.server.web.authenticator import public_origin

NAME = "Terminal"
"""Name of this client, which others see."""


def access(options: Namespace) -> int:
    """Run ``katana450 access`` and return the exit status."""
    now = time.time()
    if options.act == "give":
        file = AccessFile.create(options.file)
        origin = public_origin(options.url)
        token = file.give(options.name, Role(options.role), now + options.duration)
        # Browsers send the part after the # to no server, so no log contains it.
        print(f"{origin}/#{token}")
        return 0
    file = AccessFile.open(options.file)
    if options.act == "revoke":
        grant = file.revoke(options.number)
        print(f"The link of {grant.name} is revoked.")
        return 0
    for number, grant in file.grants.items():
        until = time.strftime("%Y-%m-%d %H:%M", time.localtime(grant.expires))
        state = f"until {until}" if now < grant.expires else f"expired {until}"
        print(f"{number}  {grant.role.value:8}  {state:24}  {grant.name}")
    return 0


def people(options: Namespace) -> int:
    """Run ``katana450 people`` and return the exit status. Raises KatanaError."""
    with connect(options.url, NAME, _token(options)) as server:
        match options.act:
            case "list":
                for person in server.people():
                    print(line(person))
            case "kick":
                server.kick(options.person, options.seconds, revoke=options.revoke)
            case "let-in":
                server.kick(options.person, 0.0)
    return 0


def line(person: answers.ConnectedPerson) -> str:
    """Return one line about ``person``, which begins with the number."""
    connections = person.connections
    notes = [connection.kind for connection in connections]
    notes += sorted({connection.address for connection in connections})
    if connections:
        notes.append(f"since {connections[0].since}")
    if person.drives:
        notes.append("drives" if person.program is None else f"runs {person.program}")
    if person.asks:
        notes.append("asks for the lease")
    if person.refused:
        notes.append(f"{person.refused} refused")
    if person.kept_out is not None:
        notes.append(f"kept out for {person.kept_out:.0f} s")
    if person.link is not None:
        notes.append(f"link {person.link}")
    return f"{person.person:4}  {person.role:8}  {person.name:24}  {', '.join(notes)}"


def _token(options: Namespace) -> str:
    """Return the token of the options: the part of a link behind its ``#``."""
    text = os.environ.get(TOKEN_VARIABLE, "")
    if options.token_file is not None:
        try:
            text = options.token_file.read_text(encoding="utf-8")
        except (OSError, UnicodeError) as error:
            raise ConfigurationError(f"{options.token_file} cannot be read: {error}.") from error
    return text.strip().rpartition("#")[2]
