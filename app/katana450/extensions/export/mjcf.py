"""A robot as MJCF, MuJoCo's own format, with its meshes in a zip.

The model has actuators, sites, keyframes and contact rules, which a URDF cannot state. Frames
without mass on fixed joints, such as the tool point, are sites. Joints that follow another are
coupled by an equality. The drives of the joints are chosen from the masses that the URDF states.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np

from katana450.arm.control.commands.commands import ReplaceScene
from katana450.arm.control.objects.loose_objects import Grasping, can_move
from katana450.arm.robot.collision import world_of
from katana450.arm.robot.link import Inertial, Joint, Link
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.structure import ARM_JOINTS
from katana450.arm.robot.surfaces import Material, VisualMesh, shapes_of
from katana450.arm.robot.visual import PrimitiveShape, Visual
from katana450.assembly.robot_session import arm_session
from katana450.errors import InputError
from katana450.extension import load
from katana450.extensions.bodies.pairs_at_rest import pairs_at_rest
from katana450.extensions.export.files import distinct, zipped
from katana450.extensions.export.obj_text import obj_text
from katana450.maths.collision.linkage import GROUND, Linkage
from katana450.maths.collision.world import CollisionWorld, Part
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.physics import model as physics
from katana450.maths.physics.suction import SEAL_GAP, SuctionCup
from katana450.maths.water.units import GRAVITY
from katana450.settings import Settings

SAG = 1e-3
"""[rad, m] Maximum displacement of a joint at rest by the weight that it carries."""

INERTIA_RATIO = 0.2
"""Inertia of a joint's drive, as a fraction of the largest inertia that it moves."""

DAMPING_RATIO = 0.05
"""Damping ratio of a joint whose URDF states no damping, with its drive as the spring."""

MAX_FREQUENCY = 400.0
"""[rad/s] Maximum natural frequency of a joint on its drive, so that simulations stay stable."""

MIN_LOAD = 0.01
"""[N m, N] Minimum weight for which a drive is made, for joints that carry no mass."""

FORCE_RATIO = 2.0
"""Maximum force of a drive without a credible effort in the file, as a ratio to its load."""

CREDIBLE_RATIO = 0.5
"""A smaller effort, as a ratio to the load of a joint, is not that of its motor."""


@dataclass(frozen=True, eq=False)
class Drive:
    """A position controller of a joint, and the losses of the joint.

    None of the numbers is of a real motor, except damping, friction and effort that the URDF
    states. The stiffness is as low as `SAG` allows.

    Attributes:
        stiffness: [N m/rad or N/m].
        armature: inertia of the drive, seen at the joint [kg m^2 or kg].
        damping: [N m s/rad or N s/m].
        friction: [N m or N].
        max_force: [N m or N].
    """

    stiffness: float
    armature: float
    damping: float
    friction: float
    max_force: float


class HandDrive(NamedTuple):
    """The hand as the app simulates it.

    Attributes:
        links: names of the links that hold: the fingers, and those of the palm.
        joints: names of the driven finger joints.
        stiffness, force: stiffness of the drive of each of them, and its greatest force
            [N m/rad or N/m, N m or N].
        fingers: number of finger joints, with those that follow.
        suction: force of a suction cup, which is all of ``links`` [N]; 0 for fingers.
    """

    links: frozenset[str]
    joints: tuple[str, ...]
    stiffness: float
    force: float
    fingers: int
    suction: float = 0.0


def grip_of(robot: Robot) -> HandDrive | None:
    """Return the hand of ``robot``; None without one that holds objects."""
    if robot.arm is None:
        return None
    environment = arm_session(Settings(), robot).session.environment
    grasping, world = Grasping.of(environment), environment.bodies
    if grasping is None or world is None:
        return None
    drive, variable = grasping.drive, world.linkage.variable
    if isinstance(drive, SuctionCup):
        cup = frozenset(part.name for part in world.parts if part.mover == drive.palm)
        return HandDrive(cup, (), 0.0, 0.0, 0, drive.force)
    links = frozenset(
        part.name
        for part in world.parts
        if part.mover == drive.palm or variable[part.mover] == drive.variable
    )
    joints = tuple(name for name in robot.driven if name in robot.arm.fingers)
    count = len(joints)
    stiffness, force = drive.stiffness / count, drive.force_limit / count
    return HandDrive(links, joints, stiffness, force, len(robot.arm.fingers))


def is_frame(robot: Robot, link: Link) -> bool:
    """Return whether ``link`` is only a frame: fixed, without mass, shape and children."""
    return not (
        link.parent is None
        or link.joint is not None
        or link.inertial is not None
        or link.collisions
        or robot.children(link)
        or any(len(shape.faces) for shape in link.shapes)
    )


def drives_of(robot: Robot, grip: HandDrive | None) -> dict[str, Drive]:
    """Return a drive for each movable joint of ``robot``, for the fingers that of ``grip``."""
    moved_links = [(link, link.joint) for link in robot.links if link.joint is not None]
    carried = {joint.name: _carried(robot, link, joint) for link, joint in moved_links}
    drives: dict[str, Drive] = {}
    for _, joint in moved_links:
        # A drive carries the joints that follow it too.
        moved = [
            (abs(other.factor), *carried[other.name])
            for other in robot.joints.values()
            if joint.name in (other.name, other.leader)
        ]
        load = max(sum(factor * weight for factor, weight, _ in moved), MIN_LOAD)
        inertia = sum(factor * factor * mass for factor, _, mass in moved)
        stiffness = load / SAG
        is_credible = CREDIBLE_RATIO * load <= joint.effort < np.inf
        force = joint.effort if is_credible else FORCE_RATIO * load
        armature, ratio = INERTIA_RATIO * inertia, DAMPING_RATIO
        if grip is not None and joint.leader in grip.joints:
            # With more stiffness, and its damping, this force would move it too slowly.
            stiffness, force = grip.stiffness, grip.force
            # A light finger would be pressed into what it holds.
            armature = physics.FINGER_MASS if joint.slides else physics.FINGER_INERTIA
            # In the joints, because a drive at its greatest force has no damping of its own.
            ratio = 1.0 / math.sqrt(grip.fingers)
        armature = max(armature, stiffness / MAX_FREQUENCY**2 - inertia)
        spring = ratio * 2.0 * float(np.sqrt(stiffness * (inertia + armature)))
        drives[joint.name] = Drive(
            stiffness, armature, joint.damping or spring, joint.friction, force
        )
    return drives


def _carried(robot: Robot, link: Link, joint: Joint) -> tuple[float, float]:
    """Return upper bounds on the weight [N m or N] and the inertia that ``joint`` moves."""
    load = inertia = 0.0
    farthest = {link.name: 0.0}
    for other in robot.links:
        if other.name != link.name:
            if other.parent not in farthest:
                continue
            step = float(np.linalg.norm(other.T_parent_link[:3, 3])) + _travel(other)
            farthest[other.name] = farthest[other.parent] + step
        inertial = other.inertial
        if inertial is not None:
            offset = float(np.linalg.norm(inertial.T_link_inertia[:3, 3]))
            arm = 1.0 if joint.slides else farthest[other.name] + offset
            load += GRAVITY * inertial.mass * arm
            own = 0.0 if joint.slides else float(np.linalg.eigvalsh(inertial.moments)[-1])
            inertia += inertial.mass * arm * arm + own
    return load, inertia


def _travel(link: Link) -> float:
    """Return the maximum distance [m] that the joint of ``link`` slides from zero."""
    joint = link.joint
    if joint is None or not joint.slides:
        return 0.0
    ends = [abs(end) for end in (joint.lower, joint.upper) if np.isfinite(end)]
    return max(ends, default=0.0)


def keyframes(robot: Robot) -> dict[str, Mapping[str, float]]:
    """Return the values of all joints [rad or m] at home and zero; a mechanism is at zero."""
    zero, arm = robot.every({}), robot.arm
    if arm is None:
        return {"home": zero, "zero": zero}
    home = arm.joint_values(arm.ready(Settings.ready), arm.gripper.clamp(0.0))
    return {"home": robot.every(home), "zero": zero}


def home_vector(robot: Robot) -> FloatArray:
    """Return the joint values (k,) [rad or m] of a collision world of ``robot`` at home."""
    arm = robot.arm
    if arm is None:
        home = robot.every({})
        return np.array([*(home[name] for name in robot.driven), 0.0])
    return np.append(arm.ready(Settings.ready), arm.gripper.clamp(0.0))


def excluded_pairs(robot: Robot) -> list[tuple[str, str]]:
    """Return the names of the pairs of links with collision shapes that cannot meet.

    For an arm of the five-axis family these are all pairs that this project does not check either:
    neighbours, pairs that no sampled posture brings near each other, and those that always overlap.
    For any other robot these are the neighbours, and the pairs whose hulls touch at home.
    """

    def at_home(linkage: Linkage, parts: Sequence[Part]) -> CollisionWorld:
        rest = pairs_at_rest(linkage, parts, home_vector(robot))
        return CollisionWorld(linkage, parts, rest.checked)

    links = {link.name for link in robot.links if link.collisions}
    if not links:
        return []
    family = robot.arm is not None and robot.arm.chain.n == ARM_JOINTS
    world, _ = world_of(robot, make=None if family else at_home)
    names = [] if world is None else [part.name for part in world.parts]
    checked = set() if world is None else {(names[a], names[b]) for a, b in world.pairs}
    return [
        pair
        for pair in combinations([name for name in names if name in links], 2)
        if pair not in checked
    ]


SCENE_FILE = "katana450.extensions.importers.formats.scene_file:load_initial_scene"
WORLD = "world"
"""Function that reads a scene, and the name that MuJoCo keeps for its own root."""

OPTION = {
    "integrator": "implicitfast",
    "timestep": repr(physics.STEP),
    "cone": "elliptic",
    "noslip_iterations": str(physics.SLIP_STEPS),
}
"""Attributes of the simulation. The step is small enough for the drives of the lightest links."""

CONTACT = {
    "solref": f"{physics.CONTACT_TIME!r} {physics.CONTACT_DAMPING!r}",
    "solimp": " ".join(map(repr, physics.CONTACT_STIFFNESS)),
}
"""Attributes of contacts, which are as hard as the app simulates them."""

HAND = "hand"
"""Name of the class of geometries that hold objects."""

LINK_FRICTION = physics.LINK_FRICTION, physics.SPIN_FRICTION, physics.ROLLING_FRICTION
HAND_FRICTION = physics.PAD_FRICTION, physics.PAD_SPIN, physics.ROLLING_FRICTION
"""[1, m, m] Friction of links and of what holds: against sliding, spinning and rolling."""

CUP = {"gap": repr(SEAL_GAP)}
"""Attributes of a suction cup, which pulls what it almost touches too. Since MuJoCo 3.10 a gap
presses nothing."""

LEAST_MASS, LEAST_INERTIA = "1e-4", "1e-8"
"""[kg, kg m^2] Minimum of a moving body, for robots whose file states no masses."""

SITE_RADIUS = "0.004"
"""[m] Radius with which a frame is drawn."""

COUPLING = {"solref": "0.004 1", "solimp": CONTACT["solimp"]}
"""Attributes of a stiff equality; its time constant [s] is a few steps."""

VISUAL = {"type": "mesh", "group": "2", "contype": "0", "conaffinity": "0", "mass": "0"}
"""Attributes of a geometry that is only seen."""

SCENE = {
    "texture": {
        "type": "skybox",
        "builtin": "gradient",
        "rgb1": "0.87 0.89 0.92",
        "rgb2": "0.5 0.55 0.6",
        "width": "32",
        "height": "192",
    },
    "light": {"pos": "1 -1 2.5", "dir": "-0.4 0.4 -1", "castshadow": "true"},
    "geom": {
        **{"name": "floor", "type": "plane", "size": "2 2 0.05", "rgba": "0.75 0.77 0.8 1"},
        "contype": "0",
    },
}
"""Sky, light and floor of the scene. Bodies on joints pass through the floor."""


def mjcf_files(robot: Robot, scene: Path | None = None) -> dict[str, bytes]:
    """Return name and content of the zip for ``robot``, with the objects of the file ``scene``.

    Raises InputError for a scene that cannot be read or has the name of a link.
    """
    model = _Model(robot)
    (name,) = distinct([robot.name])
    root, floor = model.root(), _scene(f"{name}.xml", robot)
    if scene is not None:
        _add_objects(floor, root, robot, scene)
    files = {
        f"{name}.xml": _text(root),
        "scene.xml": _text(floor),
        **{f"meshes/{file}.obj": text.encode() for file, text in model.meshes.items()},
    }
    return {
        f"{name}_mjcf.zip": zipped({f"{name}/{path}": files[path] for path in files}, mode=0o644)
    }


class _Model:
    """The parts of one model.

    Attributes:
        meshes: text of each mesh by its name.
    """

    def __init__(self, robot: Robot) -> None:
        self.meshes: dict[str, str] = {}
        self._robot = robot
        self._grip = grip_of(robot)
        self._suction = 0.0 if self._grip is None else self._grip.suction
        self._drives = drives_of(robot, self._grip)
        self._assets = ET.Element("asset")
        shown = dict.fromkeys(shape.material for link in robot.links for shape in link.shapes)
        names = distinct(material.name for material in shown)
        self._materials: dict[Material, str] = dict(zip(shown, names, strict=True))
        self._files: list[str] = []

    def root(self) -> ET.Element:
        """Return the element <mujoco>."""
        robot = self._robot
        root = ET.Element("mujoco", model=robot.name)
        ET.SubElement(
            root,
            "compiler",
            angle="radian",
            meshdir="meshes",
            autolimits="true",
            boundmass=LEAST_MASS,
            boundinertia=LEAST_INERTIA,
        )
        ET.SubElement(root, "option", OPTION)
        defaults = ET.SubElement(root, "default")
        ET.SubElement(defaults, "geom", {"friction": _numbers(LINK_FRICTION), **CONTACT})
        holds = ET.SubElement(defaults, "default", {"class": HAND})
        cup = CUP if self._suction else {}
        ET.SubElement(holds, "geom", {"friction": _numbers(HAND_FRICTION), "condim": "4", **cup})
        root.append(self._assets)
        for material, name in self._materials.items():
            ET.SubElement(
                self._assets,
                "material",
                name=name,
                rgba=_numbers((*material.colour, 1.0), 4),
                specular=_numbers([material.gleam], 4),
                shininess=_numbers([1.0 - material.rough], 4),
            )
        self._add_body(ET.SubElement(root, "worldbody"), robot.links[0])
        contact = ET.SubElement(root, "contact")
        for first, second in excluded_pairs(robot):
            ET.SubElement(contact, "exclude", body1=_body(first), body2=_body(second))
        self._add_couplings(root)
        self._add_actuators(root)
        self._add_keyframes(root)
        return root

    def _add_body(self, parent: ET.Element, link: Link) -> None:
        place = _place(link.T_parent_link)
        if is_frame(self._robot, link):
            ET.SubElement(
                parent, "site", {"name": link.name, "size": SITE_RADIUS, "group": "4", **place}
            )
            return
        body = ET.SubElement(parent, "body", {"name": _body(link.name), **place})
        if link.inertial is not None:
            body.append(_inertial(link.inertial))
        if link.joint is not None:
            body.append(_joint(link.joint, self._drives[link.joint.name]))
        for shape in link.shapes:
            material = self._materials[shape.material]
            mesh = self._mesh(f"{link.name}_{material}", [shape], inertia="shell")
            ET.SubElement(body, "geom", {"mesh": mesh, "material": material, **VISUAL})
        for collision in link.collisions:
            body.append(self._collision(link, collision))
        for child in self._robot.children(link):
            self._add_body(body, child)

    def _collision(self, link: Link, collision: Visual) -> ET.Element:
        """Return the geometry of a collision shape."""
        geom = ET.Element("geom", group="3", mass="0")
        if self._grip is not None and link.name in self._grip.links:
            geom.set("class", HAND)
        size = None if collision.primitive is None else _primitive(collision.primitive)
        if size is not None:
            geom.attrib.update(size, **_place(collision.T_body_visual))
        else:
            shapes = shapes_of(collision)
            geom.attrib.update(type="mesh", mesh=self._mesh(f"{link.name}_hull", shapes))
        return geom

    def _mesh(self, name: str, shapes: Sequence[VisualMesh], **options: str) -> str:
        """Add a mesh to the files; return its name."""
        self._files.append(name)
        name = distinct(self._files)[-1]
        self.meshes[name] = obj_text(shapes, None)
        ET.SubElement(self._assets, "mesh", {"name": name, "file": f"{name}.obj", **options})
        return name

    def _add_couplings(self, root: ET.Element) -> None:
        followers = [j for j in self._robot.joints.values() if j.leader != j.name]
        if not followers:
            return
        equality = ET.SubElement(root, "equality")
        for joint in followers:
            ET.SubElement(
                equality,
                "joint",
                {
                    "name": f"{joint.name}_follows",
                    "joint1": joint.name,
                    "joint2": joint.leader,
                    "polycoef": _numbers((joint.offset, joint.factor, 0.0, 0.0, 0.0)),
                    **COUPLING,
                },
            )

    def _add_actuators(self, root: ET.Element) -> None:
        actuators = ET.SubElement(root, "actuator")
        holding = () if self._grip is None else self._grip.joints
        for name in self._robot.driven:
            joint, drive = self._robot.joints[name], self._drives[name]
            limits = _range(joint)
            ET.SubElement(
                actuators,
                "position",
                {
                    "name": name,
                    "joint": name,
                    "kp": _numbers([drive.stiffness], 3),
                    **({} if name in holding else {"dampratio": "1"}),
                    "forcerange": _numbers((-drive.max_force, drive.max_force), 4),
                    **({"ctrlrange": limits} if limits else {}),
                },
            )

        if self._grip is not None and self._suction:
            cup = {"name": "suction", "body": _body(min(self._grip.links)), "ctrlrange": "0 1"}
            ET.SubElement(actuators, "adhesion", cup, gain=_numbers([self._suction], 5))

    def _add_keyframes(self, root: ET.Element) -> None:
        frames = ET.SubElement(root, "keyframe")
        off = [0.0] if self._suction else []
        for name, values in keyframes(self._robot).items():
            ET.SubElement(
                frames,
                "key",
                name=name,
                qpos=_numbers([values[joint.name] for joint in self._in_order()]),
                ctrl=_numbers([*(values[name] for name in self._robot.driven), *off]),
            )

    def _in_order(self) -> Iterator[Joint]:
        """Yield the joints in the order in which MuJoCo numbers them: depth first."""
        waiting = [self._robot.links[0]]
        while waiting:
            link = waiting.pop()
            if link.joint is not None:
                yield link.joint
            waiting += reversed(self._robot.children(link))


def _body(link: str) -> str:
    return f"{link}_link" if link == WORLD else link


def _inertial(inertial: Inertial) -> ET.Element:
    moments, axes = inertial.principal
    return ET.Element(
        "inertial",
        mass=repr(inertial.mass),
        pos=_numbers(inertial.T_link_inertia[:3, 3]),
        quat=_numbers(so3.to_quaternion(axes)),
        diaginertia=_numbers(moments),
    )


def _joint(joint: Joint, drive: Drive) -> ET.Element:
    limits = _range(joint)
    return ET.Element(
        "joint",
        {
            "name": joint.name,
            "type": "slide" if joint.slides else "hinge",
            "axis": _numbers(joint.axis),
            "armature": _numbers([drive.armature], 7),
            "damping": _numbers([drive.damping], 5),
            "frictionloss": _numbers([drive.friction]),
            **({"range": limits} if limits else {}),
        },
    )


def _range(joint: Joint) -> str:
    """Return the limits of ``joint`` as text; empty if it has none."""
    ends = (joint.lower, joint.upper)
    return _numbers(ends) if np.isfinite(ends).all() else ""


def _primitive(shape: PrimitiveShape) -> dict[str, str] | None:
    """Return type and size of a box, cylinder or sphere; None for other shapes."""
    options = shape.options
    match shape.kind:
        case "box":
            return {"type": "box", "size": _numbers(0.5 * np.asarray(options["extents"]))}
        case "cylinder" if "height" in options:
            return {
                "type": "cylinder",
                "size": _numbers((options["radius"], 0.5 * options["height"])),
            }
        case "icosphere":
            return {"type": "sphere", "size": _numbers([options["radius"]])}
    return None


def _scene(model: str, robot: Robot) -> ET.Element:
    """Return a scene that shows ``model`` on a floor."""
    root = ET.Element("mujoco", model=f"{robot.name} on a floor")
    ET.SubElement(root, "include", file=model)
    ET.SubElement(ET.SubElement(root, "asset"), "texture", SCENE["texture"])
    world = ET.SubElement(root, "worldbody")
    ET.SubElement(world, "light", SCENE["light"])
    ET.SubElement(world, "geom", SCENE["geom"])
    return root


def _add_objects(floor: ET.Element, model: ET.Element, robot: Robot, scene: Path) -> None:
    """Add the objects of a file to the scene ``floor``, and the keyframes of ``model`` with them.

    MuJoCo refuses a keyframe without the places of all bodies.
    """
    session = arm_session(Settings(), robot).session
    stored = load(SCENE_FILE)(session, scene).scene
    state = session.begin(session.ready, session.require_arm().gripper.opened, 0.0)
    state = session.step(state, (ReplaceScene(stored.objects, stored.water),), 0.0)
    bodies, parts = session.loose_objects.scene(state)
    shared = {WORLD, *(link.name for link in robot.links)} & {body.name for body in bodies}
    if shared:
        raise InputError(f"The object {min(shared)} has the name of a link. Rename it.")
    movable = [item for item in state.objects if can_move(item)]
    poses = session.loose_objects.poses(movable, state.x_setpoint)
    parts = [part for part in parts if part.mover == GROUND]
    text, places = physics.scene_text(parts, bodies, poses)
    objects = ET.fromstring(text)
    for section in floor:
        section.extend(objects.iterfind(f"{section.tag}/*"))
    for frames in model.findall("keyframe"):
        model.remove(frames)
        floor.append(frames)
        for key in frames:
            key.set("qpos", f"{key.get('qpos')} {_numbers(places)}")


def _place(T: FloatArray) -> dict[str, str]:
    """Return position and quaternion of a pose (4, 4) [m], without those that are zero."""
    attributes = {}
    if T[:3, 3].any():
        attributes["pos"] = _numbers(T[:3, 3])
    if not np.array_equal(T[:3, :3], np.eye(3)):
        attributes["quat"] = _numbers(so3.to_quaternion(T[:3, :3]))
    return attributes


def _numbers(values: Sequence[float] | FloatArray, digits: int | None = None) -> str:
    """Return numbers as text, exactly or with ``digits`` significant digits."""
    return " ".join(
        repr(float(value) + 0.0) if digits is None else f"{value:.{digits}g}" for value in values
    )


def _text(root: ET.Element) -> bytes:
    ET.indent(root)
    text: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"
