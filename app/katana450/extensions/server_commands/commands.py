"""``katana450 access``, which gives people links."""

from __future__ import annotations

import time
from argparse import Namespace

from katana450.arm.control.lease import Role
from katana450.server.web.access_links import AccessFile
from katana450.server.web.authenticator import public_origin


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
