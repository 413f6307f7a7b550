"""``katana450 access``: give people links to the arm, list them, take them back."""

from __future__ import annotations

import time
from argparse import Namespace

from katana450.arm.control.lease import Role
from katana450.server.web.access_links import AccessFile
from katana450.server.web.authenticator import public_origin


def access(options: Namespace) -> int:
    """Do it; returns the exit status."""
    now = time.time()
    if options.act == "give":
        file = AccessFile.create(options.file)
        origin = public_origin(options.url)
        token = file.give(options.name, Role(options.role), now + options.duration)
        # Behind the # it is sent to no server and stands in no log.
        print(f"{origin}/#{token}")
        return 0
    file = AccessFile.open(options.file)
    if options.act == "revoke":
        grant = file.revoke(options.number)
        print(f"The link of {grant.name} is no good any more.")
        return 0
    for number, grant in file.grants.items():
        until = time.strftime("%Y-%m-%d %H:%M", time.localtime(grant.expires))
        state = f"until {until}" if now < grant.expires else f"expired {until}"
        print(f"{number}  {grant.role.value:8}  {state:24}  {grant.name}")
    return 0
