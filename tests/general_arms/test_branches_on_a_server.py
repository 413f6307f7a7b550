"""Branches of an OpenMANIPULATOR-X on a real server: each choice moves the arm or has a reason."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from katana450.client import Client, connect
from katana450.server.api import answers, requests
from tests.browser.server import APP, AppServer
from tests.general_arms.links_of_arms import openmanipulator_x

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    path = tmp_path_factory.mktemp("open") / "open_manipulator_x.urdf"
    path.write_text(openmanipulator_x(), encoding="utf-8")
    with (
        AppServer((*APP, "--urdf", str(path))) as server,
        connect(server.url) as client,
    ):
        client.ask(requests.Acquire())
        yield client


def state(client: Client) -> answers.State:
    found = client.ask(requests.Query(at="state"))
    assert isinstance(found, answers.State)
    return found


def options(client: Client) -> list[answers.BranchOption]:
    found = client.ask(requests.Query(at="branches"))
    assert isinstance(found, answers.Branches)
    return found.choices


def test_each_branch_moves_the_arm_or_has_its_reason(arm: Client) -> None:
    choices = options(arm)
    assert [each.name for each in choices] == ["front-up", "front-down", "back-up", "back-down"]
    assert [bool(each.refusal) for each in choices] == [False, True, False, True]
    for each in choices:
        arm.ask(requests.Home(wait=30))
        before = state(arm)
        assert "-".join(before.branch or ()) == "front-up"
        done = arm.ask(requests.Branch(name=each.name, wait=30))
        assert isinstance(done, answers.Done)
        assert done.end is not None
        after = state(arm)
        if each.refusal:
            assert "exclude the branch" in each.refusal
            assert done.end.how == "failed"
            assert done.end.why == f"{each.refusal}."
            np.testing.assert_array_equal(after.q, before.q)
        elif done.end.how == "failed":
            # No path, or a contact at its end: the reason says which.
            assert done.end.why
            np.testing.assert_array_equal(after.q, before.q)
        else:
            assert "-".join(after.branch or ()) == each.name
            np.testing.assert_allclose(after.q, each.q, atol=1e-6)
