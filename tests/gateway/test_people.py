"""Test what admins do with those who are connected: list and kick."""

from __future__ import annotations

import asyncio
import json
import time
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed

from katana450.arm.control.lease import Role
from katana450.server.web.access_links import AccessFile
from tests.gateway.client import HOUR, Control, page_name
from tests.gateway.virtual import VirtualServer

KICKED = "An admin has disconnected you."


def link(file: AccessFile, name: str, role: Role) -> str:
    """Return the token of a new link."""
    return file.give(name, role, time.time() + HOUR)


async def asked(control: Control, do: str, **request: Any) -> dict[str, Any]:
    """Send a request with an id, and return its answer."""
    name = page_name()
    await control.say(do, id=name, **request)
    async with asyncio.timeout(5.0):
        while True:
            for message in control.heard:
                if message.get("id") == name:
                    control.heard.remove(message)
                    return message
            await asyncio.sleep(0.01)


async def listed(control: Control) -> dict[str, dict[str, Any]]:
    """Return the people by name."""
    answer = await asked(control, "list_people")
    assert answer["is"] == "people", answer
    return {person["name"]: person for person in answer["people"]}


async def ends(control: Control) -> int | None:
    async with asyncio.timeout(5.0):
        await control.socket.wait_closed()
    return control.socket.close_code


async def test_admin_sees_everybody_with_all_connections(
    guarded: VirtualServer, file: AccessFile
) -> None:
    viewer, operator = link(file, "Vera", Role.VIEWER), link(file, "Oda", Role.OPERATOR)
    boss = link(file, "Ada", Role.ADMIN)
    cookie = await guarded.enter(viewer)
    admin = await guarded.control(await guarded.enter(boss))
    watcher = await guarded.control(cookie)
    driver = await guarded.control(await guarded.enter(operator))
    program = await guarded.program_socket("Sorter", operator)
    other = await guarded.program_socket("Lathe", operator)
    await program.send('{"do": "acquire"}')
    await admin.wait(holder="Oda, Sorter")
    people = await listed(admin)
    assert list(people) == ["Ada", "Vera", "Oda"]
    assert [entry["you"] for entry in people.values()] == [True, False, False]
    assert [entry["drives"] for entry in people.values()] == [False, False, True]
    assert [entry["role"] for entry in people.values()] == ["admin", "viewer", "operator"]
    assert [entry["addresses"] for entry in people.values()] == [
        ["127.0.0.1"] * count for count in (1, 1, 3)
    ]
    assert people["Oda"]["link"] in file.grants
    # No key of an identity is shown, only the numbers of links.
    assert cookie.partition("=")[2] not in json.dumps(people)
    for nobody in (watcher, driver):
        assert (await asked(nobody, "list_people"))["is"] == "refused"
        assert (await asked(nobody, "kick", person=1))["why"] == "Only an admin may do this."
    await other.close()
    assert len((await listed(admin))["Oda"]["addresses"]) == 2


async def test_kicked_person_is_disconnected_and_comes_back_later(
    guarded: VirtualServer, file: AccessFile
) -> None:
    token, boss = link(file, "Kai", Role.OPERATOR), link(file, "Ada", Role.ADMIN)
    cookie = await guarded.enter(token)
    admin = await guarded.control(await guarded.enter(boss))
    control = await guarded.control(cookie)
    program = await guarded.program_socket("Kai's", token)
    await control.wait(mood="ok")
    kai = (await listed(admin))["Kai"]["person"]
    assert (await asked(admin, "kick", person=kai, seconds=60))["is"] == "done"
    assert await ends(control) == 4401
    await program.wait_closed()
    assert (program.close_code, program.close_reason) == (4401, KICKED)
    people = await listed(admin)
    assert people["Kai"]["addresses"] == []
    assert 59.0 < people["Kai"]["kept_out"] <= 60.0
    # Neither cookie nor link lets Kai in, but STOP works.
    assert (await guarded.request("/api/v1/state", Cookie=cookie))[0] == 403
    body = json.dumps({"token": token}).encode()
    status, _, why = await guarded.request("/enter", body, Origin=guarded.url)
    assert (status, why[:30]) == (403, KICKED[:30].encode())
    with pytest.raises(ConnectionClosed, match=KICKED):
        await guarded.program_socket("Kai's", token)
    await admin.say("acquire")
    assert (await guarded.request("/stop", b"", Cookie=cookie, Origin=guarded.url))[0] == 204
    await admin.wait(stopped="Kai pressed STOP.")
    await admin.clear_stop()
    assert (await asked(admin, "kick", person=kai, seconds=0))["is"] == "done"
    await (await guarded.control(await guarded.enter(token))).wait(role="operator")
    assert (await asked(admin, "kick", person=kai, seconds=0.5))["is"] == "done"
    await asyncio.sleep(0.6)
    assert await guarded.enter(token)


async def test_revoked_link_is_gone_from_the_access_file(
    guarded: VirtualServer, file: AccessFile
) -> None:
    boss, token = link(file, "Ada", Role.ADMIN), link(file, "Rita", Role.VIEWER)
    admin = await guarded.control(await guarded.enter(boss))
    control = await guarded.control(await guarded.enter(token))
    await control.wait()
    people = await listed(admin)
    rita, me = people["Rita"], people["Ada"]["person"]
    assert rita["link"] in AccessFile.open(file.path).grants
    for refused in (me, 999_999):
        assert (await asked(admin, "kick", person=refused, revoke=True))["is"] == "refused"
    assert (await asked(admin, "kick", person=rita["person"], revoke=True))["is"] == "done"
    assert await ends(control) == 4401
    assert rita["link"] not in AccessFile.open(file.path).grants
    assert "Rita" not in await listed(admin)
    bearer = f"Bearer {token}"
    assert (await guarded.request("/api/v1/stop", b"", Authorization=bearer))[0] == 401
