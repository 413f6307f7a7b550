"""The motion of free bodies around an arm, one tick after the other.

A step is a pure function: all that MuJoCo remembers is in the motion of the bodies.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from katana450.maths.collision.engine import addresses, library, silence
from katana450.maths.collision.linkage import Linkage
from katana450.maths.collision.world import Part
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import BoolArray, FloatArray, frozen
from katana450.maths.physics.model import (
    BODY,
    LINK,
    LINK_MASS,
    REST_TIME,
    SLIP_STEPS,
    STEP,
    BodyMotion,
    FingerContact,
    FingerDrive,
    RigidBody,
    compile_model,
    inside_of,
    pose_at,
    radius_of,
)
from katana450.maths.physics.suction import Seal, SuctionCup, gap_of, pull

SLOW = 5e-3
"""[m/s, and 10 times as many rad/s] Speed below which a body is slow."""

WAKING_RATIO = 2.0
"""[1] Speed of a body that wakes others, as a ratio to SLOW."""

DEEP = 1e-3
"""[m] Depth from which bodies overlap because they were put into each other."""

PARTING_SPEED = 0.2
"""[m/s, and 10 times as many rad/s] Maximum speed of bodies that overlap: they part slowly."""

CROWD = 1
"""[1] Number of others that a body may overlap with its inside. In a denser heap it moves away from
them without contact, because the number of contacts grows with the square of that of the bodies."""

GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
"""[rad] Angle whose multiples are spread evenly."""

MANY, HEAP_STEP = 12, 2e-3
"""[1, s] Number of bodies in motion beyond which the steps are longer, so that the arm's control
does not wait for a heap."""

CREEP_SPEED, CREEP_TIME = 0.02, 0.02
"""[m/s, and 10 times as many rad/s; s] Speed below which a body of many in motion loses it within
about this time. The inexact forces in a heap would move its bodies without end."""

MANY_CONTACTS, HEAP_ITERATIONS = 200, 50
"""[1, 1] Number of contacts beyond which their forces are found in so many iterations of a simple
search, and so they are also between bodies that overlap deeply."""

WAKING_DISTANCE = 5e-3
"""[m] Distance between the balls round two bodies from which the faster one wakes the other."""

MAX_BRAKING, IMPACT_RATIO = 40.0, 0.3
"""[m/s^2, 1] Deceleration that friction aims at, and that for each of the impact. Friction gives
less, and with much more a sliding body hops."""

SLIDING_SPEED = 0.02
"""[m/s] Speed below which a contact may stop at once."""

MAX_SPEED = 10.0
"""[m/s] Maximum speed of a body."""


Rates = tuple[FloatArray, FloatArray]

ASIDE = 1e-3
"""[rad or m] Distance of a finger from its setpoint from which its drive brings it back."""

DIFFERENCE = 1e-4
"""[s] Time of a motion of the links that shows their speed."""


class _Links(NamedTuple):
    """Links: position and quaternion of each (l, 7), and their twists (l, 6) [m/s, rad/s]."""

    places: FloatArray
    twists: FloatArray


class BodySimulation:
    """Free bodies around one arm."""

    def __init__(
        self,
        linkage: Linkage,
        parts: Sequence[Part],
        bodies: Sequence[RigidBody],
        drive: FingerDrive | SuctionCup | None = None,
    ) -> None:
        """Compile the model, which takes some milliseconds. See ``compile_model``."""
        import mujoco

        self._linkage, self._drive = linkage, drive
        self._model = compile_model(linkage, parts, bodies, drive)
        self._compiled = self._model.compiled
        self._data = mujoco.MjData(self._compiled)
        self._first_half, self._second_half = library().mj_step1, library().mj_step2
        self._addresses = addresses(self._compiled, self._data)
        warnings = mujoco.mjtWarning
        self._full = [int(warnings.mjWARN_CONTACTFULL), int(warnings.mjWARN_CNSTRFULL)]
        option, solver = self._compiled.opt, int(mujoco.mjtSolver.mjSOL_CG)
        self._quick = {"solver": solver, "iterations": HEAP_ITERATIONS}
        self._exact = {name: getattr(option, name) for name in self._quick}
        self._is_quick = False
        self._names = tuple(body.name for body in bodies)
        self._joints = [body.joint for body in bodies if body.joint is not None]
        self._free = free = len(bodies) - len(self._joints)
        slides = np.array([joint.slides for joint in self._joints], dtype=bool)
        self._joint_limits = np.where(slides, MAX_SPEED, 10.0 * MAX_SPEED)
        # The number of the body of a suction cup, and where the values of the links begin.
        self._cup = 0
        if isinstance(drive, SuctionCup):
            self._cup = 1 + len(bodies) + self._model.links.index(drive.palm)
        self._link_q, self._link_v = 7 * free + len(self._joints), 6 * free + len(self._joints)
        self._bodies_of = {owner: body.name for body in bodies for owner in body.owners}
        self._radii = np.array([radius_of(body) for body in bodies])
        self._insides = [inside_of(body) for body in bodies]
        self._resting = self._parting = np.zeros(len(bodies), dtype=bool)
        # Views of the model, the values of a body at rest, and those of the bodies themselves.
        model, every = self._compiled, slice(1, 1 + len(bodies))
        light, owner = 1.0 / LINK_MASS, model.dof_bodyid[: self._link_v] - 1
        self._masses = [
            (view, heavy, view.copy(), body)
            for view, heavy, body in (
                (model.body_mass[every], LINK_MASS, ...),
                (model.body_inertia[every], LINK_MASS, ...),
                (model.body_gravcomp[every], 1.0, ...),
                (model.body_invweight0[every], light, ...),
                (model.dof_invweight0[: self._link_v], light, owner),
                (model.dof_M0[: self._link_v], LINK_MASS, owner),
            )
        ]

    def begin(
        self,
        poses: Mapping[str, FloatArray],
        motion: BodyMotion | None,
        moved: Collection[str],
        woken: Collection[str],
    ) -> BodyMotion:
        """Return the motion of the bodies of this simulation.

        Args:
            poses: pose (4, 4) of each body in the base frame.
            motion: the last motion, perhaps of other bodies; None if all are at rest.
            moved: bodies that begin without speed at their poses, as others that ``motion`` lacks.
            woken: bodies that are no longer at rest.
        """
        count = self._compiled.nv
        same = motion is not None and (motion.names, len(motion.memory)) == (self._names, count)
        if motion is not None and same and not moved and not woken:
            return motion
        rows = []
        for name in self._names:
            if motion is None or name in moved or name not in motion.names:
                place, velocity, rest_time = _place(poses[name]), np.zeros(6), REST_TIME
            else:
                number = motion.names.index(name)
                place, velocity = motion.place[number], motion.velocity[number]
                rest_time = float(motion.rest_time[number])
            rows.append((place, velocity, 0.0 if name in woken else rest_time))
        places, velocities, rest_times = (np.array(column) for column in zip(*rows, strict=True))
        memory = np.zeros(count)
        start = BodyMotion(
            self._names, frozen(places), frozen(velocities), frozen(memory), frozen(rest_times)
        )
        if motion is None:
            return start
        return replace(start, fingers=motion.fingers, contacts=motion.contacts)

    def step(
        self,
        motion: BodyMotion,
        x: FloatArray,
        towards: FloatArray,
        dt: float,
        rates: Rates | None = None,
        grasp: float | None = None,
        *,
        suction: str | None = None,
    ) -> BodyMotion:
        """Return the motion after ``dt`` [s], in which the arm moves from ``x`` to ``towards``.

        Bodies for which the engine finds no motion stay where they were.

        x, towards: (k,) [rad or m].
        rates: velocities (k,) at ``x`` and at ``towards`` [rad/s or m/s]; None for even speed.
        grasp: goal of the drive of the fingers while they touch a body [rad or m]; None for that of
            ``towards``.
        suction: the object that a suction cup holds; "" for none, None while it is off.
        """
        data, count = self._data, len(self._names)
        motion = self._with_woken(motion, dt)
        # What the fingers touch can be moved by them at any time.
        names = [contact.body for contact in motion.contacts] + [suction or ""]
        touched = {self._bodies_of.get(name, name) for name in names}
        resting = motion.resting & [name not in touched for name in self._names]
        many = bool(np.count_nonzero(~resting) > MANY)
        ways = dt * PARTING_SPEED * self._crowding(motion) if many else np.zeros((count, 3))
        parting = np.asarray(ways.any(axis=1))
        self._fix(resting, parting)
        # The first half of a step prepares what these iterations need, so both halves have as many.
        # What is held needs them also beside a heap.
        self._compiled.opt.noslip_iterations = 0 if many and not touched else SLIP_STEPS
        longest = HEAP_STEP if many else STEP
        steps = max(1, math.ceil(dt / longest - 1e-9))
        self._compiled.opt.timestep = h = dt / steps
        self._place_bodies(motion)
        self._place_links(x, towards, rates, dt, h)
        goals = self._drive_goals(motion, x, towards, dt, grasp, steps)
        data.qacc_warmstart[:] = motion.memory
        data.xfrc_applied[:] = 0.0
        lost = not self._advance(goals, suction or "", many=many)
        place, velocity = self._bodies()
        if lost:
            place, velocity = motion.place, np.zeros((count, 6))
            data.qacc_warmstart[:] = 0.0
        still = (resting | parting)[:, None]
        place = np.where(still, motion.place, place)
        place[:, :3] += ways
        velocity = np.where(still, 0.0, velocity)
        if many:
            creeps = _is_slow(velocity, CREEP_SPEED)[:, None]
            velocity = np.where(creeps, velocity * max(0.0, 1.0 - dt / CREEP_TIME), velocity)
        rest_time = np.where(_is_slow(velocity, SLOW), motion.rest_time + dt, 0.0)
        rest_time[parting] = 0.0
        # A body waits for those beside it, because its fall asleep jolts what leans on it.
        ready = rest_time >= REST_TIME
        waits = ready & ~resting & (self._beside(place) & ~ready).any(axis=1)
        rest_time = np.where(waits, motion.rest_time, rest_time)
        memory = data.qacc_warmstart.copy()
        contacts = () if lost else self._contacts()
        fingers = np.empty((0, 2)) if lost else self._fingers(towards, is_touching=bool(contacts))
        return BodyMotion(
            motion.names,
            frozen(place),
            frozen(velocity),
            frozen(memory),
            frozen(rest_time),
            frozen(fingers),
            contacts,
            None if suction is None or lost else self._seal(suction, contacts),
        )

    def _advance(self, goals: FloatArray, held: str, *, many: bool) -> bool:
        """Let the engine make a step for each of the ``goals``; return False without a motion.

        ``held``: the object that a suction cup holds; "" for none.
        """
        pulled = self._names.index(self._bodies_of.get(held, held)) + 1 if held else 0
        data, count = self._data, self._free
        data.time = 0.0
        data.warning.number[:] = 0
        with silence():
            for goal in goals:
                data.ctrl[:] = goal
                before = data.qpos[: 7 * count].reshape(-1, 7).copy()
                self._first_half(*self._addresses)
                # The engine ends the process if the second half lacks memory.
                if data.parena > data.narena // 2 or data.warning.number[self._full].any():
                    return False
                deep = self._deep()
                quick = data.ncon > MANY_CONTACTS or (many and deep.any())
                self._choose_solver(quick=bool(quick))
                self._limit_friction()
                if pulled and isinstance(self._drive, SuctionCup):
                    pull(data, self._drive, self._cup, pulled)
                self._second_half(*self._addresses)
                if not (np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all()):
                    return False
                self._slow_down(before, deep)
        return True

    def _with_woken(self, motion: BodyMotion, dt: float) -> BodyMotion:
        """Return ``motion`` with the bodies awake that a faster one can reach in ``dt`` [s]."""
        resting, fast = motion.resting, ~_is_slow(motion.velocity, WAKING_RATIO * SLOW)
        if not (resting.any() and fast.any()):
            return motion
        ways = dt * np.linalg.norm(motion.velocity[:, :3], axis=1)
        woken = resting & (self._beside(motion.place, ways)[:, fast]).any(axis=1)
        return replace(motion, rest_time=frozen(np.where(woken, 0.0, motion.rest_time)))

    def _beside(self, place: FloatArray, ways: FloatArray | float = 0.0) -> BoolArray:
        """Return whether two bodies are near each other, (b, b); the second has its way to go."""
        middle = place[:, :3]
        apart = np.linalg.norm(middle[:, None] - middle, axis=2)
        return np.asarray(apart < self._radii[:, None] + self._radii + WAKING_DISTANCE + ways)

    def _crowding(self, motion: BodyMotion) -> FloatArray:
        """Return the directions (b, 3) in which bodies leave a dense heap; zero for all others.

        They lead aside and up, so that none leads into the table.
        """
        middles = np.array(
            [
                place[:3] + so3.from_quaternion(place[3:]) @ middle
                for place, (middle, _) in zip(motion.place, self._insides, strict=True)
            ]
        )
        radii = np.array([radius for _, radius in self._insides])
        apart = middles[:, None] - middles
        overlaps = np.linalg.norm(apart, axis=2) < radii[:, None] + radii
        crowded = (overlaps.sum(axis=1) > 1 + CROWD) & ~motion.resting
        crowded[self._free :] = False
        # Bodies with the same middle leave it in different directions.
        angles = GOLDEN_ANGLE * np.arange(len(radii))
        ways = np.column_stack((np.cos(angles), np.sin(angles), np.ones(len(radii)))) * SLOW
        ways += (apart * overlaps[:, :, None]).sum(axis=1)
        ways[:, 2] = np.abs(ways[:, 2])
        return np.where(crowded[:, None], ways / np.linalg.norm(ways, axis=1)[:, None], 0.0)

    def _choose_solver(self, *, quick: bool) -> None:
        """Choose how exact the forces between bodies are."""
        if quick is not self._is_quick:
            self._is_quick = quick
            for name, value in (self._quick if quick else self._exact).items():
                setattr(self._compiled.opt, name, value)

    def _fix(self, resting: BoolArray, parting: BoolArray) -> None:
        """Make the bodies at rest heavy, so that nothing moves them, and let them meet no other.

        Those that are ``parting`` from others are not met by others either.
        """
        if (resting == self._resting).all() and (parting == self._parting).all():
            return
        self._resting, self._parting = resting, parting
        model = self._compiled
        bodies = np.arange(1, 1 + len(resting))
        for values, heavy, ours, body in self._masses:
            mask = (resting | parting)[body].reshape(-1, *(1,) * (ours.ndim - 1))
            values[: len(ours)] = np.where(mask, heavy, ours)
        ours = np.where(np.arange(len(resting)) < self._free, LINK | BODY, LINK)
        meets = np.where(resting | parting, 0, ours)
        kinds = np.where(parting, 0, BODY)
        model.body_conaffinity[bodies], model.body_contype[bodies] = meets, kinds
        owners = model.geom_bodyid
        free = (owners >= 1) & (owners <= len(resting))
        owner = owners[free] - 1
        model.geom_conaffinity[free], model.geom_contype[free] = meets[owner], kinds[owner]

    def _place_bodies(self, motion: BodyMotion) -> None:
        """Put the bodies where they are in ``motion``."""
        q, v, free = self._data.qpos, self._data.qvel, self._free
        q[: 7 * free], v[: 6 * free] = motion.place[:free].ravel(), motion.velocity[:free].ravel()
        rows = zip(self._joints, motion.place[free:], motion.velocity[free:], strict=True)
        for number, (joint, place, velocity) in enumerate(rows):
            change = pose_at(place)
            change[:3, 3] -= joint.point
            q[7 * free + number] = joint.position(change)
            v[6 * free + number] = (
                velocity[:3] @ joint.axis if joint.slides else velocity[3:] @ joint.axis
            )

    def _bodies(self) -> tuple[FloatArray, FloatArray]:
        """Return places (b, 7) and velocities (b, 6) of the bodies; see ``BodyMotion``."""
        q, v, free = self._data.qpos, self._data.qvel, self._free
        place, velocity = q[: 7 * free].reshape(-1, 7), v[: 6 * free].reshape(-1, 6)
        if not self._joints:
            return place, velocity
        places, velocities = [*place], [*velocity]
        for number, joint in enumerate(self._joints):
            T, axis = joint.motion(float(q[7 * free + number])), np.array(joint.axis)
            T[:3, 3] += T[:3, :3] @ joint.point
            rate = float(v[6 * free + number]) * axis
            places.append(_place(T))
            velocities.append(
                np.append(rate, 0.0 * rate) if joint.slides else np.append(0.0 * rate, rate)
            )
        return np.array(places), np.array(velocities)

    def _place_links(
        self, x: FloatArray, towards: FloatArray, rates: Rates | None, dt: float, h: float
    ) -> None:
        """Put the links at ``x``, with the speeds and forces that lead them to ``towards``.

        With the forces of their acceleration, what a finger holds is accelerated in the same step;
        it would slip for a while after each jump of the speed.
        """
        if not self._model.links:
            return
        first_rate, last_rate = rates or ((towards - x) / dt,) * 2
        start, last = self._links(x, first_rate), self._links(towards, last_rate).twists
        place, first = start
        acceleration = (last - first) / dt
        data, links = self._data, len(place)
        q = data.qpos[self._link_q :][: 7 * links].reshape(-1, 7)
        v, force = (
            values[self._link_v :][: 6 * links].reshape(-1, 6)
            for values in (data.qvel, data.qfrc_applied)
        )
        # The engine moves by the speed at the end of a step.
        q[:], v[:], force[:] = place, first - 0.5 * h * acceleration, LINK_MASS * acceleration

    def _links(self, x: FloatArray, rate: FloatArray) -> _Links:
        """Return the links at ``x`` (k,), which changes by ``rate`` (k,) [rad/s or m/s]."""
        import mujoco

        links, origins = list(self._model.links), self._model.origins
        poses = self._linkage.poses(x)[links]
        places, twists = np.empty((len(poses), 7)), np.zeros((len(poses), 6))
        places[:, :3] = _points(poses, origins)
        for place, T in zip(places, poses, strict=True):
            mujoco.mju_mat2Quat(place[3:], T[:3, :3].ravel())
        if rate.any():
            later = self._linkage.poses(x + DIFFERENCE * rate)[links]
            turns = poses[:, :3, :3].swapaxes(1, 2) @ later[:, :3, :3]
            twists[:, :3] = (_points(later, origins) - places[:, :3]) / DIFFERENCE
            # The engine has the angular velocity in the frame of each link.
            hats = 0.5 * (turns - turns.swapaxes(1, 2)) / DIFFERENCE
            twists[:, 3:] = hats[:, (2, 0, 1), (1, 2, 0)]
        return _Links(places, twists)

    def _drive_goals(
        self,
        motion: BodyMotion,
        x: FloatArray,
        towards: FloatArray,
        dt: float,
        grasp: float | None,
        steps: int,
    ) -> FloatArray:
        """Put the fingers where they are, and return the goal of their drive in each step."""
        groups = list(self._model.fingers)
        if not groups:
            return np.zeros(steps)
        linkage, data, count = self._linkage, self._data, len(groups)
        factor, offset = linkage.factor[groups], linkage.offset[groups]
        variable = int(linkage.variable[groups[0]])
        start, end = float(x[variable]), float(towards[variable])
        if len(motion.fingers):
            data.qpos[-count:], data.qvel[-count:] = motion.fingers.T
        else:
            data.qpos[-count:] = factor * start + offset
            data.qvel[-count:] = factor * (end - start) / dt
        if grasp is not None:
            goals = np.full(steps, grasp)
        else:
            # Ahead of the setpoint by the time that the damping holds the fingers back.
            motor = self._compiled
            lead = float(motor.dof_damping[-count:].sum() / motor.actuator_gainprm[0, 0])
            times = dt * np.arange(1, steps + 1) / steps
            goals = start + (times + lead) * (end - start) / dt
        return np.asarray(factor[0] * goals + offset[0])

    def _fingers(self, x: FloatArray, *, is_touching: bool) -> FloatArray:
        """Return place and velocity (f, 2) of the fingers; (0, 2) if they are where ``x`` says.

        Fingers that touch a body, or were pushed aside by one, are not.
        """
        groups = list(self._model.fingers)
        if not groups:
            return np.empty((0, 2))
        count, linkage, data = len(groups), self._linkage, self._data
        place, velocity = data.qpos[-count:], data.qvel[-count:]
        setpoint = linkage.factor[groups] * x[linkage.variable[groups]] + linkage.offset[groups]
        if not is_touching and np.abs(place - setpoint).max() < ASIDE:
            return np.empty((0, 2))
        return np.column_stack((place, velocity))

    def finger_joint(self, motion: BodyMotion) -> float | None:
        """Return the finger joint [rad or m] that a body keeps from its setpoint; None without."""
        if not len(motion.fingers):
            return None
        first = self._model.fingers[0]
        place = float(motion.fingers[0, 0])
        return (place - float(self._linkage.offset[first])) / float(self._linkage.factor[first])

    def _contacts(self) -> tuple[FingerContact, ...]:
        """Return the contacts of the hand with bodies in the last step."""
        import mujoco

        data, owners = self._data, self._model.owners
        count = len(self._names)
        links = self._model.links
        if self._drive is None or not data.ncon:
            return ()
        bodies = self._compiled.geom_bodyid[data.contact.geom]
        hand = bodies > count + len(links)
        if self._drive.palm in links:
            hand |= bodies == 1 + count + links.index(self._drive.palm)
        free = (bodies > 0) & (bodies <= count)
        touches = hand.any(axis=1) & free.any(axis=1)
        sums: dict[tuple[str, str], FloatArray] = {}
        force = np.zeros(6)
        for number in np.flatnonzero(touches).tolist():
            contact = data.contact[number]
            mujoco.mj_contactForce(self._compiled, data, number, force)
            pair = sorted(zip(bodies[number].tolist(), contact.geom.tolist(), strict=True))
            body, finger = (owners[geom] for _, geom in pair)
            # The sum of the normal forces, and the vector of friction.
            friction = contact.frame.reshape(3, 3)[1:].T @ force[1:3]
            total = sums.setdefault((finger, body), np.zeros(4))
            total += force[0], *friction
        return tuple(
            FingerContact(*names, float(total[0]), float(np.linalg.norm(total[1:])))
            for names, total in sums.items()
        )

    def _seal(self, held: str, contacts: Sequence[FingerContact]) -> Seal | None:
        """Return how the suction cup stands on what it touches, or ``held``; None for nothing."""
        cup = self._drive
        if not (contacts or held) or not isinstance(cup, SuctionCup):
            return None
        geoms, gap = gap_of(self._compiled, self._data, cup, self._cup)
        item, owners = held or contacts[0].body, self._model.owners
        # A rim that reaches beyond the face is open.
        is_covered = min(geoms) >= 0 and {owners[geom] for geom in geoms} == {item}
        return Seal(item, gap if is_covered else 2.0 * cup.radius)

    def _limit_friction(self) -> None:
        """Limit the deceleration that friction aims at, because the engine adds it to the lift.

        A contact whose friction aims to end a fast slide in one step pushes the body off.
        """
        data = self._data
        if np.abs(data.efc_vel).max(initial=0.0) < SLIDING_SPEED:
            return
        aims, contact = data.efc_aref, data.contact
        normal = contact.efc_address[contact.efc_address >= 0]
        tangents = normal[:, None] + (1, 2)
        aim = aims[tangents]
        length = np.maximum(np.hypot(*aim.T), 1e-9)
        limit = MAX_BRAKING + IMPACT_RATIO * np.abs(aims[normal])
        aims[tangents] = aim * np.minimum(1.0, limit / length)[:, None]

    def _deep(self) -> BoolArray:
        """Return which bodies (b,) have contacts deeper than DEEP."""
        data, deep = self._data, np.zeros(len(self._names), dtype=bool)
        contact = data.contact
        if data.ncon and contact.dist.min() < -DEEP:
            bodies = self._compiled.geom_bodyid[contact.geom[contact.dist < -DEEP]].ravel() - 1
            deep[bodies[(bodies >= 0) & (bodies < len(deep))]] = True
        return deep

    def _slow_down(self, before: FloatArray, deep: BoolArray) -> None:
        """Limit the speeds of bodies that overlap deeply, and of all others.

        ``before``: (b, 7) their places before the step, which they leave no faster.
        """
        data, count, deep = self._data, self._free, deep[: self._free]
        if self._joints:
            speeds = data.qvel[6 * count : self._link_v]
            speeds[:] = np.clip(speeds, -self._joint_limits, self._joint_limits)
        v = data.qvel[: 6 * count].reshape(-1, 2, 3)
        # No velocity is longer than twice its largest part.
        if 2.0 * np.abs(v).max(initial=0.0) < (PARTING_SPEED if deep.any() else MAX_SPEED):
            return
        place = data.qpos[: 7 * count].reshape(-1, 7)
        limits = np.where(deep, PARTING_SPEED, MAX_SPEED)[:, None] * (1.0, 10.0)
        speeds = np.sqrt(np.einsum("bij,bij->bi", v, v))
        fast = (speeds > limits).any(axis=1)
        if not fast.any():
            return
        ratios = np.minimum(1.0, limits[fast] / np.maximum(speeds[fast], SLOW))
        v[fast] *= ratios[:, :, None]
        step = place[fast] - before[fast]
        place[fast] = before[fast] + step * ratios.repeat((3, 4), axis=1)
        place[fast, 3:] /= np.linalg.norm(place[fast, 3:], axis=1)[:, None]


def _points(poses: FloatArray, origins: FloatArray) -> FloatArray:
    """Return the points ``origins`` (l, 3) of links at ``poses`` (l, 4, 4) in the base frame."""
    return np.asarray(np.einsum("lij,lj->li", poses[:, :3, :3], origins) + poses[:, :3, 3])


def _is_slow(velocity: FloatArray, speed: float) -> BoolArray:
    """Return whether each row of ``velocity`` (b, 6) is below ``speed`` [m/s], (b,).

    Its angular velocity is below ten times as many rad/s.
    """
    speeds = np.abs(velocity)
    return np.asarray((speeds[:, :3].max(1) < speed) & (speeds[:, 3:].max(1) < 10.0 * speed))


def _place(T: FloatArray) -> FloatArray:
    return np.concatenate((T[:3, 3], so3.to_quaternion(T[:3, :3])))
