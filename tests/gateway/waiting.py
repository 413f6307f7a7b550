"""Requests with `wait` over HTTP, and a program that watches the arm meanwhile."""

from __future__ import annotations

import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

from katana450.client import Client
from katana450.server.api import answers, requests
from tests.browser.server import AppServer
from tests.gateway.lines import post
from tests.gateway.postures import THERE

# Fraction of full speed, at which motions last longer than the timeout for heartbeats.
SLOW = 0.2


def slow(watcher: Client) -> None:
    """Make motions slow."""
    watcher.ask(requests.Speed(value=SLOW))
    watcher.ask(requests.ReleaseLease())


@contextmanager
def moving(server: AppServer, watcher: Client, **request: Any) -> Iterator[Future[tuple[int, Any]]]:
    """Send a request with `wait` over HTTP; enter the block once the arm moves."""
    slow(watcher)
    with ThreadPoolExecutor(1) as pool:
        asked = {"do": "joints", "q": THERE.tolist(), "wait": 30} | request
        answer = pool.submit(lambda: post(server, **asked))
        wait_for(watcher, under_way)
        yield answer


def wait_for(watcher: Client, true: Any, seconds: float = 5.0) -> answers.State:
    end = time.monotonic() + seconds
    while not true(now := watcher.query(answers.State)):
        assert time.monotonic() < end, now
        time.sleep(0.02)
    return now


@contextmanager
def wall(watcher: Client, place: tuple[float, float, float], size: list[float]) -> Iterator[None]:
    """Place a box in the base frame [m] inside the block."""
    x, y, z = place
    T = ((1.0, 0.0, 0.0, x), (0.0, 1.0, 0.0, y), (0.0, 0.0, 1.0, z), (0.0, 0.0, 0.0, 1.0))
    watcher.ask(requests.Place(name="wall", T=T, shape=requests.Shape.BOX, size=size))
    watcher.ask(requests.ReleaseLease())
    yield
    watcher.ask(requests.Remove(name="wall"))
    watcher.ask(requests.ReleaseLease())


def under_way(now: answers.State) -> bool:
    """Return whether the arm moves indeed; ``moving`` includes commands that wait."""
    return (now.tool_speed or 0.0) > 0.01


def check_nothing_moves_later(watcher: Client) -> None:
    """Check that the arm rests, has dropped its target, and stays where it is."""
    before = wait_for(watcher, lambda now: not now.moving)
    time.sleep(0.5)
    after = watcher.query(answers.State)
    assert after.q == before.q == after.goal
    assert after.holder is None
