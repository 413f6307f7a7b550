"""The steps a script can have. Each reads its value and lays itself out on a bench.

To add one: a class with `read` and `lay`, and its name in STEPS.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np

from app.control.commands import LEAST_SPEED
from app.errors import InputError
from app.geometry.arrays import FloatArray
from app.kinematics.branch import BRANCHES, Branch
from app.kinematics.tool import ToolTarget
from app.planning.curve import Linear, ToolArc, ToolLine, ToolScrew
from app.planning.joint_path import JointPath
from app.planning.pitch import roomiest
from app.planning.tool_path import ToolPath
from app.programs import fields as read
from app.programs.bench import Bench, Place
from app.programs.fields import Fields
from app.programs.handling import Fill, Grasp, Pour, Put, SetDown
from app.programs.order import Grip, Pace, Use, Wait
from app.programs.setting import Setting
from app.programs.source import Value

LONGEST_WAIT = 3600.0
"""[s]"""

MOST_TIMES = 1000

ROOMIEST = "roomiest"
"""The pitch that leaves the joints the most room along an arc."""


class Step(Protocol):
    """One of them."""

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:
        """From what stands behind its name. Raises ScriptError."""
        ...

    def lay(self, bench: Bench) -> None:
        """Note what is to be done, with its plans. Raises InputError where that cannot be."""
        ...


def place(value: Value, setting: Setting) -> Place:
    """The name of a pose, {joints: [...]}, or {x, y, z, pitch, roll, branch}."""
    if value.kind == "text":
        if value.held not in setting.poses:
            known = ", ".join(setting.poses) or "none; give it under `poses:`"
            raise value.wrong(f"There is no pose {value}; there are {known}.")
        return setting.poses[str(value.held)]
    fields = Fields(value, "a place")
    if fields.has("joints"):
        joints = fields.take("joints", _joints, None)
        fields.done()
        return Place(joints=joints)
    position = np.array([fields.need(name, read.millimetres(), 0.0) for name in read.XYZ])
    found = Place(None, position, *_angles(fields), _branch(fields), setting.in_base)
    fields.done()
    return found


@dataclass(frozen=True)
class Move:
    """Go there freely, round what is in the way."""

    place: Place

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:
        return cls(place(value, setting))

    def lay(self, bench: Bench) -> None:
        bench.move_to(bench.joints_at(self.place), "move")


@dataclass(frozen=True)
class Joints:
    """The same to joint angles."""

    q: FloatArray

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        return cls(_joints(value))

    def lay(self, bench: Bench) -> None:
        bench.move_to(bench.joints_at(Place(joints=self.q)), "joints")


@dataclass(frozen=True)
class Home:
    """The same to the ready posture."""

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        if value.kind != "nothing":
            raise value.wrong("`home` says all there is to say; nothing stands behind it.")
        return cls()

    def lay(self, bench: Bench) -> None:
        bench.move_to(bench.rig.ready, "home")


@dataclass(frozen=True)
class Via:
    """Through places one after another without a rest, their corners rounded."""

    through: tuple[Place, ...]
    blend: float

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:
        fields = Fields(value, "a via")
        each = read.listed(lambda item: place(item, setting), 2, 50)
        through = fields.need("through", each, ())
        blend = fields.take("blend", read.number(0.01, 1.0), 0.5)
        fields.done()
        return cls(through, blend)

    def lay(self, bench: Bench) -> None:
        vias = [bench.q]
        at = bench.state
        for each in self.through:
            vias.append(bench.joints_at(each))
            bench.state = bench.standing(vias[-1])
        bench.state = at
        blend = np.full(len(vias) - 2, self.blend)
        bench.follow([JointPath(bench.chain, np.array(vias), blend)], "via")


@dataclass(frozen=True)
class Line:
    """The tool on a straight line, pitch and roll turning evenly."""

    to: FloatArray | None
    by: FloatArray | None
    pitch: float | None
    roll: float | None
    in_base: bool

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:
        fields = Fields(value, "a line")
        to = fields.take("to", read.vector(read.millimetres()), None)
        by = fields.take("by", read.vector(read.millimetres(), partly=True), None)
        if to is not None and by is not None:
            fields.problems += value.wrong("A line goes `to` a point or `by` a way.").problems
        found = cls(to, by, *_angles(fields), setting.in_base)
        fields.done()
        return found

    def lay(self, bench: Bench) -> None:
        start = bench.at
        end = bench.target_at(Place(None, self.to, self.pitch, self.roll, None, self.in_base))
        if self.by is not None:
            way = bench.direction(self.by, in_base=self.in_base)
            end = ToolTarget(start.position + way, end.pitch, end.roll)
        path = ToolPath(bench.chain, ToolLine(start, end), bench.branches(None)[0], bench.q)
        bench.follow([path], "line")


@dataclass(frozen=True)
class Arc:
    """The tool round an axis from where it is, climbing along it or not."""

    centre: FloatArray
    axis: FloatArray
    angle: float
    climb: float
    pitch: float | str | None
    roll: float | None
    in_base: bool

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:
        fields = Fields(value, "an arc")
        found = cls(
            fields.need("centre", read.vector(read.millimetres()), np.zeros(3)),
            fields.need("axis", read.direction, np.eye(3)[0]),
            fields.need("angle", read.degrees(), 1.0),
            fields.take("climb", read.millimetres(), 0.0),
            fields.take("pitch", _pitch, None),
            fields.take("roll", read.degrees(), None),
            setting.in_base,
        )
        fields.done()
        return found

    def lay(self, bench: Bench) -> None:
        start = bench.at
        begin, end = start.pitch, self.pitch
        profile = Linear(begin, end if isinstance(end, float) else begin)
        roll = Linear(start.roll, start.roll if self.roll is None else self.roll)
        centre = bench.point(self.centre, in_base=self.in_base)
        axis = bench.direction(self.axis, in_base=self.in_base)
        arc = ToolArc(start.position, centre, axis, self.angle, profile, roll, self.climb)
        _follow_arc(bench, arc, "arc", self.pitch, None)


@dataclass(frozen=True)
class Circle:
    """The tool round a circle, from its highest point; it is gone to first."""

    centre: FloatArray
    normal: FloatArray
    radius: float
    turns: float
    pitch: float | str | None
    roll: float | None
    branch: Branch | None
    in_base: bool

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:
        fields = Fields(value, "a circle")
        found = cls(
            fields.need("centre", read.vector(read.millimetres()), np.zeros(3)),
            fields.need("normal", read.direction, np.eye(3)[0]),
            fields.need("radius", read.millimetres(0.1, 1000.0), 0.1),
            fields.take("turns", read.number(-20.0, 20.0), 1.0),
            fields.take("pitch", _pitch, None),
            fields.take("roll", read.degrees(), None),
            _branch(fields),
            setting.in_base,
        )
        if found.turns == 0.0:
            fields.problems += value.wrong("A circle of no turns is no way.").problems
        fields.done()
        return found

    def lay(self, bench: Bench) -> None:
        now = bench.at
        centre = bench.point(self.centre, in_base=self.in_base)
        normal = bench.direction(self.normal, in_base=self.in_base)
        up = bench.direction(np.array((0.0, 0.0, 1.0)), in_base=True)
        out = up - (up @ normal) * normal
        if math.hypot(*out) < LEVEL:
            # A level circle has no highest point: from the one farthest in front.
            ahead = bench.direction(np.array((1.0, 0.0, 0.0)), in_base=True)
            out = ahead - (ahead @ normal) * normal
        start = centre + self.radius / math.hypot(*out) * out
        held = self.pitch if isinstance(self.pitch, float) else now.pitch
        roll = now.roll if self.roll is None else self.roll
        profiles = Linear(held, held), Linear(roll, roll)
        arc = ToolArc(start, centre, normal, math.tau * self.turns, *profiles)
        _follow_arc(bench, arc, "circle", self.pitch, self.branch)


@dataclass(frozen=True)
class Screw:
    """The tool moved as one body round an axis and along it, as five axes can."""

    point: FloatArray
    axis: FloatArray
    angle: float
    climb: float
    in_base: bool

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:
        fields = Fields(value, "a screw")
        found = cls(
            fields.need("point", read.vector(read.millimetres()), np.zeros(3)),
            fields.need("axis", read.direction, np.eye(3)[0]),
            fields.take("angle", read.degrees(), 0.0),
            fields.take("climb", read.millimetres(), 0.0),
            setting.in_base,
        )
        if found.angle == 0.0 and found.climb == 0.0:
            fields.problems += value.wrong("A screw has an `angle`, a `climb` or both.").problems
        fields.done()
        return found

    def lay(self, bench: Bench) -> None:
        axis = bench.direction(self.axis, in_base=self.in_base)
        omega = self.angle * axis
        v = np.cross(bench.point(self.point, in_base=self.in_base), omega) + self.climb * axis
        branch = bench.branches(None)[0]
        curve = ToolScrew(bench.chain, branch, bench.q, np.append(omega, v))
        bench.follow([ToolPath(bench.chain, curve, branch, bench.q)], "screw")


@dataclass(frozen=True)
class Gripper:
    """Open or close the fingers, or bring them to an angle [rad]."""

    where: float | str

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        if value.number is not None:
            return cls(read.degrees(-180.0, 180.0)(value))
        return cls(read.choice("open", "closed")(value))

    def lay(self, bench: Bench) -> None:
        fingers = bench.rig.arm.gripper
        if not fingers.moves:
            raise InputError("This arm has no fingers.")
        ends = {"open": fingers.upper, "closed": fingers.lower}
        angle = ends[self.where] if isinstance(self.where, str) else self.where
        if not fingers.lower <= angle <= fingers.upper:
            low, high = np.degrees((fingers.lower, fingers.upper))
            raise InputError(f"The fingers go from {low:.1f} to {high:.1f} deg.")
        held = replace(bench.state, gripper=angle, gripper_setpoint=angle, gripper_goal=angle)
        bench.note("gripper", Grip(angle), held)


@dataclass(frozen=True)
class Pause:
    """Wait for a time [s]."""

    seconds: float

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        return cls(read.number(0.01, LONGEST_WAIT, "s")(value))

    def lay(self, bench: Bench) -> None:
        bench.note("wait", Wait(self.seconds), bench.state)


@dataclass(frozen=True)
class Tool:
    """From now on points are of this tool frame."""

    name: str

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        return cls(read.text(value))

    def lay(self, bench: Bench) -> None:
        bench.rig.arm.chain_to(self.name)
        bench.note(f"tool {self.name}", Use(self.name), replace(bench.state, tool=self.name))


@dataclass(frozen=True)
class Speed:
    """From now on no faster than this share of the most."""

    value: float

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        return cls(read.number(LEAST_SPEED, 1.0)(value))

    def lay(self, bench: Bench) -> None:
        bench.note(f"speed {self.value:g}", Pace(self.value), bench.state)


STEPS: dict[str, type[Step]] = {
    "move": Move,
    "joints": Joints,
    "home": Home,
    "via": Via,
    "line": Line,
    "arc": Arc,
    "circle": Circle,
    "screw": Screw,
    "gripper": Gripper,
    "wait": Pause,
    "tool": Tool,
    "speed": Speed,
    "fill": Fill,
    "put": Put,
    "grasp": Grasp,
    "pour": Pour,
    "set_down": SetDown,
}

LEVEL = 1e-6
"""[1] A normal nearer to the vertical has a level circle."""


def _follow_arc(
    bench: Bench, arc: ToolArc, name: str, pitch: float | str | None, branch: Branch | None
) -> None:
    """Go to where ``arc`` begins, if the arm is not there, and along it."""
    refused: InputError | None = None
    for tried in bench.branches(branch):
        try:
            curve = roomiest(bench.chain, tried, arc) if pitch == ROOMIEST else arc
            path = ToolPath(bench.chain, curve, tried, bench.q)
        except InputError as error:
            # Of the branch that a person expects.
            refused = refused or error
            continue
        bench.move_to(path.start, f"{name}: to its start")
        bench.follow([path], name)
        return
    assert refused is not None
    raise refused


def _joints(value: Value) -> FloatArray:
    return np.array(read.listed(read.degrees(-720.0, 720.0), 5, 5)(value))


def _pitch(value: Value) -> float | str | None:
    """[rad], ROOMIEST, or None to keep it."""
    if value.number is not None:
        return read.degrees(-360.0, 360.0)(value)
    named = read.choice("keep", ROOMIEST)(value)
    return None if named == "keep" else named


def _angles(fields: Fields) -> tuple[float | None, float | None]:
    each: Callable[[Value], float | None] = read.degrees(-360.0, 360.0)
    return fields.take("pitch", each, None), fields.take("roll", each, None)


def _branch(fields: Fields) -> Branch | None:
    names = [str(branch) for branch in BRANCHES]
    named = fields.take("branch", read.choice(*names), "")
    return Branch.parse(named) if named else None
