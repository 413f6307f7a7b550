"""Test the problem of the event log in the panel."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import viser

from katana450.server.view.display_options import LogProblem
from tests.view.gestures import RecordedGestures
from tests.viser_bridge import internals


@pytest.fixture(scope="module")
def server() -> Iterator[viser.ViserServer]:
    server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    yield server
    server.stop()


def test_problem_of_the_log_is_shown_while_it_lasts(server: viser.ViserServer) -> None:
    gestures = RecordedGestures()
    problem = LogProblem(server.gui, gestures)
    page: Any
    (page,) = [h for h in internals.panel(server) if isinstance(h, viser.GuiHtmlHandle)]
    for _ in range(2):
        problem.follow()
        assert not page.visible
        gestures.log_problem = "The event log cannot be written: <No space left on device>."
        problem.follow()
        assert page.visible
        assert "written: &lt;No space left on device&gt;." in page.content
        gestures.log_problem = ""
    problem.follow()
    assert not page.visible
