"""Whatever happens in whatever order: the machine raises nothing and moves nothing by itself."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.arm.control.state.arm_report import ArmAct
from katana450.extensions.real_arm.codec.replies import AxisStatus, FirmwareError
from katana450.extensions.real_arm.codec.requests import (
    ArmRequest,
    CommandMotor,
    MotorFlag,
    ReadAxis,
    ReadPositions,
    ReadStates,
    SendSplines,
    SetCollisionDetection,
)
from tests.conftest import LONG
from tests.real_arm.paper_arm import MAP, Conversation

EXAMPLES = 400 if LONG else 15

REFUSABLE = (CommandMotor, ReadAxis, ReadPositions, ReadStates, SendSplines, SetCollisionDetection)
MAX_JUMP = 2
"""[encoders] Distance from the arm to the start of a motion: positions are whole numbers."""

MOVING_FLAGS = (MotorFlag.MOVE, MotorFlag.CALIBRATE, MotorFlag.OFF)

Event = st.one_of(
    st.sampled_from(ArmAct),
    st.sampled_from(["stop", "clear", "lose", "connect"]),
    st.sampled_from(REFUSABLE),
    st.tuples(st.integers(0, 5), st.sampled_from(AxisStatus)),
    st.floats(-0.3, 0.3).map(np.float64),
    st.floats(0.01, 0.8),
)


class Story:
    """A conversation with an arm, and what a person has allowed."""

    def __init__(self, *, engaged: bool = False) -> None:
        self.talk = Conversation()
        self.is_allowed = engaged
        if engaged:
            self.talk.engage()
        self.seen = len(self.talk.arm.requests)

    def happen(self, event: object) -> None:
        talk = self.talk
        match event:
            case ArmAct():
                # The session lets acts pass only while the arm is stopped.
                if talk.stopped:
                    allows = event in (ArmAct.ENGAGE, ArmAct.CALIBRATE, ArmAct.UNBLOCK)
                    self.is_allowed |= allows or event is ArmAct.RELEASE
                    talk.machine.perform(event)
            case "stop":
                talk.stopped = True
            case "clear":
                # As the session: only an arm that follows, from where it is measured.
                if talk.mode().follows:
                    held = talk.reports[-1][2]
                    talk.setpoint, talk.stopped = (lambda _: held), False
            case "lose":
                if talk.machine.wants_link:
                    talk.machine.lost("The test cut the connection.")
                    self.is_allowed, talk.stopped = False, True
            case "connect":
                if talk.machine.wants_link and not talk.mode().follows:
                    talk.machine.connected("tcp://paper")
                    self.is_allowed, talk.stopped = False, True
            case type():
                talk.arm.refusals[event] = FirmwareError(0, -1, 0, "test")
            case (int(axis), AxisStatus() as status):
                talk.arm.states[axis] = int(status)
            case np.float64():
                self.swing(float(event))
            case float():
                self.pass_time(event)

    def swing(self, size: float) -> None:
        talk = self.talk
        if not talk.stopped:
            start, since = talk.setpoint(talk.now), talk.now
            talk.setpoint = lambda t: start + size * np.sin(min(t - since, np.pi)) ** 2

    def pass_time(self, seconds: float) -> None:
        talk = self.talk
        was_stopped = talk.stopped
        talk.run(seconds)
        new, self.seen = talk.arm.requests[self.seen :], len(talk.arm.requests)
        for _, request in new:
            self.check(request, was_stopped=was_stopped)
        if not talk.mode().follows:
            # The session latches a stop.
            talk.stopped = True

    def check(self, request: ArmRequest, *, was_stopped: bool) -> None:
        if isinstance(request, SendSplines):
            assert self.is_allowed
            assert not was_stopped
            for axis, (lower, upper) in enumerate(zip(MAP.lower, MAP.upper, strict=True)):
                segment = request.segments[axis]
                assert lower - 60 <= segment.target <= upper + 60
        elif isinstance(request, CommandMotor) and request.flag in MOVING_FLAGS:
            assert self.is_allowed
            assert request.flag != MotorFlag.MOVE or not was_stopped


@settings(max_examples=EXAMPLES)
@given(st.booleans(), st.lists(Event, max_size=40))
def test_nothing_moves_that_no_person_allowed(engaged: bool, events: list[object]) -> None:
    story = Story(engaged=engaged)
    if not engaged:
        story.happen(ArmAct.CONNECT)
        story.happen("connect")
    for event in events:
        story.happen(event)
        story.pass_time(0.01)
    assert story.talk.arm.largest_jump <= MAX_JUMP


def test_a_story_of_a_motion_moves_the_arm() -> None:
    story = Story()
    events = [ArmAct.CONNECT, "connect", 0.8, ArmAct.ENGAGE, 0.8, "clear", 0.2, np.float64(0.2)]
    for event in [*events, 0.8, 0.8]:
        story.happen(event)
    assert story.talk.sent(SendSplines)
