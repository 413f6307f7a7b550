"""The VRML world of a running arm by DEF names: the values that can be read and set.

Setting a joint's rotation, or the pose of the tool, makes it the target of a motion; it never sets
the position itself.
Settings of objects become commands as well. The names are those of the exported files.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects.environment import Environment
from katana450.arm.control.objects.loose_objects import check_carried, is_loose
from katana450.arm.control.objects.scene_changes import with_moved_object
from katana450.arm.control.state.scene_objects import SceneObject
from katana450.arm.control.state.state import State
from katana450.arm.robot.link import Joint
from katana450.arm.robot.robot import Robot
from katana450.errors import InputError
from katana450.extensions.export.vrml.vrml_names import VrmlNames
from katana450.extensions.export.vrml.vrml_world import axis_angle
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.api import answers, requests
from katana450.server.service.arm_handle import Nodes


class Type(Enum):
    """The VRML type of a field."""

    VECTOR = "SFVec3f"
    ROTATION = "SFRotation"


WIDTHS = {Type.VECTOR: 3, Type.ROTATION: 4}
"""Count of numbers in a value of each type that can be set."""

Put = Callable[["FieldOrders", list[float]], None]
"""A function that sets a field."""


class FieldOrders:
    """The orders of one message, collected until all of it is parsed.

    Attributes:
        state: the present state.
        axes: targets of axes [rad, m], by their numbers.
        position: (3,) [m] target of the tool in the root's frame; None without one.
        R: (3, 3) target of the tool in the root's frame; None without one.
        others: further commands.
    """

    def __init__(self, state: State) -> None:
        """Begin without orders."""
        self.state = state
        self.axes: dict[int, float] = {}
        self.position: FloatArray | None = None
        self.R: FloatArray | None = None
        self.others: list[cmd.Command] = []


@dataclass(frozen=True, eq=False)
class NamedField:
    """A field of a node.

    Attributes:
        type: its type.
        read: function that returns its value.
        put: function that sets it; None if it can only be read.
        why: reason why it can only be read, with what to do; empty if there is nothing to say.
    """

    type: Type
    read: Callable[[State], list[float]]
    put: Put | None = None
    why: str = ""


@dataclass(frozen=True, eq=False)
class NamedNode:
    """A node: its kind, the object that it belongs to, and its fields."""

    kind: str
    of: str
    fields: Mapping[str, NamedField]


AXIS_TOLERANCE = 1e-6
"""[rad] Maximum angle between the axis of a rotation and that of the joint."""


class VrmlNodes(Nodes):
    """All nodes with DEF names. It changes no state itself."""

    def __init__(self, robot: Robot, environment: Environment) -> None:
        """Build the nodes of ``robot``; those of objects follow from the state."""
        super().__init__(robot)
        arm = robot.arm
        axes = robot.driven if arm is None else arm.chain.names
        self._axes: Mapping[str, int] = {name: axis for axis, name in enumerate(axes)}
        self._fingers = () if arm is None else tuple(arm.fingers)
        # A finger that follows another can only be set through that one.
        self._gripper = next((f for f in self._fingers if robot.joints[f].leader == f), None)
        self._surroundings = environment
        self._names = VrmlNames(robot)
        # The newest state whose links were placed, and their poses.
        self._placed: tuple[State | None, Mapping[str, FloatArray]] = (None, {})
        self._fixed = self._of_the_robot()
        # The nodes for the present objects, with the names of these objects as the key.
        self._known: tuple[tuple[str, ...], Mapping[str, NamedNode]] = ((), self._fixed)

    def world(self, state: State) -> answers.World:
        """Return all nodes with their present values."""
        return answers.World(
            nodes=[
                answers.Node(
                    node=name,
                    kind=node.kind,
                    of=node.of,
                    fields=[
                        answers.Field(
                            field=field,
                            type=named_field.type.value,
                            value=named_field.read(state),
                            settable=named_field.put is not None,
                        )
                        for field, named_field in node.fields.items()
                    ],
                )
                for name, node in self._nodes(state).items()
            ]
        )

    def read(self, state: State, names: Iterable[requests.FieldName]) -> tuple[answers.Value, ...]:
        """Return the present values of the fields. Raises InputError for an unknown name."""
        return tuple(
            answers.Value(
                node=name.node,
                field=name.field,
                value=self._field(state, name.node, name.field).read(state),
            )
            for name in names
        )

    def command(self, state: State, settings: Iterable[requests.FieldSetting]) -> cmd.Command:
        """Return the command for all settings. Raises InputError with the reason of a refusal."""
        orders = FieldOrders(state)
        for setting in settings:
            name = f"{setting.node}.{setting.field}"
            field = self._field(state, setting.node, setting.field)
            if field.put is None:
                raise InputError(field.why or f"{name} can be read but not set.")
            field.put(orders, _fitting(name, field, setting.value))
        self._check_carried(orders)
        commands = (*self._motion(orders), *orders.others)
        return commands[0] if len(commands) == 1 else cmd.Batch(commands)

    def _motion(self, orders: FieldOrders) -> tuple[cmd.Command, ...]:
        """Return the command for the arm, if any. Raises InputError for two targets."""
        if orders.position is None and orders.R is None:
            return (cmd.SetAxes(tuple(orders.axes.items())),) if orders.axes else ()
        if orders.axes:
            raise InputError("One message sets either joints or the tool. Leave one of them out.")
        T = np.array(self._pose(orders.state, orders.state.tool))
        T[:3, 3] = T[:3, 3] if orders.position is None else orders.position
        T[:3, :3] = T[:3, :3] if orders.R is None else orders.R
        T = se3.inverse(self._robot.require_arm().T_base_shoulder) @ T
        return (cmd.Position(T[:3, 3]) if orders.R is None else cmd.Pose(T),)

    def _pose(self, state: State, link: str) -> FloatArray:
        """Return the pose (4, 4) of a link in the root's frame [m]."""
        if state is not self._placed[0]:
            self._placed = state, self._robot.frames(self._values(state))
        return self._placed[1][link]

    def _check_carried(self, orders: FieldOrders) -> None:
        """Raise InputError if an object has no support after all moves."""
        moves = [order for order in orders.others if isinstance(order, cmd.MoveObject)]
        objects = functools.reduce(with_moved_object, moves, orders.state).objects
        for name in {order.name for order in moves}:
            scene_object = next(candidate for candidate in objects if candidate.name == name)
            if is_loose(scene_object):
                check_carried(self._surroundings.table, objects, scene_object, may_fall=True)

    def _field(self, state: State, node: str, field: str) -> NamedField:
        named = self._nodes(state).get(node)
        if named is None:
            raise InputError(
                f"There is no node {node!r}. The request `query` of `world` lists all nodes."
            )
        if field not in named.fields:
            known = ", ".join(named.fields)
            raise InputError(f"{node!r} is a {named.kind} with {known}; it has no field {field!r}.")
        return named.fields[field]

    def _nodes(self, state: State) -> Mapping[str, NamedNode]:
        names = tuple(scene_object.name for scene_object in state.objects)
        if names != self._known[0]:
            nodes = dict(self._fixed)
            for name, node in self._names.objects(names).items():
                nodes[node] = self._object(name)
            self._known = (names, nodes)
        return self._known[1]

    def _of_the_robot(self) -> dict[str, NamedNode]:
        nodes: dict[str, NamedNode] = {}
        for link in self._robot.links:
            nodes[self._names.links[link.name]] = self._link(link.name)
            if link.joint is not None:
                nodes[self._names.joints[link.joint.name]] = self._joint(link.joint)
        return nodes

    def _joint(self, joint: Joint) -> NamedNode:
        axis = self._robot.axis(joint)
        name = joint.name

        def read(state: State) -> list[float]:
            value = self._values(state)[name]
            return [*(value * axis).tolist()] if joint.slides else [*axis.tolist(), value]

        def put(orders: FieldOrders, value: list[float]) -> None:
            amount = _along(name, axis, value) if joint.slides else _about(name, axis, value)
            if name in self._axes:
                orders.axes[self._axes[name] + 1] = amount
            else:
                orders.others.append(cmd.Gripper(amount))

        why = ""
        if joint.leader != name:
            why = f"{name} follows {joint.leader}. Set that joint."
        elif name not in self._axes and name != self._gripper:
            why = f"{name} cannot move: it is not a joint of the arm."
            if name in self._fingers:
                why = f"{name} is driven together with {self._gripper}. Set that joint."
        moved = "translation" if joint.slides else "rotation"
        kind = Type.VECTOR if joint.slides else Type.ROTATION
        field = NamedField(kind, read, None if why else put, why)
        return NamedNode("Transform", f"joint {name}", {moved: field})

    def _link(self, link: str) -> NamedNode:
        """Return the node of a link with its pose in the root's frame; a tool can be set."""
        arm = self._robot.arm
        other = f"{link} is not the tool frame of the arm and cannot be set. Set "

        def check_tool(orders: FieldOrders) -> None:
            if link != orders.state.tool:
                raise InputError(f"{other}{orders.state.tool}.")

        def move(orders: FieldOrders, value: list[float]) -> None:
            check_tool(orders)
            orders.position = np.array(value)

        def turn(orders: FieldOrders, value: list[float]) -> None:
            check_tool(orders)
            orders.R = _rotation(link, value)

        is_tool = arm is not None and link in arm.tools
        why = other + ("a joint." if arm is None else f"{' or '.join(arm.tools)}.")
        node = _placed(f"link {link}", lambda state: self._pose(state, link), move, turn)
        if is_tool:
            return node
        fields = {name: replace(field, put=None, why=why) for name, field in node.fields.items()}
        return replace(node, fields=fields)

    def _object(self, name: str) -> NamedNode:
        def pose(state: State) -> FloatArray:
            return self._surroundings.pose(_known_object(state, name), state.x)

        def move(orders: FieldOrders, value: list[float]) -> None:
            _check_out_of_the_hand(orders, name)
            orders.others.append(cmd.MoveObject(name, position=np.array(value)))

        def turn(orders: FieldOrders, value: list[float]) -> None:
            _check_out_of_the_hand(orders, name)
            orders.others.append(cmd.MoveObject(name, R=_rotation(name, value)))

        return _placed(f"object {name}", pose, move, turn)


def _placed(owner: str, pose: Callable[[State], FloatArray], move: Put, turn: Put) -> NamedNode:
    """Return the Transform of something at ``pose`` (4, 4), which can be moved and turned."""
    return NamedNode(
        "Transform",
        owner,
        {
            "translation": NamedField(
                Type.VECTOR, lambda state: [*pose(state)[:3, 3].tolist()], move
            ),
            "rotation": NamedField(
                Type.ROTATION, lambda state: axis_angle(pose(state)[:3, :3]), turn
            ),
        },
    )


def _fitting(name: str, field: NamedField, value: list[float]) -> list[float]:
    """Return ``value`` if it fits the type of the field. Raises InputError."""
    width = WIDTHS[field.type]
    if len(value) != width:
        raise InputError(f"{name} is a {field.type.value}, which is {width} numbers, not {value}.")
    if not all(map(math.isfinite, value)):
        raise InputError(f"{name} must be finite, not {value}.")
    return value


def _check_out_of_the_hand(orders: FieldOrders, name: str) -> None:
    """Raise InputError if the object is held."""
    if _known_object(orders.state, name).held:
        raise InputError(f"{name!r} is held. Open the gripper first.")


def _about(name: str, axis: FloatArray, rotation: list[float]) -> float:
    """Return the angle [rad] of ``rotation`` about ``axis``. Raises InputError for another axis."""
    angle = rotation[3]
    if angle == 0.0:
        return 0.0
    direction = _unit(rotation[:3])
    if direction is None or float(np.linalg.norm(np.cross(axis, direction))) > AXIS_TOLERANCE:
        about = _shown(np.array(rotation[:3]))
        raise InputError(f"{name} turns about {_shown(axis)} and cannot turn about {about}.")
    return angle if float(axis @ direction) > 0.0 else -angle


def _along(name: str, axis: FloatArray, translation: list[float]) -> float:
    """Return the distance [m] along ``axis``. Raises InputError for another direction."""
    vector = np.array(translation)
    amount = float(axis @ vector)
    if float(np.linalg.norm(vector - amount * axis)) > AXIS_TOLERANCE * max(abs(amount), 1.0):
        raise InputError(f"{name} slides along {_shown(axis)} and cannot move to {_shown(vector)}.")
    return amount


def _shown(vector: FloatArray) -> str:
    return " ".join(f"{number + 0.0:g}" for number in np.round(vector, 6))


def _rotation(name: str, numbers: list[float]) -> FloatArray:
    """Return the matrix (3, 3) of a VRML rotation: an axis and an angle [rad]."""
    if numbers[3] == 0.0:
        return np.eye(3)
    axis = _unit(numbers[:3])
    if axis is None:
        raise InputError(f"{name} cannot turn about an axis of length 0.")
    return so3.exp(math.remainder(numbers[3], math.tau) * axis)


def _unit(numbers: list[float]) -> FloatArray | None:
    """Return the direction of a vector; None for a zero vector."""
    largest = max(map(abs, numbers))
    if largest == 0.0:
        return None
    scaled = np.array([number / largest for number in numbers])
    return np.asarray(scaled / np.linalg.norm(scaled))


def _known_object(state: State, name: str) -> SceneObject:
    return next(scene_object for scene_object in state.objects if scene_object.name == name)
