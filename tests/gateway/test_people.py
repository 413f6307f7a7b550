"""Test what admins do with those who are connected to a running server: list and kick."""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed

from katana450.arm.control.lease import Role
from katana450.client import Client, connect
from katana450.client.files import LostError, RefusedError
from katana450.server.api import answers, requests
from katana450.server.web.access_links import AccessFile
from tests.browser.server import ROOT
from tests.gateway.client import (
    SUBPROTOCOL,
    Control,
    ask,
    controlling,
    enter,
    page_name,
    websocket,
)
from tests.gateway.lines import Lines
from tests.gateway.site import Site, open_site


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with open_site(tmp_path_factory.mktemp("people"), "--lines", "0") as site:
        yield site


async def asked(control: Control, do: str, **request: Any) -> dict[str, Any]:
    """Send a request with an id, and return its answer."""
    name = page_name()
    await control.say(do, id=name, **request)
    async with asyncio.timeout(5.0):
        while True:
            for each in control.heard:
                if each.get("id") == name:
                    control.heard.remove(each)
                    return each
            await asyncio.sleep(0.01)


async def listed(control: Control) -> dict[str, dict[str, Any]]:
    """Return the people by name."""
    answer = await asked(control, "list_people")
    assert answer["is"] == "people", answer
    return {each["name"]: each for each in answer["people"]}


async def ends(control: Control) -> int | None:
    async with asyncio.timeout(5.0):
        await control.socket.wait_closed()
    return control.socket.close_code


def test_admin_sees_everybody_with_all_connections(site: Site) -> None:
    viewer, operator = site.link("Vera", Role.VIEWER), site.link("Oda", Role.OPERATOR)
    boss = site.link("Ada", Role.ADMIN)
    url = site.server.url

    async def act() -> None:
        cookie, page = enter(url, viewer), page_name()
        bearer = {"Authorization": f"Bearer {operator}"}
        async with (
            controlling(url, enter(url, boss)) as admin,
            controlling(url, cookie, page) as watcher,
            websocket(url, f"/viser?page={page}", cookie, subprotocols=[SUBPROTOCOL]),
            websocket(url, "/api/v1/socket?name=Sorter", headers=bearer) as program,
        ):
            await program.send('{"do": "acquire"}')
            await admin.wait(holder="Oda, Sorter")
            lines = Lines(site.server)
            with lines.socket, lines.reader:
                lines.say(do="hello", name="Lathe", token=operator)
                assert lines.hear()["is"] == "welcome"
                people = await listed(admin)
            assert list(people) == ["Ada", "Vera", "Oda"]
            assert [each["you"] for each in people.values()] == [True, False, False]
            assert [each["drives"] for each in people.values()] == [False, False, True]
            assert [each["role"] for each in people.values()] == ["admin", "viewer", "operator"]
            kinds = [[one["kind"] for one in each["connections"]] for each in people.values()]
            assert kinds == [["page"], ["page", "scene"], ["program", "lines"]]
            oda = people["Oda"]["connections"]
            assert [each["name"] for each in oda] == ["Oda, Sorter", "Oda, Lathe"]
            assert {each["address"] for each in oda} == {"127.0.0.1"}
            assert people["Oda"]["link"] in site.file.grants
            # No key of an identity is shown, only the numbers of links.
            assert cookie.partition("=")[2] not in json.dumps(people)
            for _ in range(3):
                assert (await asked(watcher, "list_people"))["is"] == "refused"
                assert (await asked(watcher, "kick", person=1))["is"] == "refused"
                assert (await asked(watcher, "kick", person=1))["is"] == "refused"
            assert (await listed(admin))["Vera"]["refused"] == 9
            assert len((await listed(admin))["Oda"]["connections"]) == 1

    asyncio.run(act())


def test_kicked_person_is_disconnected_and_comes_back_later(site: Site) -> None:
    url, token = site.server.url, site.link("Kai", Role.OPERATOR)
    boss = site.link("Ada", Role.ADMIN)

    async def act() -> None:
        cookie = enter(url, token)
        bearer = {"Authorization": f"Bearer {token}"}
        async with controlling(url, enter(url, boss)) as admin:
            async with (
                controlling(url, cookie) as control,
                websocket(url, "/api/v1/socket", headers=bearer) as program,
            ):
                await control.wait(mood="ok", seconds=10.0)
                kai = (await listed(admin))["Kai"]["person"]
                began = time.monotonic()
                assert (await asked(admin, "kick", person=kai, seconds=60))["is"] == "done"
                assert await ends(control) == 4401
                async with asyncio.timeout(5.0):
                    await program.wait_closed()
                assert (program.close_code, program.close_reason) == (4401, KICKED)
                assert time.monotonic() - began < 3.0
            people = await listed(admin)
            assert people["Kai"]["connections"] == []
            assert 50.0 < people["Kai"]["kept_out"] <= 60.0
            # Neither cookie nor link lets Kai in, but STOP works.
            assert ask(f"{url}/api/v1/state", Cookie=cookie)[0] == 403
            body = json.dumps({"token": token}).encode()
            status, _, why = ask(f"{url}/enter", data=body, Origin=url)
            assert (status, why[:30]) == (403, KICKED[:30].encode())
            async with websocket(url, "/api/v1/socket", headers=bearer) as program:
                with pytest.raises(ConnectionClosed, match=KICKED):
                    await program.recv()
            await admin.say("acquire")
            assert ask(f"{url}/stop", data=b"", Cookie=cookie, Origin=url)[0] == 204
            await admin.wait(stopped="Kai pressed STOP.")
            await admin.clear_stop()
            await admin.say("release_lease")
            assert (await asked(admin, "kick", person=kai, seconds=0))["is"] == "done"
            async with controlling(url, enter(url, token)) as control:
                await control.wait(role="operator")
            assert (await asked(admin, "kick", person=kai, seconds=0.5))["is"] == "done"
            await asyncio.sleep(0.6)
            assert enter(url, token)

    asyncio.run(act())


KICKED = "An admin has disconnected you."


def test_revoked_link_is_gone_from_the_access_file(site: Site) -> None:
    url, boss, token = site.server.url, site.link("Ada", Role.ADMIN), site.link("Rita", Role.VIEWER)

    async def act() -> None:
        async with controlling(url, enter(url, boss)) as admin:
            async with controlling(url, enter(url, token)) as control:
                await control.wait()
                people = await listed(admin)
                rita = people["Rita"]
                assert rita["link"] in AccessFile.open(site.file.path).grants
                me = people["Ada"]["person"]
                for refused in (me, 999_999):
                    answer = await asked(admin, "kick", person=refused, revoke=True)
                    assert answer["is"] == "refused"
                answer = await asked(admin, "kick", person=rita["person"], revoke=True)
                assert answer["is"] == "done"
                assert await ends(control) == 4401
            async with asyncio.timeout(5.0):
                while rita["link"] in AccessFile.open(site.file.path).grants:
                    await asyncio.sleep(0.02)
            assert "Rita" not in await listed(admin)
            assert ask(f"{url}/api/v1/stop", data=b"", Authorization=f"Bearer {token}")[0] == 401

    asyncio.run(act())


def test_command_lists_and_kicks(site: Site, tmp_path: Path) -> None:
    boss, viewer = site.link("Ada", Role.ADMIN), site.link("Cleo", Role.VIEWER)
    secret = tmp_path / "token"
    secret.write_text(f"{site.server.url}/#{boss}\n")

    def people(*words: str, token: str = boss) -> tuple[int, str]:
        environment = os.environ | {"KATANA450_TOKEN": token}
        done = subprocess.run(
            [sys.executable, "-m", "katana450", "people", *words, "--url", site.server.url],
            capture_output=True,
            text=True,
            env=environment,
            cwd=ROOT,
            timeout=60,
            check=False,
        )
        assert "Traceback" not in done.stderr
        return done.returncode, done.stdout + done.stderr

    with connect(site.server.url, "Watch", viewer) as watch:
        status, text = people("list")
        assert status == 0
        (line,) = (line for line in text.splitlines() if "Cleo" in line)
        number = line.split()[0]
        assert "viewer" in line
        assert "program" in line
        assert people("list", token=viewer) == (1, "katana450: Only an admin may do this.\n")
        assert people("kick", number, "--seconds", "30")[0] == 0
        with pytest.raises(LostError, match="disconnected"):
            poll(watch)
        assert "kept out" in people("list")[1]
        assert people("let-in", number)[0] == 0
    assert people("kick", "999")[0] == 1
    # The token can also be in a file, as part of its link.
    assert people("list", "--token-file", str(secret), token="")[0] == 0
    with connect(site.server.url, "Watch", viewer):
        assert people("kick", number, "--revoke")[0] == 0


def poll(program: Client) -> None:
    """Query the state for five seconds."""
    for _ in range(50):
        program.query(answers.State)
        time.sleep(0.1)


def test_program_of_an_admin_lists_and_kicks(site: Site) -> None:
    boss, viewer = site.link("Ada", Role.ADMIN), site.link("Paul", Role.VIEWER)
    url = site.server.url
    with connect(url, "Guard", boss) as guard, connect(url, "Watch", viewer) as watch:
        people = {each.name: each for each in guard.people()}
        assert people["Paul"].connections[0].name == "Paul, Watch"
        with pytest.raises(RefusedError, match="Only an admin"):
            watch.people()
        guard.kick(people["Paul"].person, seconds=1.0)
        with pytest.raises(LostError, match="disconnected"):
            poll(watch)
        with pytest.raises(RefusedError, match="disconnect yourself"):
            guard.ask(requests.Kick(person=people["Ada"].person))
