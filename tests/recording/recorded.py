"""Random sessions of the shipped arm: the real control loop on a test clock, and its records."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import SERVER, Actor, CommandChannel, Person, Role
from katana450.arm.control.session.plans import plan_to
from katana450.arm.control.state.scene_objects import Attachment as Mount
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.control.state.solid import Solid
from katana450.arm.control.state.state import State
from katana450.arm.control.state.stop_cause import pressed
from katana450.arm.drivers.driver import Driver, DriverAnswer, SimulatedDriver
from katana450.arm.runtime.loop import REST_PERIOD, ControlLoop
from katana450.arm.runtime.mailbox import Mailbox
from katana450.arm.runtime.tick import Submission, TickRecord
from katana450.assembly.robot_session import DescribedRobot, describe_robot
from katana450.errors import InputError, KatanaError
from katana450.extensions.recording.files.header import Attachment, RecordingHeader, header_of
from katana450.extensions.recording.files.recording_writer import RecordingWriter
from katana450.extensions.recording.live.ring import RunEvents
from katana450.extensions.recording.messages import StateRow, TargetMessage
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.velocity import JogFrame
from katana450.resources import URDF_PATH
from katana450.settings import Settings
from tests.ticks import SteppedClock

Commands = Callable[[np.random.Generator, State, DescribedRobot], Iterator[cmd.Command]]
"""The commands of the next tick, by the state before it."""

PERIOD = 0.01
ADA = Actor(Person("session-of-ada/1", "Ada", Role.ADMIN, address="10.0.0.7"), CommandChannel.SCENE)
FAILING_EVERY = 300


def state_message(setpoint: list[float], **changes: Any) -> StateRow:
    """Return the message of a state at ``setpoint``, with ``changes`` of its other fields."""
    fields: dict[str, Any] = {"qd": [], "target": TargetMessage(), "findings": [], "mode": "Idle"}
    fields |= {"gripper": 0.0, "gripper_setpoint": 0.0, "speed": 1.0, "status": "ok", "t": 0.0}
    return StateRow(**fields | {"setpoint": setpoint} | changes)


@cache
def described() -> DescribedRobot:
    """Return the shipped robot, read once."""
    return describe_robot(Settings(), URDF_PATH, None)


def fresh() -> DescribedRobot:
    """Return the shipped robot with a session that has computed nothing yet."""
    return describe_robot(Settings(), URDF_PATH, None)


class OddDriver(SimulatedDriver):
    """A driver that is sometimes behind its setpoint, and sometimes fails."""

    count = 0

    def send(self, q: FloatArray, gripper: float, t: float, stopped: bool = False) -> DriverAnswer:
        self.count += 1
        if self.count % FAILING_EVERY == 0:
            raise OSError("the cable came out")
        sent = super().send(q, gripper, t, stopped)
        behind = self.count % 50 < 5
        return DriverAnswer(sent.q - 1e-3, sent.gripper) if behind else sent


def random_commands(
    rng: np.random.Generator, state: State, session: DescribedRobot
) -> Iterator[cmd.Command]:
    """Yield a few commands for the next tick, often none."""
    kind = rng.random()
    if state.stopped is not None:
        yield from [cmd.ClearStop()] * int(kind < 0.05)
    elif state.following is not None and kind < 0.98:
        # Most plans are followed to their end.
        rng.random()
    elif state.t % 4.0 > 2.5:
        # A while without drags, in which the arm comes to rest and can follow a plan.
        if state.motion.at_rest and kind < 0.1:
            goal = session.session.ready + 0.3 * rng.normal(size=5)
            world = session.session.world_at(state)
            with suppress(KatanaError):
                yield cmd.Follow(plan_to(session.session.require_arm(), world, state, goal))
    elif kind < 0.6:
        yield from drag(rng)
    elif kind < 0.7:
        yield from seldom_commands(rng, session)


def drag(rng: np.random.Generator) -> Iterator[cmd.Command]:
    """Yield the next sample of the drag of ``rng``."""
    p = DRAGGED.setdefault(id(rng), np.array((0.3, 0.0, 0.05)))
    yield cmd.Position(p)
    around = p + 0.01 * rng.normal(size=3)
    DRAGGED[id(rng)] = np.clip(around, (0.05, -0.4, -0.26), (0.5, 0.4, 0.3))


def seldom_commands(rng: np.random.Generator, session: DescribedRobot) -> tuple[cmd.Command, ...]:
    """Return the commands of one of several kinds."""
    ready, first = session.session.ready, session.session.begin(session.session.ready, 0.0, 0.0)
    corners = 0.03 * rng.random((8, 3)) + np.array((0.0, 0.0, 0.001))
    stone = Solid("stone", (0.03, 0.03, 0.03), corners)
    place = np.array((*rng.uniform((0.2, -0.3), (0.45, 0.3)), 0.0))
    kinds: tuple[tuple[cmd.Command, ...], ...] = (
        (cmd.Joints(ready + 0.5 * rng.normal(size=5)),),
        (cmd.Stop(pressed("Ada", ADA.key, f"press {rng.random()}", 1e9)),),
        (cmd.Jog(0.1 * rng.normal(size=5), JogFrame.TOOL),),
        (cmd.ReplaceScene(first.objects, 1e-4),),
        (cmd.MoveObject("cup", place),),
        (cmd.Servo(ready + 0.02 * rng.normal(size=5)),),
        (cmd.Attach("cup", Mount.HAND),),
        (cmd.Attach("cup", Mount.WORLD), cmd.Turn(0.5, 0.3 * rng.normal())),
        (cmd.Gripper(abs(0.2 * rng.normal())), cmd.Speed(0.5 + 0.5 * rng.random())),
        (cmd.Pause(), cmd.Resume()),
        (cmd.PlaceObject(SceneObject("stone", Shape.MESH, (), np.eye(4), solid=stone)),),
        (cmd.EndDrag(), cmd.Batch((cmd.Home(), cmd.Gripper(0.1)))),
    )
    return kinds[int(rng.integers(len(kinds)))]


DRAGGED: dict[int, FloatArray] = {}


def run(
    ticks: int,
    seed: int,
    take: Callable[[TickRecord], None],
    commands: Commands = random_commands,
    *,
    odd: bool = True,
    driver: Driver | None = None,
    robot: DescribedRobot | None = None,
) -> ControlLoop:
    """Run the control loop for ``ticks`` with random commands; ``take`` gets every record.

    Args:
        ticks: the number of ticks.
        seed: of the random numbers.
        take: gets the record of each tick.
        commands: the commands of each tick.
        odd: whether the driver sometimes answers otherwise, or fails.
        driver: another driver.
        robot: another robot than the shipped one.
    """
    katana = robot or described()
    rng, clock = np.random.default_rng(seed), SteppedClock(1000.0)
    mailbox = Mailbox(katana.session.check)
    if driver is None:
        kind = OddDriver if odd else SimulatedDriver
        driver = kind(katana.robot.require_arm(), katana.session.ready, 0.0)
    loop = ControlLoop(katana.session, driver, mailbox, clock, 1.0 / PERIOD)
    loop.record = take
    for _ in range(ticks):
        resting = not loop.state_publisher.snapshot.state.moving and rng.random() < 0.1
        clock.t += REST_PERIOD if resting else PERIOD * (1.0 + 0.01 * rng.random())
        for command in commands(rng, loop.state_publisher.snapshot.state, katana):
            try:
                mailbox.put(command, ADA if rng.random() < 0.8 else SERVER)
            except InputError:
                continue
        loop.tick()
    DRAGGED.pop(id(rng), None)
    return loop


def dragging(
    rng: np.random.Generator, _state: State, _session: DescribedRobot
) -> Iterator[cmd.Command]:
    """Yield a drag in 60 % of all ticks, without a pause, as a restless hand sends it."""
    if rng.random() < 0.6:
        yield from drag(rng)


def header(
    *attachments: Attachment, robot: DescribedRobot | None = None, urdf: Path = URDF_PATH
) -> RecordingHeader:
    """Return the header of a recording of the shipped arm, or of another ``robot`` of ``urdf``."""
    katana = robot or described()
    head = header_of(katana.robot, Settings(), urdf, None, katana.session.environment)
    return replace(head, attachments=(*head.attachments, *attachments))


def swinging(
    _rng: np.random.Generator, state: State, session: DescribedRobot
) -> Iterator[cmd.Command]:
    """Yield a command at each rest, so that the arm swings to and fro."""
    if state.motion.at_rest:
        q = session.session.ready.copy()
        q[0] = 0.8 if state.q[0] <= 0.0 else -0.8
        yield cmd.Joints(q)


def record(
    path: Path, ticks: int, seed: int = 1, commands: Commands = random_commands
) -> list[TickRecord]:
    """Write a session, random unless there are other ``commands``, and return its records."""
    records: list[TickRecord] = []
    with path.open("wb") as file:
        writer = RecordingWriter(file, header(Attachment("scene.json", "application/json", b"{}")))

        def take(tick: TickRecord) -> None:
            records.append(tick)
            writer.put(tick)
            if len(records) % 100 == 0:
                writer.event(tick.t, "note", {"number": len(records)})
                writer.flush()

        run(ticks, seed, take, commands)
        writer.close()
    return records


def rewound(path: Path) -> list[State]:
    """Record at ``path`` a drag of Ada that is set back twice, the second time to before the first.

    Return the states before its 180 ticks: the ticks 70, 100, 130 and 150 continue from those of
    40, 30, 120 and of another run.
    """
    events, states = RunEvents(), list[State]()
    states.append(described().session.begin(described().session.ready, 0.0, 0.0))
    rewinds = {70: (40, "ring"), 100: (30, ""), 130: (120, "ring"), 150: (10, "opened.mcap")}

    def commands(
        rng: np.random.Generator, state: State, robot: DescribedRobot
    ) -> Iterator[cmd.Command]:
        states.append(state)
        source, name = rewinds.get(len(states), (None, ""))
        if source is None:
            yield from dragging(rng, state, robot)
        else:
            yield cmd.RestoreState(states[source], name)

    with path.open("wb") as file:
        writer = RecordingWriter(file, header())

        def take(record: TickRecord) -> None:
            named = tuple(Submission(command, ADA) for command, _ in record.submissions)
            record = record._replace(submissions=named)
            writer.put(record)
            for kind, fields in events.of(record):
                writer.event(record.t, kind, fields)

        run(180, 1, take, commands, odd=False)
        writer.close()
    return states
