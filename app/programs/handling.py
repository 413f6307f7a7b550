"""Steps that handle things: fill the cup, take it, pour it out, set it down.

They are planned from where the things stand, and refused with the reason where they stand badly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from app.control import commands as cmd
from app.control.plans import plan_along
from app.control.pouring import CUP
from app.control.room import girth
from app.control.state import State
from app.control.things import Thing
from app.errors import InputError
from app.geometry import se3
from app.geometry.arrays import FloatArray
from app.kinematics.branch import branch_of
from app.kinematics.tool import ToolTarget
from app.planning.curve import Curve, Linear, ToolArc, ToolLine
from app.planning.path import Path
from app.planning.plan import JOINED, MARGIN
from app.planning.tool_path import ToolPath
from app.programs import fields as read
from app.programs.bench import Bench
from app.programs.fields import Fields
from app.programs.order import Filling, Go, Grip, Pace, Putting, Use, Wait
from app.programs.setting import Setting
from app.programs.source import Value

PITCHES = tuple(np.radians((30.0, 35.0, 25.0, 40.0, 20.0, 45.0)).tolist())
"""[rad] Tried in this order when a thing is taken: flatter ones pour better, but the shoulder's
limit keeps a level tool above 110 mm."""

TAKEN_AT = 0.78
"""Of a thing's height: above the middle, where the palm has room over the table."""

SHORTEST, LONGEST_BACK, STEP = 0.0, 0.03, 0.002
"""[m] How far before the thing's axis the tool frame closes: as near as the palm has room."""

APPROACHES = (0.09, 0.07, 0.055, 0.045, 0.035)
"""[m] From how far the open fingers come, the farthest first."""

ROOM = MARGIN + 5e-4
"""[m] Between the palm and what the fingers close on."""

CARRY = 1.0
"""[m/s^2] The most of the tool while it carries something."""

POUR_TURN = math.radians(165.0)
"""About the tool's axis: with the tool tilted at all the cup is past its side then."""

POUR_PACE = 0.3
"""Of the speed, while it is poured: a thin stream keeps together."""

ABOVE_RIM = 0.13
"""[m] The tool over the basin's rim: the cup turns over between them."""

SHAKE = math.radians(25.0)

DRAINED = 1.5
"""[s] Until the last of it has run out."""

SET_DOWN = MARGIN + 2e-4
"""[m] Above the table, from where what is set down comes to stand."""

POURING = "pour"
"""What the task is called that turns the cup over."""

CLOSING = 500
"""Ticks that fingers may take."""

TICK = 0.01
"""[s]"""


@dataclass(frozen=True)
class Fill:
    """Fill the cup with water [m^3]."""

    volume: float

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        return cls(1e-6 * read.number(0.0, 1000.0, "ml")(value))

    def lay(self, bench: Bench) -> None:
        command = cmd.Fill(self.volume)
        bench.rig.session.check(command)
        bench.note("fill", Filling(self.volume), _after(bench, command, ticks=1))


@dataclass(frozen=True)
class Put:
    """Have a thing stand elsewhere on the table, x, y [m] in the base frame; nothing carries it."""

    name: str
    x: float
    y: float

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        fields = Fields(value, "a put")
        found = cls(
            fields.need("thing", read.text, ""),
            fields.need("x", read.millimetres(), 0.0),
            fields.need("y", read.millimetres(), 0.0),
        )
        fields.done()
        return found

    def lay(self, bench: Bench) -> None:
        thing = _thing(bench, self.name)
        if thing.carried:
            raise InputError(f"{self.name} is in the hand: set it down first.")
        T = se3.from_rotation_translation(thing.T[:3, :3], (self.x, self.y, 0.0))
        put = replace(thing, T=T)
        for other in bench.state.things:
            if other.name != thing.name and _overlap(put, other):
                raise InputError(f"{self.name} would stand in {other.name}.")
        command = cmd.Place(put)
        bench.note(f"put {self.name}", Putting(put), _after(bench, command, ticks=1))


@dataclass(frozen=True)
class Grasp:
    """Take a thing between the fingers: open, come from the front, close until both touch."""

    name: str
    pitch: float | None
    height: float | None

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        if value.kind == "text":
            return cls(read.text(value), None, None)
        fields = Fields(value, "a grasp")
        found = cls(
            fields.need("thing", read.text, ""),
            fields.take("pitch", read.degrees(0.0, 90.0), None),
            fields.take("height", read.millimetres(1.0, 500.0), None),
        )
        fields.done()
        return found

    def lay(self, bench: Bench) -> None:
        thing = _thing(bench, self.name)
        if bench.state.grip is not None:
            raise InputError("The hand holds something already: set it down first.")
        if not thing.can_be_held:
            raise InputError(f"{self.name} is not for the fingers to take.")
        _tool(bench, "grasp")
        fingers = bench.rig.arm.gripper
        bench.note("open", Grip(fingers.upper), _after(bench, cmd.SetGripper(fingers.upper)))
        refused: InputError | None = None
        for pitch in PITCHES if self.pitch is None else (self.pitch,):
            before = bench.state, list(bench.orders)
            try:
                self._take(bench, thing, pitch)
            except InputError as error:
                bench.state, bench.orders = before
                # Of the pitch that is tried first.
                refused = refused or error
                continue
            return
        assert refused is not None
        raise InputError(f"{self.name} cannot be taken where it stands: {refused}") from refused

    def _take(self, bench: Bench, thing: Thing, pitch: float) -> None:
        height = TAKEN_AT * thing.height if self.height is None else self.height
        middle = bench.point(thing.T[:3, 3] + (0.0, 0.0, height), in_base=True)
        back, q = _nearest(bench, middle, pitch)
        approach = _approach(bench, middle, pitch, back)
        bench.move_to(bench.joints_of(approach), f"grasp {self.name}: before it")
        _follow(bench, [ToolLine(bench.at, _before(middle, pitch, back))], f"grasp {self.name}")
        if float(np.abs(bench.q - q).max()) > JOINED:
            raise InputError("the straight way there ends in another posture.")
        closed = bench.rig.arm.gripper.lower
        held = _after(bench, cmd.SetGripper(closed))
        if held.grip is None:
            said = ", ".join(finding.reason.value for finding in held.findings)
            raise InputError(f"the fingers do not hold it ({said or 'they pass it'}).")
        bench.note(f"grasp {self.name}: close", Grip(closed), held)
        bench.taken = bench.at


@dataclass(frozen=True)
class Pour:
    """Carry the cup over a thing, turn it over by the wrist, shake it, and turn it back."""

    into: str
    shake: int

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        if value.kind == "text":
            return cls(read.text(value), 3)
        fields = Fields(value, "a pour")
        found = cls(fields.need("into", read.text, ""), fields.take("shake", read.whole(0, 20), 3))
        fields.done()
        return found

    def lay(self, bench: Bench) -> None:
        cup, basin = _thing(bench, CUP), _thing(bench, self.into)
        if not cup.held:
            raise InputError("The cup is not in the hand: `grasp: cup` first.")
        level = bench.at
        refused: InputError | None = None
        for turn in (POUR_TURN, -POUR_TURN):
            before = bench.state, list(bench.orders)
            try:
                self._pour(bench, basin, level, turn)
            except InputError as error:
                bench.state, bench.orders = before
                refused = refused or error
                continue
            return
        assert refused is not None
        raise InputError(f"The cup cannot be emptied into {self.into}: {refused}") from refused

    def _pour(self, bench: Bench, basin: Thing, level: ToolTarget, turn: float) -> None:
        chain = bench.chain
        # To the nearest that the wrist can turn.
        room = 0.995 * (chain.upper[4] if turn > 0.0 else -chain.lower[4])
        turn = math.copysign(min(abs(turn), room - abs(level.roll)), turn)
        over = bench.point(basin.T[:3, 3] + (0.0, 0.0, basin.height + ABOVE_RIM), in_base=True)
        wanted = over
        for _ in range(3):
            # So that the lip is over the middle while the cup lies on its side.
            at = replace(level, position=wanted)
            side = bench.joints_of(replace(at, roll=level.roll + 0.5 * turn))
            wanted = wanted + (over - self._lip(bench, side)) * (1.0, 1.0, 0.0)
        at = replace(level, position=wanted)
        _carry(bench, at, f"over {self.into}")
        bench.note("slowly", Pace(POUR_PACE), bench.state)
        down = replace(at, roll=level.roll + turn)
        _follow(bench, [ToolLine(at, down)], POURING)
        back = replace(at, roll=level.roll + turn - math.copysign(SHAKE, turn))
        if self.shake:
            _follow(bench, [ToolLine(down, back), ToolLine(back, down)] * self.shake, "shake")
        bench.note("drain", Wait(DRAINED), bench.state)
        bench.note("as fast as may be", Pace(1.0), bench.state)
        _follow(bench, [ToolLine(down, at)], "turn back")

    @staticmethod
    def _lip(bench: Bench, q: FloatArray) -> FloatArray:
        """(3,) in {S}: the lowest point of the cup's rim with the joints at ``q`` (5,)."""
        session, cup = bench.rig.session, _thing(bench, CUP)
        T = session.surroundings.pose(cup, np.append(q, bench.state.gripper_setpoint))
        up = T[:3, 2]
        downhill = -(np.array((0.0, 0.0, 1.0)) - up[2] * up)
        downhill /= np.linalg.norm(downhill)
        rim = T[:3, 3] + cup.height * up + cup.size[0] * downhill
        return bench.point(rim, in_base=True)


@dataclass(frozen=True)
class SetDown:
    """Put what the hand holds back where it was taken, and draw back."""

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        if value.kind != "nothing":
            raise value.wrong("`set_down` says all there is to say; nothing stands behind it.")
        return cls()

    def lay(self, bench: Bench) -> None:
        taken = bench.taken
        if bench.state.grip is None or taken is None:
            raise InputError("The hand holds nothing that it took in this program.")
        above = replace(taken, position=taken.position * (1, 1, 0) + bench.at.position * (0, 0, 1))
        _carry(bench, above, "back")
        low = replace(taken, position=taken.position + SET_DOWN * _UP)
        _follow(bench, [ToolLine(above, low)], "set down")
        opened = bench.rig.arm.gripper.upper
        bench.note("let go", Grip(opened), _after(bench, cmd.SetGripper(opened)))
        refused: InputError | None = None
        for away in APPROACHES:
            x, y, _ = taken.position
            out = np.array((x, y, 0.0)) / math.hypot(x, y)
            back = away * (math.cos(taken.pitch) * out - math.sin(taken.pitch) * _UP)
            try:
                end = replace(low, position=low.position - back)
                _follow(bench, [ToolLine(low, end)], "draw back")
            except InputError as error:
                refused = error
                continue
            return
        assert refused is not None
        raise InputError(f"There is no room to draw back: {refused}") from refused


_UP = np.array((0.0, 0.0, 1.0))


def _thing(bench: Bench, name: str) -> Thing:
    found = next((each for each in bench.state.things if each.name == name), None)
    if found is None:
        known = ", ".join(each.name for each in bench.state.things) or "nothing"
        raise InputError(f"There is no {name!r} here; there is {known}.")
    return found


def _overlap(one: Thing, other: Thing) -> bool:
    """Whether two things on the table are in each other, taken for round."""
    apart = float(np.linalg.norm(one.T[:2, 3] - other.T[:2, 3]))
    return apart < girth(one) + girth(other)


def _tool(bench: Bench, name: str) -> None:
    if bench.state.tool != name:
        bench.rig.arm.chain_to(name)
        bench.note(f"tool {name}", Use(name), replace(bench.state, tool=name))


def _before(middle: FloatArray, pitch: float, back: float) -> ToolTarget:
    """The tool ``back`` [m] before ``middle`` (3,), coming along its own axis."""
    out = np.array((middle[0], middle[1], 0.0)) / math.hypot(middle[0], middle[1])
    along = math.cos(pitch) * out - math.sin(pitch) * _UP
    return ToolTarget(middle - back * along, pitch, 0.0)


def _nearest(bench: Bench, middle: FloatArray, pitch: float) -> tuple[float, FloatArray]:
    """The least way before ``middle`` with ROOM for the palm, and the joints there."""
    world = bench.world
    said = "it is out of reach."
    for back in np.arange(SHORTEST, LONGEST_BACK + STEP, STEP).tolist():
        try:
            q = bench.joints_of(_before(middle, pitch, back))
        except InputError as error:
            said = str(error)
            continue
        x = np.append(q, bench.state.gripper_setpoint)
        met = None if world is None else world.nearest(x)
        if met is None or met.distance >= ROOM:
            return back, q
        one, other = met.parts
        said = f"{one} and {other} would be {1e3 * met.distance:.1f} mm apart."
    raise InputError(said)


def _approach(bench: Bench, middle: FloatArray, pitch: float, back: float) -> ToolTarget:
    """From where the open fingers come."""
    refused: InputError | None = None
    for away in APPROACHES:
        target = _before(middle, pitch, back + away)
        try:
            bench.joints_of(target)
        except InputError as error:
            refused = refused or error
            continue
        return target
    assert refused is not None
    raise refused


def _carry(bench: Bench, to: ToolTarget, name: str) -> None:
    """To ``to`` with pitch and roll as they are: up or down, round axis 1, out or in."""
    at = bench.at
    here = math.atan2(at.position[1], at.position[0])
    there = math.atan2(to.position[1], to.position[0])
    radius = math.hypot(at.position[0], at.position[1])
    z = float(to.position[2])
    raised = replace(at, position=at.position * (1, 1, 0) + _UP * max(z, at.position[2]))
    turned = ToolArc(
        raised.position,
        np.zeros(3),
        _UP,
        there - here,
        Linear(at.pitch, at.pitch),
        Linear(at.roll, at.roll),
    )
    over = replace(
        raised,
        position=np.array((radius * math.cos(there), radius * math.sin(there), raised.position[2])),
    )
    curves: list[Curve] = []
    if (raised.position != at.position).any():
        curves.append(ToolLine(at, raised))
    if abs(there - here) > JOINED:
        curves.append(turned)
    if float(np.abs(over.position - to.position).max()) > JOINED:
        curves.append(ToolLine(over, to))
    if curves:
        _follow(bench, curves, name)


def _follow(bench: Bench, curves: list[Curve] | list[ToolLine], name: str) -> None:
    """Along ``curves`` one after another, gently when something is held."""
    paths: list[Path] = []
    q = bench.q
    for curve in curves:
        paths.append(ToolPath(bench.chain, curve, branch_of(bench.chain, q), q))
        q = paths[-1].end
    gentle = None if bench.state.grip is None else CARRY
    plan = plan_along(bench.rig.arm, bench.world, bench.state, paths, tool_acceleration=gentle)
    bench.note(name, Go(plan), bench.standing(plan.end))


def _after(bench: Bench, command: cmd.Command, ticks: int = CLOSING) -> State:
    """The arm at rest after ``command``, as it will be: by the rules themselves."""
    session, state = bench.rig.session, bench.state
    given: tuple[cmd.Command, ...] = (command,)
    for _ in range(ticks):
        state = session.step(state, given, state.t + TICK)
        state = session.observe(state, state.setpoint, state.gripper_setpoint)
        given = ()
        if not state.moving:
            break
    return replace(state, findings=state.findings)
