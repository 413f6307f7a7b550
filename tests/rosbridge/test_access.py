"""Clients of rosbridge are admitted like all programs: by links, roles, sites and names."""

from __future__ import annotations

from pathlib import Path

import pytest
from websockets.exceptions import InvalidStatus

from katana450.arm.control.lease import Role
from tests.browser.server import APP, AppServer
from tests.gateway.client import ask
from tests.gateway.site import open_site
from tests.rosbridge.ros_client import FOLLOW, TWIST, ros, trajectory, twist

pytestmark = pytest.mark.anyio

ELSEWHERE = "http://robots.test:3000"


async def test_link_is_required_and_its_role_decides(tmp_path: Path) -> None:
    with open_site(tmp_path) as site:
        url = site.server.url
        for query in ("", "?token=wrong"):
            async with ros(url, query, watches=False) as client:
                assert "A token is required" in await client.refusal()
                await client.socket.wait_closed()
                assert client.socket.close_code == 4401
        viewer, operator = (site.link(role.value, role) for role in (Role.VIEWER, Role.OPERATOR))
        headers = {"Authorization": f"Bearer {operator}"}
        async with (
            ros(url, f"?token={viewer}&name=Onlooker") as onlooker,
            ros(url, headers=headers) as driver,
        ):
            await onlooker.say("publish", id="t", topic=TWIST, msg=twist(vx=0.2))
            assert "watch" in await onlooker.refusal("t")
            goal = trajectory((1.0, [0.1, -1.2, 1.4, 0.1, 0.0]))
            result = await onlooker.result(await onlooker.goal(FOLLOW, goal))
            assert (result["status"], result["values"]["error_code"]) == (6, -1)
            assert "watch" in result["values"]["error_string"]
            number = await driver.goal(FOLLOW, trajectory((5.0, [0.5, -1.2, 1.4, 0.1, 0.0])))
            await driver.when(lambda state: state["moving"])
            # Everybody may stop the arm.
            response = await onlooker.call("/stop")
            assert response["values"]["success"] is True
            assert (await driver.result(number))["status"] == 5
            state = await driver.when(lambda state: state["stop"] == "confirmed")
            assert "Onlooker" in state["stopped"]
        # Neither an accepted nor a refused address is printed.
        with pytest.raises(InvalidStatus):
            async with ros(url, f"?token={viewer}", origin=ELSEWHERE):
                pass
        assert viewer not in site.server.output


@pytest.mark.long
async def test_pages_of_named_sites_alone_may_connect() -> None:
    with AppServer((*APP, "--ros-page", ELSEWHERE)) as server:
        for origin in ("http://evil.test", "http://robots.test", "null"):
            with pytest.raises(InvalidStatus):
                async with ros(server.url, origin=origin):
                    pass
        async with ros(server.url, origin=ELSEWHERE) as client:
            await client.state()
        # That site gets no more than a websocket.
        status, *_ = ask(f"{server.url}/api/v1/stop", data=b"", Origin=ELSEWHERE)
        assert status == 403
