"""What an answer says of a command: accepted, limited or refused, as the arm's process told."""

from __future__ import annotations

import asyncio
from concurrent.futures import Future
from typing import Any, cast

import pytest

from katana450.arm.control.state import Outcome
from katana450.client import Client, RefusedError, aconnect
from katana450.server.api import answers, requests
from katana450.server.service import dispatcher
from katana450.server.service.dispatcher import Dispatcher
from katana450.server.service.hub import Hub
from tests.browser.server import AppServer
from tests.gateway.lines import post, speaking

FAR = [[1.0, 0.0, 0.0, 9.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]


def done(answer: answers.Answer) -> answers.Done:
    assert isinstance(answer, answers.Done)
    return answer


def reasons(answer: answers.Done) -> list[str]:
    return [found.reason for found in answer.findings]


def test_a_command_is_accepted_once_a_state_has_it_in_it(program: Client) -> None:
    answer = done(program.ask(requests.Joint(axis=1, value=0.2)))
    assert (answer.outcome, answer.findings) == ("accepted", ())
    assert answer.ticket is not None
    assert program.query(answers.State).ticket >= answer.ticket


def test_a_command_beyond_a_limit_is_limited_with_the_finding(program: Client) -> None:
    limits = program.query(answers.Arm)
    answer = done(program.ask(requests.Joint(axis=5, value=30.0)))
    assert answer.outcome == "limited"
    (found,) = answer.findings
    assert (found.reason, found.axis) == ("axis limit", 5)
    assert found.amount == pytest.approx(limits.upper[4])
    # Said again it is limited again, though the state is the same as before.
    assert done(program.ask(requests.Joint(axis=5, value=30.0))).outcome == "limited"
    # What limits the joints says nothing of the gripper, and the other way round.
    assert done(program.ask(requests.Gripper(angle=0.0))).outcome == "accepted"
    assert reasons(done(program.ask(requests.Gripper(angle=9.0)))) == ["gripper limit"]
    assert "out of reach" in reasons(done(program.ask(requests.Pose(T=cast(Any, FAR)))))
    assert done(program.ask(requests.Home())).outcome == "accepted"


def test_a_command_that_the_session_drops_is_refused_with_the_reason(program: Client) -> None:
    program.ask(requests.Place(name="ball", form=requests.Form.SPHERE, size=[0.02]))
    assert done(program.ask(requests.Remove(name="ball"))).outcome == "accepted"
    with pytest.raises(RefusedError, match="no 'ball'"):
        program.ask(requests.Remove(name="ball"))


def test_samples_of_a_stream_are_answered_at_once(program: Client) -> None:
    q = program.query(answers.State).q
    assert done(program.ask(requests.Servo(q=q))).outcome == "accepted"
    assert done(program.ask(requests.Jog(rates=(0.0,) * 5))).outcome == "accepted"


def test_what_is_no_command_has_no_outcome(program: Client) -> None:
    answer = done(program.ask(requests.ClearStop()))
    assert (answer.outcome, answer.ticket) == (None, None)


def test_every_channel_says_it(server: AppServer) -> None:
    with speaking(server) as lines:
        heard = lines.answer(do="joint", axis=1, value=9.0)
        assert (heard["is"], heard["outcome"]) == ("done", "limited")
        assert heard["findings"][0]["reason"] == "axis limit"
        # Without an id only a refusal is told.
        lines.say(do="joint", axis=1, value=0.0)
        lines.say(do="remove", name="nothing")
        while (heard := lines.hear())["is"] != "refused":
            assert heard["is"] != "done"
        assert "There is no 'nothing'." in heard["why"]
        lines.answer(do="release_lease")
    status, answer = post(server, do="joint", axis=1, value=9.0)
    assert (status, answer["outcome"]) == (200, "limited")
    status, answer = post(server, do="remove", name="nothing")
    assert (status, answer["is"]) == (409, "refused")
    post(server, do="release_lease")

    async def ask() -> answers.Answer:
        async with aconnect(server.url) as arm:
            answer = await arm.ask(requests.Joint(axis=1, value=0.0))
            await arm.ask(requests.ReleaseLease())
            return answer

    assert done(asyncio.run(ask())).outcome == "accepted"


class SilentArm:
    """Takes commands and never tells what became of them."""

    def __init__(self) -> None:
        self.waiting: list[Future[Outcome]] = []

    def outcome(self, ticket: int) -> Future[Outcome]:
        assert ticket == 7
        self.waiting.append(Future())
        return self.waiting[-1]


def test_outcome_is_unknown_while_the_process_of_the_arm_is_silent(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(dispatcher, "OUTCOME_SECONDS", 0.05)
    hub = Hub(lambda: 0.0)
    hub.gate.arm = cast(Any, SilentArm())
    pending = answers.Done(id=3, ticket=7)
    assert Dispatcher.is_pending(pending)
    answer = done(asyncio.run(Dispatcher(hub).concluded(pending)))
    assert (answer.id, answer.ticket, answer.outcome) == (3, 7, "unknown")
    assert not Dispatcher.is_pending(answer)
