"""Test requests for the lease, take-overs, and the name of who stopped."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest

from tests.gateway.client import Control
from tests.gateway.virtual import VirtualServer

SCRIPT = """\
name: Wave
speed: 0.2
steps:
  - joints: [100, -60, 85, 8, 0]
  - joints: [-100, -60, 85, 8, 0]
"""


@asynccontextmanager
async def closed(*controls: Control) -> AsyncIterator[None]:
    """Close ``controls`` after the block."""
    yield
    for each in controls:
        await each.close()


async def until_program(owner: Control, status: str) -> None:
    async with asyncio.timeout(30.0):
        while True:
            await owner.say("query")
            program = (await owner.notice("state")).get("program") or {}
            if program.get("status") == status:
                return
            await asyncio.sleep(0.05)


async def run_program(owner: Control) -> None:
    await owner.say("program", text=SCRIPT)
    await until_program(owner, "ready")
    await owner.say("steer", order="run")
    await owner.wait(holder="Wave")


def test_owner_of_a_running_program_decides_about_requests(local: VirtualServer) -> None:
    async def act() -> None:
        owner, other = await local.control(), await local.control()
        async with closed(owner, other):
            await run_program(owner)
            await owner.wait(orders=["end"], pace="", planning=False, asking=[], own_program=True)
            assert not other.status["own_program"]
            await other.say("ask")
            await other.wait(asked=True)
            (asking,) = (await owner.wait(asking=[await numbered(owner, other)]))["asking"]
            # No other participant may decide.
            await other.say("decline", to=asking["number"])
            assert "do not hold" in (await other.notice("refused"))["why"]
            await owner.say("decline", to=asking["number"])
            refused = await other.notice("refused")
            assert refused["why"] == f"{owner.status['name']} declined your request."
            await other.wait(asked=False)
            await owner.wait(asking=[], holder="Wave")
            await other.say("ask")
            await owner.wait(asking=[asking])
            await owner.say("give", to=asking["number"])
            await other.wait(mine=True)
            await until_program(owner, "stopped")
            await owner.wait(mine=False, orders=[], holder=other.status["name"])

    local.run(act())


async def numbered(owner: Control, other: Control) -> dict[str, Any]:
    """Return ``other`` as the only entry in the list of requests that ``owner`` gets."""
    async with asyncio.timeout(5.0):
        while not owner.status["asking"]:
            await asyncio.sleep(0.01)
    (asking,) = owner.status["asking"]
    assert asking["name"] == other.status["name"]
    return dict(asking)


@pytest.mark.parametrize("by_program", [False, True])
def test_former_driver_gets_the_name_of_the_new_one(local: VirtualServer, by_program: bool) -> None:
    async def act() -> None:
        driver, other = await local.control(), await local.control()
        async with closed(driver, other):
            if by_program:
                await run_program(driver)
            else:
                await driver.say("acquire")
                await driver.wait(mine=True)
            assert driver.status["taken"] == ""
            await other.say("take")
            await other.wait(mine=True, taken="")
            await driver.wait(mine=False, taken=f"{other.status['name']} took over from you.")
            await other.say("release_lease")
            await driver.wait(holder=None, taken="")
            await driver.say("acquire")
            await driver.wait(mine=True, taken="")

    local.run(act())
