"""Test the places of the driver and the admins, while viewers take all others."""

from __future__ import annotations

import asyncio
import time
from contextlib import ExitStack
from pathlib import Path

from katana450.arm.control.lease import Role
from katana450.assembly.robot_session import DescribedRobot
from katana450.server.web.access_links import AccessFile
from katana450.server.web.admission import LIMIT_CLOSE_CODE, SOCKETS, SOCKETS_EACH
from katana450.server.web.connection_limit import ConnectionLimit
from tests.gateway.client import HOUR, Control
from tests.gateway.virtual import VirtualServer


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
