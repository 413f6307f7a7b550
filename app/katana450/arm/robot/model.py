"""The robot as its URDF tells it. The numbers of the robot live in that file and nowhere else."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from katana450.arm.control.arm import Arm
from katana450.arm.robot.conduit import Hinge, Stretch, read_stretches
from katana450.arm.robot.description import reading
from katana450.arm.robot.gripper import SLIDING, Fingers, fingers_of
from katana450.arm.robot.structure import structure_of
from katana450.arm.robot.visual import Visual, rods, visuals_of
from katana450.errors import InputError, RobotDescriptionError
from katana450.maths.geometry import screws, se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.ideal import idealised
from katana450.maths.kinematics.turns import in_limits_turn
from katana450.resources import URDF_PATH

if TYPE_CHECKING:
    import yourdfpy

SHOULDER_FRAME = "shoulder_frame"
"""The link that is the paper's frame {S}."""

CONDUITS = "conduits.json"
"""File beside the URDF that says where its conduit is held."""

READY_ROOM = 0.05
"""Share of a joint's range that the ready posture keeps from its limits."""


@dataclass(frozen=True, eq=False)
class Body:
    """One link, as the view needs it.

    Attributes:
        name, parent: of the link and the link it hangs on; the root has none.
        T_parent_body: (4, 4) where it sits at zero [m].
        joint: the driven joint it hangs on, or None when it is fixed or at rest.
        axis: (3,) unit direction of that joint in the body's own frame.
        visuals: its shapes.
        collisions: the shapes that stand for it where contacts are looked for.
        moves: whether it hangs, directly or not, on a movable joint.
        mass: [kg], 0 where the file tells none. centre: (3,) of it, in the body's own frame [m].
        slides: whether its joint slides along the axis instead of turning about it.
    """

    name: str
    parent: str | None
    T_parent_body: FloatArray
    joint: str | None
    axis: FloatArray
    visuals: tuple[Visual, ...]
    collisions: tuple[Visual, ...]
    moves: bool
    mass: float
    centre: FloatArray
    slides: bool = False

    def motion(self, value: float) -> FloatArray:
        """The pose (4, 4) that its joint adds at ``value`` [rad, or m where it slides]."""
        return _motion(self.axis, value, slides=self.slides)


@dataclass(frozen=True, eq=False)
class RobotModel:
    """What the URDF says.

    Attributes:
        arm: chain in {S}, tools, gripper.
        T_base_shoulder: (4, 4) frame {S} in the root link, which stands on the table.
        bodies: every link, parents first.
        stretches: the free runs of the conduit, if it has one.
        fingers: finger joints, the driven one first: value = factor * driven + offset [rad or m].
        notes: sentences for a person on what was taken for granted in the file.
    """

    name: str
    arm: Arm
    T_base_shoulder: FloatArray
    bodies: tuple[Body, ...]
    fingers: Mapping[str, tuple[float, float]]
    stretches: tuple[Stretch, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def collides(self) -> bool:
        """Whether any link has a shape to look for contacts with."""
        return any(body.collisions for body in self.bodies)

    def ready(self, posture: Sequence[float]) -> FloatArray:
        """The joint angles (5,) [rad] nearest inside the limits to a posture of the canonical arm.

        ``posture``: (5,) [rad]; for the Katana these are its joint angles.
        """
        chain = self.arm.chain
        q = in_limits_turn(chain, arm_of(chain).joints(posture))
        room = READY_ROOM * (chain.upper - chain.lower)
        return np.clip(q, chain.lower + room, chain.upper - room)

    def joint_angles(self, q: FloatArray, gripper: float) -> dict[str, float]:
        """Every driven joint's value [rad or m] for arm joints (n,) and the driven finger joint."""
        angles = dict(zip(self.arm.chain.names, (float(angle) for angle in q), strict=True))
        for joint, (factor, offset) in self.fingers.items():
            angles[joint] = factor * gripper + offset
        return angles


def load(path: Path = URDF_PATH, tool: str | None = None) -> RobotModel:
    """Read a URDF file.

    Args:
        path: of the file; the arm in it is any member of the family in maths/kinematics/arm.py.
        tool: link that targets are set for by default; else the first of TOOL_FRAMES there is,
            else the last link that hangs on five turning joints.

    Raises:
        RobotDescriptionError: the file cannot be read, or lacks what an arm needs; says what.
    """
    with reading(path):
        return _read(path, tool)


def _read(path: Path, tool: str | None) -> RobotModel:
    import yourdfpy

    urdf = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=True)
    frames = {link: np.asarray(urdf.get_transform(link)) for link in urdf.link_map}
    structure = structure_of(urdf, path, tool)
    joints = structure.axes
    T_base_shoulder = _shoulder_frame(frames, joints)
    T_shoulder_base = se3.inverse(T_base_shoulder)
    described = Chain(
        M=T_shoulder_base @ frames[structure.tools[0]],
        S=np.column_stack([_screw(j, T_shoulder_base @ frames[j.child]) for j in joints]),
        lower=np.array([_limit(joint, "lower") for joint in joints]),
        upper=np.array([_limit(joint, "upper") for joint in joints]),
        speed=np.array([_limit(joint, "velocity") for joint in joints]),
        names=tuple(joint.name for joint in joints),
    )
    up = T_shoulder_base[:3, 2]
    chain, notes = idealised(described, up)
    tools = {
        link: idealised(described.with_tool(T_shoulder_base @ frames[link]), up)[0].M
        for link in structure.tools
    }
    fingers = fingers_of(structure.hand, structure.others, frames)
    notes = [*notes, *fingers.notes]
    if structure.chosen and fingers.driven:
        notes.append(_taken_for_gripper(fingers, structure.tools[0]))
    bodies, missing = _bodies(urdf, path, frames, chain, fingers)
    return RobotModel(
        name=urdf.robot.name,
        arm=Arm(chain, tools, structure.tools[0], fingers.gripper),
        T_base_shoulder=frozen(T_base_shoulder),
        bodies=bodies,
        fingers=fingers.follow,
        stretches=read_stretches(
            path.parent / CONDUITS, lambda start, end: _hinge(bodies, chain, start, end)
        ),
        notes=(*notes, *(f"There is no mesh at {mesh}." for mesh in dict.fromkeys(missing))),
    )


def _taken_for_gripper(fingers: Fingers, tool: str) -> str:
    names = ", ".join(map(repr, fingers.driven))
    if len(fingers.driven) == 1:
        return f"Joint {names} is taken for that of a gripper; {tool!r} is the tool."
    return (
        f"Joints {names} are taken for those of a gripper and driven together; "
        f"{tool!r} is the tool."
    )


def _shoulder_frame(frames: Mapping[str, FloatArray], joints: Sequence[Any]) -> FloatArray:
    """{S}: the link of that name, else parallel to the root where axis 1 passes axis 2."""
    if SHOULDER_FRAME in frames:
        return frames[SHOULDER_FRAME]
    one, two = (_screw(joint, frames[joint.child]) for joint in joints[:2])
    p1, p2 = screws.point_on(one), screws.point_on(two)
    # The foot on axis 1 of the common normal of the two lines.
    normal = np.cross(one[:3], two[:3])
    size = float(normal @ normal)
    along = float(np.cross(p2 - p1, two[:3]) @ normal) / size if size > 0.0 else 0.0
    return se3.from_rotation_translation(np.eye(3), p1 + along * one[:3])


def _screw(joint: Any, T_shoulder_child: FloatArray) -> FloatArray:
    """The joint's screw axis (6,) in {S}; a URDF joint turns about an axis of its child's frame."""
    direction = T_shoulder_child[:3, :3] @ joint.axis
    try:
        return screws.revolute(direction, T_shoulder_child[:3, 3])
    except InputError as error:
        raise RobotDescriptionError(
            f"Joint {joint.name!r} is not described rightly. {error}"
        ) from error


def _limit(joint: Any, which: str) -> float:
    if joint.type == "continuous" and which in ("lower", "upper"):
        return math.pi if which == "upper" else -math.pi
    value = None if joint.limit is None else getattr(joint.limit, which)
    if value is None:
        raise RobotDescriptionError(f"Joint {joint.name!r} has no {which} limit.")
    return float(value)


def _motion(axis: FloatArray, value: float, *, slides: bool) -> FloatArray:
    if slides:
        return se3.from_rotation_translation(np.eye(3), value * axis)
    return se3.from_rotation_translation(so3.exp(value * axis), np.zeros(3))


def _hinge(bodies: Sequence[Body], chain: Chain, start: str, end: str) -> Hinge:
    """The one joint between two links; KeyError when there is not one."""
    by_name = {body.name: body for body in bodies}
    way: list[Body] = []
    name: str | None = end
    while name != start:
        if name is None:
            raise KeyError(f"{end} does not hang on {start}")
        way.insert(0, by_name[name])
        name = way[0].parent
    driven = [i for i, body in enumerate(way) if body.joint in chain.names]
    if len(driven) != 1:
        raise KeyError(f"there are {len(driven)} driven joints between {start} and {end}, not one")
    at = driven[0]
    before, after = (
        functools.reduce(np.matmul, (body.T_parent_body for body in some), np.eye(4))
        for some in (way[: at + 1], way[at + 1 :])
    )
    joint, axis = way[at].joint or "", way[at].axis
    number = chain.names.index(joint)
    lower, upper = float(chain.lower[number]), float(chain.upper[number])
    return Hinge(joint, axis, lower, upper, before, after)


def _weight(inertial: Any) -> tuple[float, FloatArray]:
    """Mass [kg] of a link and its centre (3,) [m], as its file tells them."""
    if inertial is None or inertial.mass is None:
        return 0.0, frozen(np.zeros(3))
    origin = np.eye(4) if inertial.origin is None else np.asarray(inertial.origin)
    return max(float(inertial.mass), 0.0), frozen(origin[:3, 3])


def _bodies(
    urdf: yourdfpy.URDF,
    path: Path,
    frames: Mapping[str, FloatArray],
    chain: Chain,
    fingers: Fingers,
) -> tuple[tuple[Body, ...], list[Path]]:
    """Every link, parents first, and the meshes that were not found."""
    by_child = {joint.child: joint for joint in urdf.joint_map.values()}
    bodies: dict[str, Body] = {}
    missing: list[Path] = []

    def add(link: str) -> None:
        if link in bodies:
            return
        joint = by_child.get(link)
        if joint is None:
            parent, T, name, axis = None, np.eye(4), None, np.array([0.0, 0.0, 1.0])
            slides = False
        else:
            parent = joint.parent
            add(parent)
            T = se3.inverse(frames[parent]) @ frames[link]
            driven = joint.name in chain.names or joint.name in fingers.follow
            name = joint.name if driven else None
            slides = joint.type == SLIDING
            axis = np.asarray(joint.axis, dtype=float)
            axis = axis / (float(np.linalg.norm(axis)) or 1.0)
            if rest := fingers.resting.get(joint.name, 0.0):
                T = T @ _motion(axis, rest, slides=slides)
        shapes = urdf.link_map[link]
        visuals, absent = visuals_of(shapes.visuals, urdf.robot.materials, path.parent)
        missing.extend(absent)
        collisions, absent = visuals_of(shapes.collisions, (), path.parent)
        missing.extend(absent)
        if not visuals:
            ends = [j.origin for j in urdf.joint_map.values() if j.parent == link]
            visuals = rods([origin[:3, 3] for origin in ends if origin is not None])
        moves = name is not None or (parent is not None and bodies[parent].moves)
        mass, centre = _weight(shapes.inertial)
        bodies[link] = Body(
            link,
            parent,
            frozen(T),
            name,
            frozen(axis),
            visuals,
            collisions,
            moves,
            mass,
            centre,
            slides,
        )

    for link in urdf.link_map:
        add(link)
    return tuple(bodies.values()), missing
