"""The free bodies around an arm, their motion, and the model of MuJoCo for both."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from katana450.maths.collision.engine import KINDS, hull_triangles
from katana450.maths.collision.linkage import GROUND, Linkage
from katana450.maths.collision.shape import CollisionShape
from katana450.maths.collision.world import Part
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import BoolArray, FloatArray, frozen
from katana450.maths.physics.joint import BodyJoint
from katana450.maths.physics.suction import Seal, SuctionCup
from katana450.maths.water.units import GRAVITY

REST_TIME = 0.25
"""[s] Time for which a body must be slow until it counts as at rest."""


@dataclass(frozen=True, eq=False)
class RigidBody:
    """A body of convex pieces.

    Attributes:
        name: unique among the bodies and parts of a scene.
        shapes: its convex pieces.
        T_body_shape: pose (4, 4) of each piece in the frame of the body [m].
        mass: [kg], spread evenly over the volume of the pieces.
        friction: coefficient of Coulomb friction [1]. Between two bodies the greater one counts.
        joint: its joint with the ground; None for a free body. The frame of the body has its origin
            at the point of the joint, and at zero the axes of the base frame.
        owners: name of the object of each piece; none if all are those of the body.
    """

    name: str
    shapes: tuple[CollisionShape, ...]
    T_body_shape: tuple[FloatArray, ...]
    mass: float
    friction: float
    joint: BodyJoint | None = None
    owners: tuple[str, ...] = ()


class FingerContact(NamedTuple):
    """The contact of a finger, or of the palm, with a body.

    Attributes:
        finger, body: names of the part and of the object.
        force: sum of the normal forces [N].
        friction: length of the sum of the tangential forces [N].
    """

    finger: str
    body: str
    force: float
    friction: float


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """The motion of all free bodies of a scene.

    It is all that the engine remembers, so that equal motions continue with equal bits.

    Attributes:
        names: names of the bodies.
        place: (b, 7) position [m] and quaternion of each body.
        velocity: (b, 6) linear velocity [m/s] in the base frame, and angular velocity [rad/s] in
            the frame of the body.
        memory: (k,) accelerations from which the engine begins its search for the next forces.
        rest_time: (b,) time for which each body has been slow [s].
        fingers: (f, 2) place and velocity of the joint of each finger [rad or m]; (0, 2) while none
            of them touches a body: they are at their setpoint then.
        contacts: the contacts of the fingers with bodies.
        seal: that of a suction cup; None if it is off or touches nothing.
    """

    names: tuple[str, ...]
    place: FloatArray
    velocity: FloatArray
    memory: FloatArray
    rest_time: FloatArray
    fingers: FloatArray = field(default_factory=lambda: frozen(np.empty((0, 2))))
    contacts: tuple[FingerContact, ...] = ()
    seal: Seal | None = None

    @property
    def resting(self) -> BoolArray:
        """(b,) True for a body at rest: it stays where it is until something wakes it."""
        return np.asarray(self.rest_time >= REST_TIME)

    @property
    def poses(self) -> dict[str, FloatArray]:
        """Pose (4, 4) of each body in the base frame."""
        rows = zip(self.names, self.place, strict=True)
        return {name: frozen(pose_at(place)) for name, place in rows}


def pose_at(place: FloatArray) -> FloatArray:
    """Return the pose (4, 4) with the position [m] and quaternion ``place`` (7,)."""
    return se3.from_rotation_translation(so3.from_quaternion(place[3:]), place[:3])


@lru_cache(maxsize=256)
def volume(shape: CollisionShape) -> float:
    """Return the volume of a shape [m^3]."""
    geometry = shape.geometry
    a, b, c = geometry.size
    match geometry.kind:
        case "sphere":
            return 4.0 / 3.0 * np.pi * a**3
        case "cylinder":
            return 2.0 * np.pi * a**2 * b
        case "box":
            return 8.0 * a * b * c
    points = geometry.points
    corners = points[hull_triangles(points)]
    return float(np.abs(np.linalg.det(corners)).sum()) / 6.0


INSIDE = 0.8
"""[1] Radius of the inside of a body, as a ratio to half of the least extent of its first piece."""


def radius_of(body: RigidBody) -> float:
    """Return the radius [m] of the ball about the origin of a body that contains it."""
    return max(
        float(np.linalg.norm(T[:3, :3] @ shape.centre + T[:3, 3])) + shape.radius
        for T, shape in zip(body.T_body_shape, body.shapes, strict=True)
    )


def inside_of(body: RigidBody) -> tuple[FloatArray, float]:
    """Return the middle (3,) and radius [m] of a ball in the first piece of a body."""
    shape, T = body.shapes[0], body.T_body_shape[0]
    return T[:3, :3] @ shape.centre + T[:3, 3], 0.5 * INSIDE * float((shape.high - shape.low).min())


STEP = 1e-3
"""[s] Longest step of the engine. The contacts are as stiff as it allows."""

CONTACT_TIME, CONTACT_DAMPING = 2 * STEP, 4.0
"""[s, 1] Time in which bodies in contact lose their speed, and ratio of the critical damping. With
less damping they bounce, because a contact cannot pull."""

CONTACT_STIFFNESS = (0.99, 0.999, 1e-4, 0.5, 2.0)
"""[1, 1, m, 1, 1] How hard a contact is: the fraction of its force that needs no motion of the
bodies, at their surface and from the depth of the third number on (solimp)."""

SLIP_STEPS = 3
"""Number of steps that take the rest of creeping out of contacts that hold."""

LINK_MASS = 1e5
"""[kg, kg m^2] Mass and inertia of the links and of bodies at rest: a contact of a tick does not
move them. With greater numbers the engine's matrices lose their digits."""

MEMORY = 1 << 26
"""[bytes] Memory for contacts. Those of a heap that needs more are left out."""

LINK_FRICTION = 0.35
"""[1] Coefficient of friction of links and of what stands still. Assumed."""

SPIN_FRICTION, ROLLING_FRICTION = 5e-3, 2e-5
"""[m] Friction against turning about the normal of a contact, and against rolling. Assumed."""

LINK, BODY = 1, 2
"""Bits of what meets what: bodies meet everything, and links meet only them."""

SLIDING, SPINNING, ROLLING = 3, 4, 6
"""Numbers of directions in which a contact of a flat piece, a finger and a round piece resists
(condim)."""


FINGER_INERTIA, FINGER_MASS = 3e-3, 0.3
"""[kg m^2, kg] Inertia of the drive at a finger that turns, and at one that slides. Assumed."""

PAD_FRICTION, PAD_SPIN = 0.8, 0.01
"""[1, m] Coefficient of friction of the fingers, rubber on smooth plastic, and their friction
against turning, that of a soft pad of 20 by 30 mm. Assumed."""


class FingerDrive(NamedTuple):
    """The drive of the fingers: a spring between the finger joint and its goal.

    Attributes:
        variable: index of the finger joint in x.
        stiffness: [N m/rad or N/m].
        force_limit: greatest force of the drive, seen at the finger joint [N m or N].
        palm, grasp_point: the rigid group that carries the fingers, and the point (3,) in its frame
            where they close [m]. What is held there follows each step of the palm exactly; at a
            distance r from it, it would drift outwards by r w^2 h / 2 in each second, with the turn
            w of the palm and the step h.
    """

    variable: int
    stiffness: float
    force_limit: float
    palm: int
    grasp_point: FloatArray


@dataclass(frozen=True, eq=False)
class Model:
    """A compiled model. Its bodies are the free ones, those on joints, the links, the fingers.

    Attributes:
        compiled: MuJoCo's model.
        links: the rigid groups of the arm that are moved from outside.
        origins: (m, 3) origin of the frame of each of these links in that of its group [m].
        fingers: the rigid groups that the drive moves.
        owners: names of the parts and bodies by the numbers of their geometries.
    """

    compiled: Any
    links: tuple[int, ...]
    origins: FloatArray
    fingers: tuple[int, ...]
    owners: tuple[str, ...]


def compile_model(
    linkage: Linkage,
    parts: Sequence[Part],
    bodies: Sequence[RigidBody],
    drive: FingerDrive | SuctionCup | None = None,
) -> Model:
    """Return the model of ``bodies`` among the ``parts`` of the arm and its environment.

    The free bodies come before those on joints, which meet no part of the ground. That
    stands still. The groups of a ``drive`` of fingers are moved by it, all others of the
    ``linkage`` from outside.
    """
    import mujoco

    spec = mujoco.MjSpec()
    option, spec.memory = spec.option, MEMORY
    option.timestep, option.gravity = STEP, (0.0, 0.0, -GRAVITY)
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # A motion that is not finite is seen, where the engine would put all bodies at the origin.
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    option.noslip_iterations = SLIP_STEPS
    builder = _Builder(spec)
    for body in bodies:
        builder.add_body(body)
    frames = {GROUND: spec.worldbody}
    variable = drive.variable if isinstance(drive, FingerDrive) else None
    fingers = tuple(g for g in range(1, linkage.count) if linkage.variable[g] == variable)
    moved = {part.mover for part in parts} | {int(linkage.parent[group]) for group in fingers}
    links = tuple(sorted(moved - {GROUND, *fingers}))
    origins = np.zeros((linkage.count, 3))
    if drive is not None:
        origins[drive.palm] = drive.grasp_point
    origins[GROUND] = 0.0
    for group in links:
        frames[group] = frame = spec.worldbody.add_body()
        frame.add_freejoint()
        frame.mass, frame.inertia, frame.explicitinertial = LINK_MASS, (LINK_MASS,) * 3, True
        frame.gravcomp = 1.0
    for group in fingers:
        parent = int(linkage.parent[group])
        T = _shifted(linkage.T_parent_mover[group], origins[parent])
        frames[group] = builder.add_finger(frames[parent], linkage, group, T)
    if isinstance(drive, FingerDrive) and fingers:
        builder.add_drive(linkage, fingers, drive)
    # A jaw of the palm, or a cup, holds as a finger does.
    hand = {*fingers, *(() if drive is None else (drive.palm,))} - {GROUND}
    for part in parts:
        places = tuple(_shifted(T, origins[part.mover]) for T in part.T_mover_shape)
        shifted = replace(part, T_mover_shape=places)
        builder.add_part(frames[part.mover], shifted, is_hand=part.mover in hand)
    compiled = spec.compile()
    owners = builder.set_meetings(compiled)
    return Model(compiled, links, frozen(origins[list(links)]), fingers, owners)


def scene_text(
    parts: Sequence[Part],
    bodies: Sequence[RigidBody],
    poses: Mapping[str, FloatArray],
) -> tuple[str, FloatArray]:
    """Return ``bodies`` among fixed ``parts`` as MJCF without a robot, and their places (q,) there.

    All meet each other and a robot, but bodies on joints meet no part and no such body.

    Args:
        parts: of the ground.
        bodies: those on joints last.
        poses: pose (4, 4) of each body in the base frame [m].
    """
    import mujoco

    spec = mujoco.MjSpec()
    builder = _Builder(spec)
    positions = []
    for body in bodies:
        frame, T = builder.add_body(body, body.name), poses[body.name]
        if body.joint is None:
            frame.pos, frame.quat = T[:3, 3], so3.to_quaternion(T[:3, :3])
        else:
            positions.append(body.joint.position(_shifted(T, np.array(body.joint.point))))
    for part in parts:
        builder.add_part(spec.worldbody, part, is_hand=False)
    for number, (_, meets) in enumerate(builder.bits):
        geom = spec.geom(str(number))
        geom.contype, geom.conaffinity = int(meets == LINK | BODY), 1
        geom.name = f"{builder.owners[number]} {number}"
    places = spec.compile().qpos0.copy()
    places[len(places) - len(positions) :] = positions
    return spec.to_xml(), places


class _Builder:
    """Adds geometries to a specification, and remembers what each of them meets."""

    def __init__(self, spec: Any) -> None:
        self._spec = spec
        self.bits: list[tuple[int, int]] = []
        self.owners: list[str] = []
        self._joints: dict[int, Any] = {}
        self._meshes: dict[tuple[bytes, bool], str] = {}

    def add_finger(self, parent: Any, linkage: Linkage, group: int, T: FloatArray) -> Any:
        """Return a finger on its ``parent``, with the joint of its ``group``.

        T: (4, 4) its frame at zero in that of the parent.
        """
        import mujoco

        slides = group in linkage.sliding
        frame = parent.add_body(pos=T[:3, 3], quat=so3.to_quaternion(T[:3, :3]))
        frame.mass, frame.inertia, frame.explicitinertial = 1e-3, (1e-6,) * 3, True
        frame.gravcomp = 1.0
        self._joints[group] = frame.add_joint(
            name=_joint(group),
            type=mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE,
            axis=linkage.axis[group],
            armature=FINGER_MASS if slides else FINGER_INERTIA,
        )
        return frame

    def add_drive(self, linkage: Linkage, fingers: Sequence[int], drive: FingerDrive) -> None:
        """Let the first finger be driven, and the others follow it."""
        import mujoco

        first = fingers[0]
        for group in fingers[1:]:
            ratio = float(linkage.factor[group] / linkage.factor[first])
            coupling = self._spec.add_equality(
                type=mujoco.mjtEq.mjEQ_JOINT, name1=_joint(group), name2=_joint(first)
            )
            offset = float(linkage.offset[group] - ratio * linkage.offset[first])
            coupling.data[:5] = offset, ratio, 0.0, 0.0, 0.0
            coupling.solref[:2] = CONTACT_TIME, 1.0
            coupling.solimp[:5] = CONTACT_STIFFNESS
        # Seen at the first finger, whose joint moves by a factor of the finger joint.
        factor = abs(float(linkage.factor[first]))
        stiffness = drive.stiffness / factor**2
        inertia = FINGER_MASS if first in linkage.sliding else FINGER_INERTIA
        # In the joints, because a drive at its greatest force has no damping of its own.
        for group in fingers:
            self._joints[group].damping[0] = 2.0 * np.sqrt(stiffness * inertia / len(fingers))
        motor = self._spec.add_actuator(target=_joint(first))
        motor.trntype = mujoco.mjtTrn.mjTRN_JOINT
        motor.gaintype, motor.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        motor.gainprm[0] = stiffness
        motor.biasprm[1] = -stiffness
        limit = drive.force_limit / factor
        motor.forcelimited, motor.forcerange = True, (-limit, limit)

    def add_part(self, frame: Any, part: Part, *, is_hand: bool) -> None:
        bits = (BODY if part.mover == GROUND else LINK, 0)
        friction = (PAD_FRICTION, PAD_SPIN) if is_hand else (LINK_FRICTION, SPIN_FRICTION)
        for T, shape in zip(part.T_mover_shape, part.shapes, strict=True):
            # Contacts of a face have several points only with the faces of its hull.
            self._add(frame, T, shape, friction, bits, solid=is_hand).mass = 0.0
            self.owners.append(part.name)

    def add_body(self, body: RigidBody, name: str = "") -> Any:
        """Return the frame of ``body`` with its joint and its pieces."""
        frame = self._spec.worldbody.add_body(name=name)
        if body.joint is None:
            frame.add_freejoint(name=name)
        else:
            _add_joint(frame, body.joint, name)
        volumes = [volume(shape) for shape in body.shapes]
        for T, shape, size in zip(body.T_body_shape, body.shapes, volumes, strict=True):
            friction = body.friction, SPIN_FRICTION
            meets = LINK | BODY if body.joint is None else LINK
            geom = self._add(frame, T, shape, friction, (BODY, meets), solid=True)
            geom.mass = body.mass * size / math.fsum(volumes)
        self.owners += body.owners or (body.name,) * len(body.shapes)
        return frame

    def _add(
        self,
        frame: Any,
        T: FloatArray,
        shape: CollisionShape,
        friction: tuple[float, float],
        bits: tuple[int, int],
        *,
        solid: bool = False,
    ) -> Any:
        import mujoco

        kind = shape.geometry.kind
        dimensions = SPINNING if friction[1] == PAD_SPIN else SLIDING
        if bits[1] and kind in ("sphere", "cylinder"):
            dimensions = ROLLING
        geom = frame.add_geom(
            name=str(len(self.bits)),
            type=mujoco.mjtGeom(KINDS[kind]),
            pos=T[:3, :3] @ shape.middle + T[:3, 3],
            quat=so3.to_quaternion(T[:3, :3]),
            # Set after the compilation, which makes the hull of each mesh that can meet another.
            contype=0,
            conaffinity=0,
            condim=dimensions,
            friction=(*friction, ROLLING_FRICTION),
        )
        geom.solref[:2] = CONTACT_TIME, CONTACT_DAMPING
        geom.solimp[:5] = CONTACT_STIFFNESS
        self.bits.append(bits)
        if kind == "hull":
            geom.meshname = self._mesh(shape, solid=solid)
        else:
            geom.size = (0.0, 0.0, 1.0) if kind == "half-space" else shape.geometry.size
        return geom

    def _mesh(self, shape: CollisionShape, *, solid: bool) -> str:
        """Return the name of the mesh of ``shape``; one that is not ``solid`` has no inertia."""
        import mujoco

        key = shape.mark, solid
        if key not in self._meshes:
            self._meshes[key] = name = f"mesh {len(self._meshes)}"
            vertices = shape.geometry.vertices
            mesh = self._spec.add_mesh(name=name, uservert=vertices.ravel())
            if not solid:
                # Without the hull the compilation takes a twentieth of the time.
                mesh.userface = _triangle(vertices)
                mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        return self._meshes[key]

    def set_meetings(self, compiled: Any) -> tuple[str, ...]:
        """Set what each geometry of the ``compiled`` model meets; return whose each is."""
        owners = [""] * len(self.bits)
        for number, (kind, meets) in enumerate(self.bits):
            geom = compiled.geom(str(number)).id
            body = compiled.geom_bodyid[geom]
            compiled.geom_contype[geom], compiled.geom_conaffinity[geom] = kind, meets
            compiled.body_contype[body] |= kind
            compiled.body_conaffinity[body] |= meets
            owners[geom] = self.owners[number]
        return tuple(owners)


def _add_joint(frame: Any, joint: BodyJoint, name: str) -> None:
    """Let the body of ``frame`` move by ``joint``, whose friction and ends are hard contacts."""
    import mujoco

    kinds, ends = mujoco.mjtJoint, (joint.lower, joint.upper)
    frame.pos = joint.point
    added = frame.add_joint(
        name=name,
        type=kinds.mjJNT_SLIDE if joint.slides else kinds.mjJNT_HINGE,
        axis=joint.axis,
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        range=ends if joint.slides else np.degrees(ends),
        frictionloss=joint.friction,
    )
    added.damping[0] = joint.damping
    for values, damping in ((added.solref_friction, 1.0), (added.solref_limit, CONTACT_DAMPING)):
        values[:2] = CONTACT_TIME, damping
    added.solimp_friction[:5] = added.solimp_limit[:5] = CONTACT_STIFFNESS


def _shifted(T: FloatArray, origin: FloatArray) -> FloatArray:
    """Return the pose ``T`` (4, 4) seen from ``origin`` (3,)."""
    shifted = T.copy()
    shifted[:3, 3] -= origin
    return shifted


def _joint(group: int) -> str:
    return f"joint {group}"


def _triangle(vertices: FloatArray) -> Any:
    """Return both sides (6,) of a large triangle of ``vertices`` (n, 3), as their indices."""
    edges = vertices - vertices[0]
    second = int(np.einsum("ij,ij->i", edges, edges).argmax())
    normals = np.cross(edges, edges[second])
    third = int(np.einsum("ij,ij->i", normals, normals).argmax())
    return np.array((0, second, third, 0, third, second))
