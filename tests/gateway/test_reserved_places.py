"""Test the places of the driver and the admins, while viewers take all others."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import AsyncExitStack, ExitStack, asynccontextmanager, suppress
from pathlib import Path

import pytest
from websockets.exceptions import InvalidStatus

from katana450.arm.control.lease import Role
from katana450.assembly.robot_session import DescribedRobot
from katana450.server.viser_bridge.proxy import MAX_BROWSERS, MAX_BROWSERS_EACH
from katana450.server.web.access_links import AccessFile
from katana450.server.web.admission import LIMIT_CLOSE_CODE, SOCKETS, SOCKETS_EACH
from katana450.server.web.connection_limit import ConnectionLimit
from katana450.server.web.program_socket import LINES, LINES_EACH
from tests.gateway.client import (
    HOUR,
    SUBPROTOCOL,
    Control,
    Peer,
    controlling,
    page_name,
    websocket,
)
from tests.gateway.lines import Lines
from tests.gateway.site import Site, open_site
from tests.gateway.virtual import VirtualServer


@pytest.fixture
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with open_site(tmp_path_factory.mktemp("places"), "--lines", "0") as site:
        yield site


def test_reserved_places_are_free_when_all_others_are_taken() -> None:
    limit = ConnectionLimit(maximum=4, each=3)
    with ExitStack() as stack:

        def takes(identity: str, reserved: int = 0) -> bool:
            return stack.enter_context(limit.taken(identity, reserved))

        assert [takes("a") for _ in range(4)] == [True, True, True, False]
        assert [takes("b") for _ in range(2)] == [True, False]
        assert [takes("admin", 2) for _ in range(3)] == [True, True, False]
        # Who already has as many places has no more.
        assert not takes("a", 2)
    with limit.taken("b") as free:
        assert free


async def crowd_in(site: Site, stack: AsyncExitStack, path: str, links: int, each: int) -> int:
    """Open ``each`` websockets with each of ``links`` viewers; return how many were accepted."""
    opened = 0
    for _ in range(links):
        cookie = site.cookie(Role.VIEWER)
        for _ in range(each):
            options = {"subprotocols": [SUBPROTOCOL]} if path == "/viser" else {}
            line = websocket(site.server.url, f"{path}?page={page_name()}", cookie, **options)
            with suppress(InvalidStatus):
                socket = await stack.enter_async_context(line)
                if path == "/viser":
                    # Otherwise the frames of the scene fill the memory of the test.
                    socket.transport.pause_reading()
                opened += 1
    return opened


async def whole_page(site: Site, cookie: str) -> None:
    """Open a page with its scene, and a program; both are served."""
    url, page = site.server.url, page_name()
    async with (
        controlling(url, cookie, page) as control,
        websocket(url, f"/viser?page={page}", cookie, subprotocols=[SUBPROTOCOL]) as scene,
        websocket(url, "/api/v1/socket?name=Mine", cookie) as program,
    ):
        await control.wait(10.0)
        assert json.loads(await program.recv())["is"] == "welcome"
        await Peer(scene).learn()


@asynccontextmanager
async def driving(site: Site, cookie: str) -> AsyncIterator[Control]:
    """Open the control socket of a page that drives the arm."""
    async with controlling(site.server.url, cookie) as control:
        await control.wait(mood="ok", seconds=10.0)
        await control.say("acquire")
        await control.wait(mine=True)
        yield control


def test_admin_and_driver_get_in_while_viewers_hold_all_websockets(
    described: DescribedRobot, tmp_path: Path
) -> None:
    file = AccessFile.create(tmp_path / "access.json")

    async def act(server: VirtualServer) -> None:
        async def cookie(role: Role) -> str:
            return await server.enter(file.give(role.value, role, time.time() + HOUR))

        async def welcome(cookie: str) -> bool:
            control = await server.control(cookie)
            await asyncio.sleep(0.1)
            crowd.append(control)
            assert control.socket.close_code in (None, LIMIT_CLOSE_CODE)
            return control.socket.close_code is None

        crowd: list[Control] = []
        driver, admin = await cookie(Role.OPERATOR), await cookie(Role.ADMIN)
        driving = await server.control(driver)
        await driving.wait(mood="ok")
        await driving.say("acquire")
        await driving.wait(mine=True)
        for _ in range(SOCKETS // SOCKETS_EACH):
            viewer = await cookie(Role.VIEWER)
            for _ in range(SOCKETS_EACH):
                crowd.append(await server.control(viewer))
        assert not await welcome(await cookie(Role.VIEWER))
        # An operator who does not drive has no place reserved.
        assert not await welcome(await cookie(Role.OPERATOR))
        assert await welcome(admin)
        assert await welcome(driver)
        await driving.say("stop")
        await driving.wait(stop="confirmed")
        for each in (driving, *crowd):
            await each.close()

    with VirtualServer(described, access=file) as server:
        server.run(act(server))


@pytest.mark.long
def test_admin_gets_in_while_viewers_hold_the_tcp_port(site: Site) -> None:
    def welcomed(stack: ExitStack, token: str) -> bool:
        lines = Lines(site.server)
        stack.enter_context(lines.socket)
        stack.enter_context(lines.reader)
        lines.say(do="hello", name="Crowd", token=token)
        return bool(lines.hear()["is"] == "welcome")

    with ExitStack() as stack:
        for _ in range(LINES // LINES_EACH):
            token = site.link("Viewer", Role.VIEWER)
            assert all(welcomed(stack, token) for _ in range(LINES_EACH))
            assert not welcomed(stack, token)
        assert not welcomed(stack, site.link("Operator", Role.OPERATOR))
        admin = site.link("Admin", Role.ADMIN)
        assert [welcomed(stack, admin) for _ in range(3)] == [True, True, False]


@pytest.mark.long
def test_admin_and_driver_get_the_scene_while_viewers_watch_everywhere(site: Site) -> None:
    async def act() -> None:
        driver, admin = site.cookie(Role.OPERATOR), site.cookie(Role.ADMIN)
        async with driving(site, driver), AsyncExitStack() as stack:
            links = MAX_BROWSERS // MAX_BROWSERS_EACH
            count = await crowd_in(site, stack, "/viser", links + 1, MAX_BROWSERS_EACH)
            assert count == MAX_BROWSERS
            await whole_page(site, admin)
            await whole_page(site, driver)

    asyncio.run(act())
