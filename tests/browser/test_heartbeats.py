"""A page sends heartbeats seldom while nobody drives, and often from the first act on."""

from __future__ import annotations

import pytest

from tests.browser.conftest import OpenPage
from tests.browser.page import ViserPage
from tests.browser.server import APP, ATTENTIVE_APP, AppServer
from tests.browser.session import MOVE, Truth, take
from tests.gateway.slow_link import SlowLink

RESTED = 4000.0
"""Time [ms] after which a page that nobody uses counts as at rest."""


def rate(page: ViserPage) -> float:
    """Return the number of heartbeats per second, measured for two seconds."""
    (worker,) = (each for each in page.page.workers if each.url.endswith("link.js"))
    before = worker.evaluate("[count, performance.now()]")
    page.page.wait_for_timeout(2000.0)
    after = worker.evaluate("[count, performance.now()]")
    return 1e3 * float(after[0] - before[0]) / float(after[1] - before[1])


@pytest.mark.long
def test_heartbeats_are_seldom_only_while_nothing_can_move(open_page: OpenPage) -> None:
    with AppServer(APP) as server:
        truth = Truth(server)
        page = open_page(server.url, nodes=("/arm", MOVE))
        page.page.wait_for_timeout(RESTED)
        assert 1.4 < rate(page) < 2.6
        other = open_page(server.url, nodes=("/arm", MOVE))
        take(other)
        # Nobody uses this window.
        assert 7.0 < rate(page) < 11.0
        other.page.close()
        truth.wait(holder=None)
        page.page.wait_for_timeout(RESTED)
        assert 1.4 < rate(page) < 2.6
        take(page)
        page.page.wait_for_timeout(RESTED)
        assert 7.0 < rate(page) < 11.0


def test_first_drag_after_a_rest_does_not_stop_on_a_slow_connection(open_page: OpenPage) -> None:
    with AppServer(ATTENTIVE_APP) as server, SlowLink(server.port, 1e9) as line:
        truth = Truth(server)
        page = open_page(f"http://127.0.0.1:{line.port}", nodes=("/arm", MOVE))
        page.page.wait_for_timeout(RESTED)
        # The page learns that it drives long after the heartbeat timeout.
        line.delay, line.late_answers = 0.6, True
        page.page.wait_for_timeout(1000.0)
        before = truth.status()["q"]
        page.drag_arrow(MOVE, "z", 0.03)
        page.wait_until(lambda: truth.status()["q"] != before, "motion")
        page.wait_until(lambda: not truth.status()["moving"], "rest")
        assert truth.status()["stopped"] is None
        assert page.errors == []
