"""Scenes in scripts and files: objects, meshes, and what differs from the present scene."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects.pouring import CUP
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.object_joint import ObjectJoint
from katana450.arm.control.state.scene_objects import (
    MAX_COORDINATE,
    MAX_CRUSH_FORCE,
    MAX_OBJECTS,
    MAX_SCALE,
    MIN_SCALE,
    SceneObject,
    Shape,
    Zone,
)
from katana450.arm.control.state.solid import MIN_OPACITY, Colour, ObjectAppearance, Solid
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.extensions.programs.building.plan_state import require_turning
from katana450.extensions.programs.language import kinds
from katana450.extensions.programs.language.declaration import ALONE, Declared, Kind, record
from katana450.extensions.programs.language.kinds import (
    TEXT,
    any_of,
    bound,
    choice,
    degrees,
    list_of,
    listed,
    millimetres,
    number,
    volume,
)
from katana450.extensions.programs.language.scope import ScriptContext
from katana450.extensions.programs.language.source import Problem, ScriptError, YamlValue, read
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.physics.joint import MAX_BODY_MASS, MAX_LOAD, BodyJoint
from katana450.maths.water.units import MILLILITRE, ML

VERSION = 1
"""Version of the format."""

UNITS = ("mm", "cm", "in", "m")
"""Units of a mesh file."""

COLOUR = re.compile(r"#[0-9a-f]{6}")
"""Pattern of a colour, in lower case."""

MAX_WRITTEN_SIZE = 4000.0
"""[mm] Maximum size in a text."""


@dataclass(frozen=True, eq=False)
class Scene:
    """The scene objects, the water, and the posture of the arm.

    Attributes:
        objects: the objects; the fingers hold none of them.
        water: volume of the water in the cup [m^3]; None for no water.
        joints: (n,) posture of the arm [rad]; None if not given.
    """

    objects: tuple[SceneObject, ...]
    water: float | None = None
    joints: FloatArray | None = None


def _digest(value: YamlValue, _context: ScriptContext) -> str:
    if not re.fullmatch(r"[0-9a-f]{64}", str(value.held)):
        raise value.wrong("A SHA-256 must have 64 digits from 0 to f.")
    return str(value.held)


def _colour(value: YamlValue, _context: ScriptContext) -> Colour:
    word = str(value.held).lower()
    if not COLOUR.fullmatch(word):
        raise value.wrong(f'A colour must be like "#94a3b8", in quotes, not {value}.')
    red, green, blue = bytes.fromhex(word[1:])
    return red, green, blue


def _pose(value: YamlValue, _context: ScriptContext) -> FloatArray:
    """Read the pose (4, 4) [m] of six numbers."""
    if value.kind != "list" or len(value.items) != 6:
        raise value.wrong("A pose must be six numbers: x, y, z in mm, roll, pitch, yaw in degrees.")
    lengths = [POSE_LENGTH(item) for item in value.items[:3]]
    angles = [POSE_ANGLE(item) for item in value.items[3:]]
    return se3.from_rotation_translation(so3.from_rpy(*angles), lengths)


def _flag(value: YamlValue, _context: ScriptContext) -> bool:
    word = str(value.held).lower()
    if word not in ("true", "false", "yes", "no"):
        raise value.wrong(f"Expected true or false, not {value}.")
    return word in ("true", "yes")


FLAG = Kind(_flag, {"type": "boolean"})
SIZES = listed(millimetres(0.0, MAX_WRITTEN_SIZE), 1, 3)
# In the frame of the tool, coordinates of a valid place can be larger.
POSE_LENGTH = millimetres(-2e3 * MAX_COORDINATE, 2e3 * MAX_COORDINATE)
POSE_ANGLE = degrees(-kinds.MAX_ANGLE, kinds.MAX_ANGLE)
POSE = Kind(_pose, list_of(any_of("mm or deg", *POSE_LENGTH.schema["anyOf"]), 6, 6))


@dataclass(frozen=True)
class MeshFile(Declared):
    """A mesh file.

    Attributes:
        path: path relative to the folder of the scene.
        unit: unit of its coordinates, such as ``mm``; None to guess it.
        up: axis that points up, ``y`` or ``z``; None for the default of the file format.
        sha256: SHA-256 of the file in hexadecimal; None to accept any content.
    """

    noun = "a mesh"

    path: Annotated[str, TEXT.about("File in the folder of the scene or below").named("file")]
    unit: Annotated[str | None, choice(*UNITS).about("Unit of the file; guessed unless given")] = (
        None
    )
    up: Annotated[str | None, choice("y", "z").about("Axis that points up")] = None
    sha256: Annotated[
        str | None, Kind(_digest, TEXT.schema).about("SHA-256 of the file, which is then checked")
    ] = None


AMOUNT = number(0.0, MAX_LOAD)


@dataclass(frozen=True, eq=False, kw_only=True)
class JointEntry(Declared):
    """A joint between an object and the ground.

    Attributes:
        axis: (3,) direction, and ``origin``: (3,) a point [m] of it, in the frame of the object.
        ends: the range, and ``start``: the position at the start [mm or deg].

    All others are as in ``BodyJoint``.
    """

    noun = "a joint"

    kind: Annotated[str, choice("slide", "hinge").about("How it moves").named("type")]
    axis: kinds.Direction
    origin: Annotated[FloatArray, kinds.vector(POSE_LENGTH, "A point of the axis, mm")] = field(
        default_factory=lambda: np.zeros(3)
    )
    ends: Annotated[
        tuple[float, ...],
        listed(number(-4e3, 4e3), 2, 2).about("Lower and upper end, mm or deg").named("range"),
    ]
    start: Annotated[
        float, number(-4e3, 4e3, about="Position at the start, mm or deg").named("position")
    ] = 0.0
    friction: Annotated[float, AMOUNT.about("Force that moves it, N; of a hinge N m")] = 0.0
    damping: Annotated[float, AMOUNT.about("N s/m; of a hinge N m s/rad")] = 0.0
    mass: Annotated[
        float | None, number(1e-3, MAX_BODY_MASS, about="Of all parts, kg; by volume unless given")
    ] = None

    def joint(self, T: FloatArray) -> BodyJoint:
        """Return the joint of an object whose pose is ``T`` (4, 4) at zero [m]."""
        point, axis = T[:3, :3] @ self.origin + T[:3, 3], T[:3, :3] @ self.axis
        lower, upper = (self.si(end) for end in self.ends)
        place = tuple(point.tolist()), tuple((axis / np.linalg.norm(axis)).tolist())
        slides, loads = self.kind == "slide", (self.friction, self.damping)
        joint = BodyJoint(slides, *place, lower, upper, *loads, mass=self.mass)
        if not lower <= self.si(self.start) <= upper:
            raise InputError(f"The position {self.start:g} of the joint is not in its range.")
        return joint

    def si(self, position: float) -> float:
        """Return a position in m or rad that is given in mm or deg."""
        return 1e-3 * position if self.kind == "slide" else math.radians(position)


@dataclass(frozen=True, eq=False, kw_only=True)
class SceneEntry(Declared):
    """An object.

    Attributes:
        source: its place in the text, for error messages.
        mesh: its mesh file; None for other shapes.
        T: (4, 4) its pose [m] in the base frame, or in the tool frame if it is ``fixed``; that with
            its joint at zero.
        part_of: name of the object on whose joint it moves; None for that of its own.

    All others are as in ``SceneObject``.
    """

    noun = "an object"

    source: YamlValue
    name: Annotated[str, TEXT.about("Its name")]
    shape_name: Annotated[
        str, choice(*(shape.value for shape in Shape)).about("Its shape").named("shape")
    ]
    size: Annotated[
        tuple[float, ...],
        SIZES.about("mm. box: x, y, z; plane: x, y; sphere: radius; others: radius, height"),
    ] = ()
    mesh: Annotated[MeshFile | None, record(MeshFile)] = None
    T: Annotated[
        FloatArray,
        POSE.about("x, y, z in mm, roll, pitch, yaw in deg, in the base frame").named("pose"),
    ]
    can_be_held: Annotated[bool, FLAG.about("Whether the fingers may grasp it")] = False
    scale: Annotated[float, number(MIN_SCALE, MAX_SCALE, about="Factor on its size")] = 1.0
    colour: Annotated[
        Colour | None, Kind(_colour, TEXT.schema).about('Like "#94a3b8", in quotes')
    ] = None
    opacity: Annotated[float, number(MIN_OPACITY, 1.0, about="1 is opaque")] = 1.0
    hidden: Annotated[bool, FLAG.about("Whether it is not drawn")] = False
    zone_name: Annotated[
        str, choice(*(zone.value for zone in Zone)).about("Rule for the arm in it").named("zone")
    ] = Zone.NONE.value
    attach: Annotated[str, choice("hand", "world").about("hand: it moves with the hand")] = "world"
    joint: Annotated[JointEntry | None, record(JointEntry)] = None
    part_of: Annotated[str | None, TEXT.about("Object with a joint, with which it moves")] = None
    crush_force: Annotated[
        float | None, number(1e-3, MAX_CRUSH_FORCE, about="Force of the fingers it bears, N")
    ] = None

    @classmethod
    def mistakes(cls, values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Yield the mistakes of a size or a mesh that the shape does not have."""
        if values.get("shape_name") is None:
            return
        shape = Shape(values["shape_name"])
        numbers, size = shape.numbers, values.get("size")
        needed, other = ("mesh", "size") if shape is Shape.MESH else ("size", "mesh")
        if needed not in values:
            yield "", f"An object needs {needed!r}."
        if other in values:
            yield other, f"A {shape.value} has no {other!r}."
        elif size is not None and len(size) != numbers:
            yield "size", f"Expected a list of {numbers} values, not of {len(size)}."

    @property
    def shape(self) -> Shape:
        """The shape."""
        return Shape(self.shape_name)

    @property
    def fixed(self) -> bool:
        """True if it moves with the hand."""
        return self.attach == "hand"

    @property
    def appearance(self) -> ObjectAppearance:
        """Colour, opacity and visibility."""
        return ObjectAppearance(self.colour, self.opacity, self.hidden)


def _entries(value: YamlValue, context: ScriptContext) -> tuple[SceneEntry, ...]:
    """Read a list of objects with different names."""
    entries = ENTRIES(value, context)
    names: set[str] = set()
    problems: list[Problem] = []
    for entry in entries:
        if entry.name in names:
            problems += entry.source.wrong(f"There are two objects called {entry.name!r}.").problems
        names.add(entry.name)
    if problems:
        raise ScriptError(tuple(problems))
    return entries


ENTRIES = listed(record(SceneEntry), 0, MAX_OBJECTS)
OBJECTS = Kind(_entries, ENTRIES.schema).about("The objects")


@dataclass(frozen=True, eq=False)
class SceneDraft(Declared):
    """A scene as in a scene file.

    Its mesh files are not read yet. The values are as in ``Scene``, and ``source`` is its place in
    the text.
    """

    noun = "a scene"

    source: YamlValue
    version: Annotated[float, number(1, 1000, about="Version of the format").named("scene")] = (
        VERSION
    )
    joints: Annotated[
        tuple[float, ...] | None, listed(POSE_ANGLE, 1, 16).about("Posture at the start, deg")
    ] = None
    water: Annotated[float | None, volume(0.0, 10_000.0, "Water in the cup, ml")] = None
    entries: Annotated[tuple[SceneEntry, ...], OBJECTS.named("objects")] = ()

    @classmethod
    def mistakes(cls, values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
        """Yield the mistake of another version."""
        version = values.get("version")
        if version not in (None, VERSION):
            yield "version", f"The version must be {VERSION}, not {version:g}."

    def scene(self, solids: Mapping[MeshFile, Solid], T_palm_tool: FloatArray | None) -> Scene:
        """Return the scene, with the solid of each mesh file from ``solids``.

        ``T_palm_tool``: (4, 4) pose of the default tool in the frame of the palm; None without a
        hand. Raises ScriptError with all errors and their places in the text.
        """
        objects: list[SceneObject] = []
        problems: list[Problem] = []
        leads = {entry.name: entry for entry in self.entries if entry.joint is not None}
        for entry in self.entries:
            try:
                joint, start = _joint(entry, leads)
                if entry.fixed and T_palm_tool is None:
                    raise InputError(
                        "Nothing can be attached to the hand: this arm has no model of a hand. "
                        "Remove `attach: hand`."
                    )
                T = entry.T if T_palm_tool is None or not entry.fixed else T_palm_tool @ entry.T
                objects.append(
                    SceneObject(
                        entry.name,
                        entry.shape,
                        entry.size,
                        T if joint is None else joint.pose(start),
                        entry.can_be_held,
                        solid=None if entry.mesh is None else solids[entry.mesh],
                        scale=entry.scale,
                        appearance=entry.appearance,
                        fixed=entry.fixed,
                        zone=Zone(entry.zone_name),
                        joint=joint,
                        crush_force=entry.crush_force,
                    )
                )
            except InputError as error:
                problems += entry.source.wrong(str(error)).problems
        if problems:
            raise ScriptError(tuple(problems))
        joints = None if self.joints is None else np.array(self.joints)
        return Scene(tuple(objects), self.water, joints)

    def begin(self, session: Session) -> State:
        """Return the state of an arm at rest in the scene. Raises InputError for a mesh.

        The meshes of a scene are files, which are read by ``katana450 run``.
        """
        for entry in self.entries:
            if entry.mesh is not None:
                raise entry.source.wrong(
                    f"{entry.name} is a mesh, whose file is not read here. Use `katana450 run`."
                )
        scene = self.scene({}, _T_palm_tool(session))
        try:
            return begun(session, scene)
        except ScriptError:
            raise
        except InputError as error:
            raise self.source.wrong(str(error)) from error

    def check_present(self, session: Session, state: State) -> None:
        """Raise ScriptError with the first difference if ``state`` is not in this scene.

        The forms of meshes are not compared.
        """
        if difference := self._difference(session, state):
            raise self.source.wrong(
                f"The scene is not that of the script: {difference}. Load the "
                "scene on the page, start the server with it, or simulate the script alone. "
                "Without `scene` it runs in any."
            )

    def _difference(self, session: Session, state: State) -> str:
        """Return a clause that names the first difference of ``state`` from this scene."""
        present = {scene_object.name: scene_object for scene_object in state.objects}
        T_palm_tool = _T_palm_tool(session)
        for entry in self.entries:
            if entry.name not in present:
                return f"there is no object {entry.name!r}"
            difference = _object_difference(entry, present[entry.name], T_palm_tool)
            if difference:
                return difference
        expected = {entry.name for entry in self.entries}
        for name in present:
            if name not in expected:
                return f"there is also {name}"
        wanted, poured = (self.water or 0.0) / ML, state.poured
        cup = 0.0 if poured is None else poured.water.cup.volume / MILLILITRE
        if abs(wanted - cup) > SAME_VOLUME:
            return f"the cup has {cup:.1f} ml of water, not {wanted:.1f} ml of water"
        return ""


def _joint(entry: SceneEntry, leads: Mapping[str, SceneEntry]) -> tuple[ObjectJoint | None, float]:
    """Return the joint of an object and its position at the start [m or rad].

    ``leads``: the objects with a joint of their own. Raises InputError for a part of another one.
    """
    if entry.joint is None and entry.part_of is None:
        return None, 0.0
    name = entry.name if entry.part_of is None else entry.part_of
    lead = leads.get(name)
    if lead is None or lead.joint is None or None not in (entry.joint, entry.part_of):
        raise InputError(
            f"`part_of` must be another object with a `joint`, and {entry.name} must then have no "
            "`joint` of its own."
        )
    return ObjectJoint(name, lead.joint.joint(lead.T), entry.T), lead.joint.si(lead.joint.start)


def parsed(source: str) -> SceneDraft:
    """Return the text of a scene file as a draft. Raises ScriptError with all its mistakes."""
    value = read(source, "scene")
    if value.kind == "mapping" and all(name.held != "scene" for name, _ in value.fields):
        raise value.wrong("A scene needs 'scene', the version of its format.")
    return SceneDraft.read(value, ALONE)


SAME_PLACE = 1e-4
"""[m] Distance up to which an object is at the place that a script expects."""

SAME_TURN = 1e-3
"""[1] Maximum difference of the elements of two rotation matrices that count as equal."""

SAME_VOLUME = 0.1
"""[ml] Difference up to which the cup has the water that a script expects."""


def _scene(value: YamlValue, context: ScriptContext) -> SceneDraft | None:
    """Read a list of objects, or a mapping like that of a scene file."""
    if value.kind == "nothing":
        return None
    if value.kind == "list":
        return SceneDraft(value, entries=bound(OBJECTS)(value, context))
    if value.kind == "text":
        raise value.wrong(
            f"A script has its objects itself. Copy them from {value} to here, or leave `scene` "
            "out and run it with `--scene` and the file."
        )
    return bound(record(SceneDraft))(value, context)


SCENE = Kind(
    _scene,
    any_of(
        "The scene that the script needs: the objects, or a scene as in a scene file",
        OBJECTS.schema,
        SceneDraft.schema(),
        {"type": "null"},
    ),
)


def begun(session: Session, scene: Scene) -> State:
    """Return the state of an arm at rest in ``scene``. Raises InputError if it is impossible."""
    check_scene(session, scene)
    q = session.ready if scene.joints is None else scene.joints
    start = session.begin(q, session.require_arm().gripper.clamp(0.0), 0.0)
    return session.step(start, (cmd.ReplaceScene(scene.objects, scene.water),), start.t)


def check_scene(session: Session, scene: Scene) -> None:
    """Raise InputError if the arm of ``session`` cannot begin in ``scene``."""
    if scene.joints is not None:
        if session.arm is None:
            raise InputError(
                "`joints` are the angles of an arm, and this robot is driven joint by joint. Leave "
                "them out."
            )
        chain = session.arm.chain
        require_turning(chain)
        if not chain.within_limits(chain.check_q(scene.joints)):
            raise InputError("The joints lie outside the limits of this arm.")
    if scene.water is not None and all(scene_object.name != CUP for scene_object in scene.objects):
        raise InputError("There is water, but no cup.")
    session.check(cmd.ReplaceScene(scene.objects, scene.water))


def _object_difference(
    entry: SceneEntry, present: SceneObject, T_palm_tool: FloatArray | None
) -> str:
    """Return a clause that names how ``present`` differs from ``entry``; "" for not at all."""
    same_size = entry.shape is Shape.MESH or np.allclose(entry.size, present.size, rtol=1e-6)
    same_scale = math.isclose(entry.scale, present.scale, rel_tol=1e-6)
    if entry.shape is not present.shape or not (same_size and same_scale):
        return f"{entry.name} has another shape, size or scale"
    if present.held or entry.fixed is not present.fixed:
        return f"{entry.name} is {'' if present.carried else 'not '}in the hand"
    if (entry.can_be_held, entry.zone_name) != (present.can_be_held, present.zone.value):
        return f"{entry.name} has another `can_be_held` or `zone`"
    T = entry.T if T_palm_tool is None or not entry.fixed else T_palm_tool @ entry.T
    if (present.joint is None) is not (entry.joint is None and entry.part_of is None):
        return f"{entry.name} has another joint"
    if present.joint is not None and entry.joint is not None:
        T = present.joint.joint.motion(entry.joint.si(entry.joint.start)) @ T
    elif present.joint is not None:
        # It is where the object is of which it is a part.
        T = present.joint.pose(present.joint.position(present.T))
    if float(np.linalg.norm(T[:3, 3] - present.T[:3, 3])) > SAME_PLACE:
        x, y, z = (1e3 * present.T[:3, 3]).tolist()
        return f"{entry.name} is elsewhere, at ({x:.1f}, {y:.1f}, {z:.1f}) mm"
    if float(np.abs(T[:3, :3] - present.T[:3, :3]).max()) > SAME_TURN:
        return f"{entry.name} is turned"
    return ""


def _T_palm_tool(session: Session) -> FloatArray | None:
    hand = session.environment.hand
    return None if hand is None else hand.T_palm_tool
