"""Test the outcome of a command in its answer, as the arm's process reports it."""

from __future__ import annotations

import asyncio
import time
from concurrent.futures import Future
from typing import Any, cast

import numpy as np
import pytest
from msgspec.inspect import FloatType, IntType, StructType, type_info

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import Role
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.arm_report import ArmAct
from katana450.arm.control.state.messages import PRIORITIES
from katana450.arm.control.state.state import Outcome
from katana450.client import Client, RefusedError
from katana450.errors import InputError
from katana450.extensions.robot_choice.choose_robot import ChooseRobot
from katana450.maths.geometry import se3
from katana450.server.api import answers, requests
from katana450.server.api.program_requests import Breakpoints, Preview, Program, ProgramOrder, Steer
from katana450.server.service import pending_answer, serialize
from katana450.server.service.hub import Hub
from katana450.server.service.identity import Identity
from katana450.server.service.pending_answer import PendingAnswer
from tests.api.test_documented import EVERY_REQUEST
from tests.gateway.virtual import VirtualServer

FAR = se3.from_rotation_translation(np.eye(3), np.array((9.0, 0.0, 0.0)))


def done(answer: answers.Answer) -> answers.Done:
    assert isinstance(answer, answers.Done)
    return answer


def reasons(answer: answers.Done) -> list[str]:
    return [finding.reason for finding in answer.findings]


def test_command_is_accepted_once_a_state_includes_it(program: Client) -> None:
    answer = done(program.ask(requests.Joint(axis=1, value=0.2)))
    assert (answer.outcome, answer.findings) == ("accepted", ())
    assert answer.ticket is not None
    assert program.query(answers.State).ticket >= answer.ticket


def test_command_beyond_a_limit_is_limited_with_the_finding(program: Client) -> None:
    limits = program.query(answers.Arm)
    answer = done(program.ask(requests.Joint(axis=5, value=30.0)))
    assert answer.outcome == "limited"
    (finding,) = answer.findings
    assert (finding.reason, finding.axis) == ("axis limit", 5)
    assert finding.amount == pytest.approx(limits.upper[4])
    # The repeated command is limited again, although the state is unchanged.
    assert done(program.ask(requests.Joint(axis=5, value=30.0))).outcome == "limited"
    # Limits of the joints do not affect the outcome of the gripper, and vice versa.
    assert done(program.ask(requests.Gripper(angle=0.0))).outcome == "accepted"
    assert reasons(done(program.ask(requests.Gripper(angle=9.0)))) == ["gripper limit"]
    assert "out of reach" in reasons(done(program.ask(requests.Pose(T=FAR))))
    assert done(program.ask(requests.Home())).outcome == "accepted"


def plain_sample(kind: type[requests.Request]) -> requests.Request:
    """Return a request of a class whose fields are numbers, near 0.1 within their bounds."""
    values: dict[str, Any] = {}
    for field in cast(StructType, type_info(kind)).fields:
        if field.required:
            number = field.type
            assert isinstance(number, IntType | FloatType), f"add a sample of {kind.__name__}"
            values[field.name] = max(number.ge or 0, 0.1 if isinstance(number, FloatType) else 0)
    return kind(**values)


def test_every_request_that_becomes_a_command_is_answered_with_its_outcome(
    program: Client,
) -> None:
    T = np.eye(4)
    T[:3, 3] = (0.3, 0.3, 0.0)
    place = T
    q = np.array(program.query(answers.State).q)
    scene = program.save_scene()
    key = program.load_scene(scene).key
    samples: dict[type[requests.Request], list[requests.Request]] = {
        requests.Stop: [requests.Stop(press="one"), requests.Stop(press="one"), requests.Stop()],
        requests.ClearStop: [requests.ClearStop()],
        requests.Speed: [requests.Speed(value=0.5), requests.Speed(value=1.0)],
        requests.Joints: [requests.Joints(q=q)],
        requests.StepTool: [requests.StepTool(by=np.array((0.0, 0.0, 0.01, 0.0, 0.0)))],
        requests.Servo: [requests.Servo(q=q)],
        requests.Jog: [requests.Jog(rates=np.array((0.0,) * 5))],
        requests.Pose: [requests.Pose(T=FAR)],
        requests.Position: [requests.Position(p=np.array((0.3, 0.1, 0.0)))],
        requests.Tool: [requests.Tool(name="flange"), requests.Tool(name="tcp")],
        requests.SetPriority: [
            requests.SetPriority(priority=priority) for priority in reversed(PRIORITIES)
        ],
        requests.Branch: [requests.Branch(name="front-down")],
        requests.Hold: [requests.Hold()],
        requests.Place: [
            requests.Place(name="ball", T=place, shape=requests.Shape.SPHERE, size=[0.02])
        ],
        requests.Attach: [requests.Attach(name="ball", to=requests.Attachment.WORLD)],
        requests.Set: [requests.Set(node="cup", field="rotation", value=[0, 0, 1, 0])],
        requests.Remove: [requests.Remove(name="ball")],
        requests.Undo: [requests.Undo()],
        requests.Redo: [requests.Redo()],
        requests.Load: [requests.Load(scene=key)],
        Program: [Program(text="steps:\n  - wait: 20\n")],
        Steer: [
            Steer(order=order)
            for order in (
                ProgramOrder.RUN,
                ProgramOrder.PAUSE,
                ProgramOrder.RESUME,
                ProgramOrder.STEP,
                ProgramOrder.END,
            )
        ],
    }
    no_commands = {
        requests.Hello, requests.Heartbeat, requests.Query, requests.Get, requests.Watch,
        requests.Acquire, requests.Take, requests.Ask, requests.Withdraw, requests.ReleaseLease,
        requests.Give, requests.Decline, requests.Rename,
        # `test_continuation.py` has the second.
        ChooseRobot, requests.ContinueFrom,
        # Refused at a simulated arm.
        requests.OperateArm,
    }  # fmt: skip
    # A five-axis arm refuses a rotation, and has no arm angle; tests/general_arms has both.
    other_arms = {requests.Orient, requests.TurnElbow}
    commands = {*EVERY_REQUEST} - {Breakpoints, Preview}
    assert {*samples} | no_commands | other_arms <= commands
    plain = commands - {*samples} - no_commands - other_arms
    samples |= {kind: [plain_sample(kind)] for kind in sorted(plain, key=str)}
    for kind, several in samples.items():
        for request in several:
            if kind is requests.ClearStop:
                while not program.query(answers.State).clearable:
                    time.sleep(0.02)
            before = program.query(answers.State).ticket
            answer = done(program.ask(request))
            time.sleep(0.5)
            if kind is Program:
                while (progress := program.query(answers.State).program) is None or (
                    progress.status != "ready"
                ):
                    time.sleep(0.02)
            if answer.outcome is None:
                # Then the request became no command.
                assert program.query(answers.State).ticket == before, request
                assert kind is Program
            else:
                expected = ("requested",) if kind is requests.Stop else ("accepted", "limited")
                assert answer.outcome in expected, request


def test_simulated_arm_has_nothing_to_operate(program: Client) -> None:
    with pytest.raises(RefusedError, match="simulated"):
        program.ask(requests.OperateArm(act=ArmAct.CONNECT))
    with pytest.raises(InputError, match=r"^Motors off means the arm falls"):
        requests.RequestDecoder().decoded('{"do": "operate_arm", "act": "release"}')


def test_partly_refused_batch_names_the_refused_parts(session: Session) -> None:
    state = session.begin(session.ready, 0.0, 0.0)
    missing, turned = cmd.MoveObject("ball", position=np.zeros(3)), cmd.Joint(5, 30.0)
    state = session.step(state, [cmd.Batch((turned, missing))], 0.01)
    answer = done(serialize.concluded(answers.Done(ticket=1), *state.outcomes))
    assert (answer.outcome, reasons(answer)) == ("limited", ["axis limit"])
    (part,) = answer.refused
    assert (part.part, part.command, part.why) == (2, "move_object", "There is no object 'ball'.")
    other = cmd.MoveObject("cube", position=np.zeros(3))
    state = session.step(state, [cmd.Batch((missing, other))], 0.02)
    refused = serialize.concluded(answers.Done(ticket=2), *state.outcomes)
    assert isinstance(refused, answers.Refused)
    assert refused.why == "There is no object 'ball'. There is no object 'cube'."


def test_every_channel_reports_the_outcome(local: VirtualServer) -> None:
    with local.speaking() as rows:
        heard = rows.answer(do="joint", axis=1, value=9.0)
        assert (heard["is"], heard["outcome"]) == ("done", "limited")
        assert heard["findings"][0]["reason"] == "axis limit"
        # Without an id only a refusal is sent.
        rows.say(do="joint", axis=1, value=0.0)
        rows.say(do="remove", name="nothing")
        assert "There is no object 'nothing'." in rows.hear()["why"]
        rows.answer(do="release_lease")
    status, answer = local.post(do="joint", axis=1, value=9.0)
    assert (status, answer["outcome"]) == (200, "limited")
    status, answer = local.post(do="remove", name="nothing")
    assert (status, answer["is"]) == (409, "refused")


class SilentArm:
    """An arm that takes commands and never reports their outcome."""

    def __init__(self) -> None:
        self.waiting: list[Future[Outcome]] = []

    def outcome(self, ticket: int) -> Future[Outcome]:
        assert ticket == 7
        self.waiting.append(Future())
        return self.waiting[-1]


def test_outcome_is_unknown_while_the_process_of_the_arm_is_silent(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(pending_answer, "OUTCOME_SECONDS", 0.05)
    hub = Hub(lambda: 0.0)
    hub.gate.arm = cast(Any, SilentArm())
    program = hub.join(Identity("session", "Ada", Role.ADMIN), "page", lambda _: None)
    pending = PendingAnswer(hub, program, answers.Done(id=3, ticket=7))
    answer = done(asyncio.run(pending.answer()))
    assert (answer.id, answer.ticket, answer.outcome) == (3, 7, "unknown")
