"""Plans that the arm of a real server follows, and a STOP during one."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

import katana450
from katana450.client import RefusedError
from katana450.library import motion_plan
from katana450.server.api import answers, requests
from tests.browser.server import AppServer


@pytest.fixture(scope="module")
def server() -> Iterator[AppServer]:
    with AppServer() as running:
        yield running


@pytest.fixture
def client(server: AppServer) -> Iterator[katana450.Client]:
    with katana450.connect(server.url, name="Plan") as connected:
        # A sample that left late on a busy machine stops the arm.
        connected.clear_stop()
        yield connected


def refused_run(run: Callable[[], object]) -> tuple[threading.Thread, list[RefusedError]]:
    """Start ``run``, which is to be refused, in a thread; return also where the refusal comes."""
    refused: list[RefusedError] = []

    def refusal() -> None:
        with pytest.raises(RefusedError) as raised:
            run()
        refused.append(raised.value)

    running = threading.Thread(target=refusal)
    running.start()
    return running, refused


def test_plan_is_followed_to_its_end(shoulder_arm: katana450.Arm, client: katana450.Client) -> None:
    plan = shoulder_arm.line(by=(0.0, 0.0, -0.05))
    state = plan.run(client)
    np.testing.assert_allclose(state.q, plan.end, atol=1e-9)
    assert not state.moving


def test_script_is_run_to_its_end_or_refused_with_the_reason(
    client: katana450.Client, tmp_path: Path
) -> None:
    steps = "steps:\n  - joints: [{}, -68, 85, 8, 0]\n"
    state = client.run(steps.format(10))
    np.testing.assert_allclose(np.degrees(state.q[0]), 10.0, atol=1e-6)
    file = tmp_path / "turn.yaml"
    file.write_text(steps.format(0) + "  - wait: 0\n" * 40, encoding="utf-8")
    np.testing.assert_allclose(client.run(file, speed=0.9).q[0], 0.0, atol=1e-8)
    with pytest.raises(RefusedError, match=r"line 2, column \d+: .*500"):
        client.run(steps.format(500))


def test_run_that_is_stopped_during_planning_ends_with_the_reason(
    client: katana450.Client, server: AppServer
) -> None:
    turns = "".join(f"  - joints: [{k}, -68, 85, 8, {-k}]\n" for k in range(1, 100))
    running, refused = refused_run(lambda: client.run(f"steps:\n{turns}"))
    with katana450.connect(server.url, name="Onlooker") as onlooker:
        for state in onlooker.states(50.0):
            assert running.is_alive(), refused
            if state.program is not None and state.program.status == "planning":
                break
        time.sleep(0.1)
        onlooker.ask(requests.Stop())
        running.join(30.0)
        assert not running.is_alive()
        assert str(refused[0]) == "Not run: STOP was pressed during planning."
        client.clear_stop()


@pytest.mark.long
def test_plan_is_followed_at_a_fraction_of_its_speed(
    shoulder_arm: katana450.Arm, client: katana450.Client
) -> None:
    plan = shoulder_arm.plan([0.2, -1.0, 1.4, 0.3, 0.0])
    client.joints(plan.start)
    start = time.monotonic()
    state = plan.run(client, speed=0.5)
    assert 2.0 * plan.duration < time.monotonic() - start < 2.0 * plan.duration + 3.0
    np.testing.assert_allclose(state.q, plan.end, atol=1e-9)
    with pytest.raises(katana450.InputError, match=r"speed is 0\.0; it must be above 0"):
        plan.run(client, speed=0.0)


def test_plan_waits_while_its_samples_are_late(
    shoulder_arm: katana450.Arm, client: katana450.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = shoulder_arm.plan([0.4, -1.0, 1.4, 0.3, 0.0], [0.0, -1.0, 1.4, 0.3, 0.0])
    samples, number = [], 3
    replace = msgspec.structs.replace

    def delayed(request: Any, **fields: Any) -> Any:
        if isinstance(request, requests.Servo) and "made" in fields:
            samples.append(request)
            fields["made"] -= 0.5 * (20 < len(samples) <= 20 + number)
        return replace(request, **fields)

    monkeypatch.setattr(msgspec.structs, "replace", delayed)
    state = plan.run(client)
    np.testing.assert_allclose(state.q, plan.end, atol=1e-9)
    # A busy machine delays others too; each late sample is sent again.
    assert len(samples) >= len(plan.sample(0.02).t) + number
    # A connection that stays slow ends the run.
    monkeypatch.setattr(motion_plan, "MAX_WAIT", 0.3)
    samples.clear()
    number = 10_000
    with pytest.raises(RefusedError, match=r"arrived [\d.]+ s late") as raised:
        plan.run(client)
    assert raised.value.retry == 0.1


@pytest.mark.parametrize(
    "where", [pytest.param("on the way to the start", marks=pytest.mark.long), "on the plan"]
)
def test_stop_that_is_cleared_at_once_ends_the_run(
    shoulder_arm: katana450.Arm, client: katana450.Client, server: AppServer, where: str
) -> None:
    plan = shoulder_arm.plan([2.0, -1.0, 1.4, 0.3, 0.0], [-2.0, -1.0, 1.4, 0.3, 0.0])
    to_start = where == "on the way to the start"
    client.joints(plan.end if to_start else plan.start)
    running, refused = refused_run(lambda: plan.run(client))
    with katana450.connect(server.url, name="Onlooker") as onlooker:
        for state in onlooker.states(50.0):
            assert running.is_alive(), refused
            if abs(state.q[0] - plan.start[0]) < 3.5 if to_start else state.q[0] > -1.5:
                break
        # On the connection that also carries the run.
        client.send(requests.Stop())
        client.clear_stop()
        running.join(60.0)
        assert len(refused) == 1
        assert re.search("STOP|stopped", str(refused[0]))
        at_rest = next(snapshot for snapshot in onlooker.states() if not snapshot.moving)
        assert at_rest.stopped is None
        time.sleep(0.2)
        assert onlooker.query(answers.State).q == at_rest.q
        assert -1.9 < at_rest.q[0] < 1.9
