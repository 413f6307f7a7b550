"""Helpers of tests with a hostile page beside one that watches."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from tests.gateway.client import Peer, opened

BRIEF = 0.1
"""Time [s] in which the next frame arrives: six periods of the view."""


@asynccontextmanager
async def peers(url: str) -> AsyncIterator[tuple[Peer, Peer]]:
    """Open a hostile page and one that watches."""
    async with opened(url) as (bad, _), opened(url) as (good, _):
        yield bad, good


async def moves_the_arm(good: Peer, degrees: float) -> list[dict[str, Any]]:
    """Turn axis 1, and return what ``good`` hears of it until nothing more comes."""
    await good.set("1 base turn", value=degrees)
    heard: list[dict[str, Any]] = []
    async with asyncio.timeout(20.0):
        while not any(each["type"] == "SetOrientationMessage" for each in heard):
            heard += await good.listen()
    return heard
