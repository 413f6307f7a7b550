"""One tick of motion towards the goal, under every limit and clear of every contact.

A step is taken only if the arm can still stop in time: its whole path to rest must be clear. So
the arm comes to rest before an obstacle, with the same brake that a stop uses.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from katana450.arm.control.arm import ArmModel, JointSet
from katana450.arm.control.session.goals import with_place
from katana450.arm.control.session.plan_follower import PlanFollower
from katana450.arm.control.state.modes import Following, Leaving
from katana450.arm.control.state.state import Finding, Reason, State
from katana450.arm.control.tool_kinematics import ELBOW, ToolKinematics
from katana450.maths.collision.clearance import (
    MIN_CLEARANCE,
    MIN_STOP_TIME,
    advance,
    is_surely_clear,
)
from katana450.maths.collision.engine import Contact
from katana450.maths.collision.world import MAX_PATH_LENGTH, CollisionWorld
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.velocity import JogFrame, coasted, jog
from katana450.maths.motion.elbow import ElbowBrake, elbow_moved
from katana450.maths.motion.limiter import (
    LIMIT_TOLERANCE,
    STILL,
    JointMotion,
    Limiter,
    Limits,
    in_proportion,
)
from katana450.maths.motion.stream import stream_step

PROBE_LENGTH = 0.02
"""[rad] Length of path that must be clear before a waiting arm continues. After a shorter probe the
arm would only come back to where it was."""


def met_before_rest(
    world: CollisionWorld, limiter: Limiter | ElbowBrake, x: FloatArray, next_motion: JointMotion
) -> Contact | None:
    """Return the contact on the path to ``next_motion`` and on to rest; None if it is clear.

    x: (k,) the joints (n,), followed by what stays as it is [rad or m]. The distance in the contact
    is that at ``x``.
    """
    joints, others = x[: next_motion.q.size], x[next_motion.q.size :]
    lower, upper = limiter.stopping_range(next_motion)
    reach = np.maximum(np.abs(lower - joints), np.abs(upper - joints))
    still = np.zeros(others.size)
    if is_surely_clear(world, x, np.append(reach, still)):
        return None
    pieces = limiter.stopping_path(
        next_motion, MAX_PATH_LENGTH, lambda change: world.linkage.turned(np.append(change, still))
    )
    place = np.append(next_motion.q, others)
    step = advance(world, x, place, MIN_STOP_TIME)
    for piece in pieces:
        if step.contact is not None or step.stopped:
            break
        curve = piece.beside(others)
        end = curve.place(1.0)
        step = advance(world, place, end, MIN_STOP_TIME, curve=curve)
        place = end
    if step.contact is None and not step.stopped:
        return None
    return world.nearest(x) if step.contact is None else measured(world, step.contact, x)


def measured(world: CollisionWorld, contact: Contact, x: FloatArray) -> Contact:
    """Return ``contact`` with the distance of its parts at ``x`` (k,) [rad or m]."""
    return replace(contact, distance=world.gap(x, *contact.parts))


def may_go_on(world: CollisionWorld, state: State) -> bool:
    """Return whether the first part of the straight path of a waiting arm to its goal is clear."""
    change = state.goal - state.setpoint
    if not change.any():
        return True
    fraction = min(1.0, PROBE_LENGTH / float(np.abs(change).sum()))
    x = state.x_setpoint
    towards = np.append(state.setpoint + fraction * change, state.gripper_setpoint)
    step = advance(world, x, towards, MIN_STOP_TIME)
    return bool((step.x == towards).all())


def with_distance(world: CollisionWorld, state: State) -> State:
    """Return ``state`` with the present distance in the contact that the arm brakes for."""
    x = state.x_setpoint
    findings = tuple(
        replace(finding, amount=world.gap(x, *finding.parts))
        if finding.reason is Reason.CONTACT and finding.parts is not None
        else finding
        for finding in state.findings
    )
    return replace(state, findings=findings)


def with_contact(state: State, contact: Contact | None) -> State:
    """Return ``state`` with ``contact`` as its first finding, in place of any earlier contact."""
    others = tuple(finding for finding in state.findings if finding.reason is not Reason.CONTACT)
    if contact is None:
        return state if others == state.findings else replace(state, findings=others)
    finding = Finding(Reason.CONTACT, contact.distance, parts=contact.parts)
    return replace(state, findings=(finding, *others))


PLANNED_SPEED_FRACTION = 0.9
"""[1] Fraction of the maximum tool speed that a step is planned with: the same joint speeds may
move the tool faster at the next posture."""

SLOWDOWN_TIME = 0.3
"""[s] Approximate time to slow down by as much as the tool speeds up on a bend."""

MAX_SLOWDOWNS = 4
"""Maximum number of slower attempts at a step in which the tool would be too fast."""

BRAKE_SPEED_FRACTION = 0.97
"""[1] Fraction of the maximum tool speed that is allowed in the samples of a brake. Between the
samples the tool may be faster."""

COARSE_SAMPLING, FINE_SAMPLING = 0.02, 0.005
"""[s] Minimum time between samples of a brake. The coarse value is for steps, of which there are
many; the fine one is for the one decision to leave a plan."""

Travel = Callable[[FloatArray, FloatArray], float]
"""The distance [m] that the links travel between two joint vectors (n,)."""


def no_travel(_q: FloatArray, _to: FloatArray) -> float:
    """Return 0 m, the travel of links whose lengths are unknown."""
    return 0.0


class MotionStepper:
    """Moves the setpoints of one robot, tick by tick. Its methods are pure.

    Joints without a tool move under the same rules, but for those about the tool.
    """

    def __init__(
        self,
        robot: ArmModel | JointSet,
        world: CollisionWorld | None,
        tool_speed: float,
        touch: FloatArray | None = None,
        travel: Travel = no_travel,
    ) -> None:
        """Create the stepper.

        Args:
            robot: the arm, or the joints of a robot that is none.
            world: the collision world; None to check no contacts.
            tool_speed: maximum speed of the tool point [m/s].
            touch: (p,) minimum distance of each pair of bodies while the fingers move [m].
            travel: of the links of joints without a tool.
        """
        self._arm = robot.arm
        self._travel = travel
        self._gripper = robot.gripper
        self._world = world
        self._touch = touch
        # Pairs that the fingers may touch: such a contact makes no finding.
        self._touching: frozenset[frozenset[str]] = frozenset()
        if world is not None and touch is not None:
            names = [world.parts[number].name for number in world.part_of.tolist()]
            soft = np.flatnonzero(touch < MIN_CLEARANCE).tolist()
            self._touching = frozenset(
                frozenset((names[world.first[pair]], names[world.second[pair]])) for pair in soft
            )
        self._maximum = tool_speed
        self._tool_speed = PLANNED_SPEED_FRACTION * tool_speed
        self._follower = PlanFollower(world, slides=robot.gripper.slides)
        self._any = Limiter(robot.limits)
        branch_limits = (
            {} if self._arm is None else self._arm.kinematics.branch_limits(robot.limits)
        )
        self._elbow = {branch: Limiter(limits) for branch, limits in branch_limits.items()}

    def slowed(self, tool_speed: float) -> MotionStepper:
        """Return this stepper with a tool point that is at most as fast as ``tool_speed`` [m/s]."""
        if tool_speed >= self._maximum:
            return self
        stepper = copy.copy(self)
        stepper._maximum, stepper._tool_speed = tool_speed, PLANNED_SPEED_FRACTION * tool_speed
        return stepper

    def step(self, state: State, dt: float) -> State:
        """Return ``state`` with its setpoints advanced by ``dt`` [s]."""
        if dt <= 0.0:
            return state
        if not state.under_way:
            return replace(state, blocked=False) if state.blocked else state
        if isinstance(state.mode, Leaving) and self._free_to_leave(state):
            state = replace(state, mode=state.mode.then)
        fingers = self._fingers(state, dt)
        if state.blocked and state.motion.at_rest and self._may_go_on(state):
            state = replace(state, blocked=False)
        # A brake continues to rest: at the edge of the clear path the arm would only quiver.
        jogging = state.jogging
        braking = state.blocked and (jogging is None or jogging.turn is not None)
        next_motion, along = self._brake(state, dt) if braking else self._ahead(state, dt)
        if self._world is None:
            return with_place(replace(state, motion=next_motion, gripper_setpoint=fingers), along)
        contact = None if braking else self._met(state, next_motion, along, state.gripper_setpoint)
        if contact is not None:
            next_motion, along = self._brake(state, dt)
        hand = None
        if fingers != state.gripper_setpoint:
            next_x = np.append(next_motion.q, state.gripper_setpoint)
            hand = advance(self._world, next_x, np.append(next_motion.q, fingers), dt, self._touch)
            fingers = float(hand.x[-1])
            if (
                self._met(state, next_motion, along, fingers) is not None
                and not next_motion.at_rest
            ):
                fingers = state.gripper_setpoint
        at_rest = (
            state.motion.at_rest and next_motion.at_rest and (next_motion.q == state.setpoint).all()
        )
        pinched = bool(at_rest) and fingers == state.gripper_setpoint and hand is not None
        after = replace(
            state,
            motion=state.motion if at_rest else next_motion,
            mode=with_place(state, along).mode,
            gripper_setpoint=fingers,
            blocked=braking or contact is not None or pinched,
        )
        if braking:
            return with_distance(self._world, after)
        held_back = None if hand is None else hand.contact
        if held_back is not None and frozenset(held_back.parts) in self._touching:
            held_back = None
        return with_contact(after, contact or held_back)

    def limiter(self, state: State) -> Limiter:
        """Return the limiter that keeps the elbow on its branch.

        Returns the limiter without that bound if the motion starts or ends on another branch, or
        is too fast to stop on this one: a new goal can come while the elbow changes its branch.
        """
        limiter = self._elbow.get(state.branch)
        if limiter is None:
            return self._any
        limits = limiter.limits
        for q in (state.setpoint, state.goal):
            if not ((q >= limits.lower) & (q <= limits.upper)).all():
                return self._any
        return limiter if self._elbow_stops_inside(limits, state.motion) else self._any

    def _elbow_stops_inside(self, limits: Limits, motion: JointMotion) -> bool:
        """Return whether the elbow comes to rest inside ``limits`` if it brakes now."""
        q, qd, qdd = (float(values[ELBOW]) for values in (motion.q, motion.qd, motion.qdd))
        lower, upper = float(limits.lower[ELBOW]), float(limits.upper[ELBOW])
        acceleration, jerk = float(limits.acceleration[ELBOW]), float(limits.jerk[ELBOW])
        fastest = abs(qd) + qdd**2 / (2.0 * jerk)
        # The brake takes at most this time, so the elbow travels at most this far.
        if fastest * (fastest / acceleration + 2.0 * acceleration / jerk) <= min(
            q - lower, upper - q
        ):
            return True
        end = float(self._any.stopping_point(motion)[ELBOW])
        return lower - LIMIT_TOLERANCE <= end <= upper + LIMIT_TOLERANCE

    def stopping_point(self, state: State) -> tuple[FloatArray, float, float]:
        """Return the end of a brake begun now (n,) [rad or m], the travel [m], the time [s]."""
        motion, limits = state.motion, self._any.limits
        if state.following is not None:
            end = self._follower.stopping_point(state.following).motion().q
            time = self._follower.stopping_time(state.following)
        else:
            # A plan that ends at a limit may exceed it by rounding; such a goal is unreachable.
            end = np.clip(self._any.stopping_point(motion), limits.lower, limits.upper)
            time = self._any.stopping_time(motion)
        if self._arm is None:
            return frozen(end), self._travel(motion.q, end), time
        chain = self._arm.chain_to(state.tool)
        travel = math.dist(forward(chain, end)[:3, 3], forward(chain, motion.q)[:3, 3])
        return frozen(end), travel, time

    def may_leave(self, state: State) -> bool:
        """Return whether the robot may leave its plan and brake as hard as it can."""
        tool = self._tool(state)
        if state.motion.at_rest or tool is None:
            return True
        if not self._below(self._maximum, tool, state.motion, FINE_SAMPLING):
            return False
        return (
            self._world is None
            or self._met(state, state.motion, None, state.gripper_setpoint) is None
        )

    def _tool(self, state: State) -> ToolKinematics | None:
        return None if self._arm is None else self._arm.kinematics_to(state.tool)

    def _free_to_leave(self, state: State) -> bool:
        # The distance of a stop has been reported, so the stop ends as it began.
        return state.motion.at_rest or (state.stopped is None and self.may_leave(state))

    def _ahead(self, state: State, dt: float) -> tuple[JointMotion, Following | None]:
        """Return the next motion, and the place on the plan if one is followed."""
        following = state.following
        if following is None:
            return self._beside(state, dt), None
        if state.stopped is not None or state.paused or isinstance(state.mode, Leaving):
            return self._brake(state, dt)
        next_place = self._follower.ahead(following, dt, state.speed)
        return next_place.motion(), next_place

    def _beside(self, state: State, dt: float) -> JointMotion:
        """Return the next motion of an arm that follows no plan.

        After every step the arm can brake with the tool below its maximum speed all the time. If no
        step towards the goal allows this, the arm brakes.
        """
        limiter, motion = self.limiter(state), state.motion
        if state.stopped is not None:
            return self._any.stop(motion, dt)
        tool = self._tool(state)
        if state.paused and state.jogging is None:
            pause = limiter.pause(motion, state.goal, dt)
            return pause if tool is None else self._slow_or_braking(tool, motion, pause, dt)
        if tool is None:
            return self._towards(limiter, state, dt, state.speed)
        fraction = min(state.speed, self._fraction(tool, state))
        rates, jogging = None, state.jogging
        turns_elbow = jogging is not None and jogging.kept is not None
        if jogging is not None and not turns_elbow:
            chain = tool.chain
            q = chain.clamp(motion.q + dt * motion.qd)
            V = tool.jog_twist(q, jogging.rates, jogging.frame) * (not state.paused)
            low, high = self._any.stoppable(q)
            rates = jog(chain, q, V, JogFrame.BASE, dt, bounds=(low, high))
            steady = coasted(chain, motion.q, motion.qd, dt)
            # Joints that their limits slow move one by one.
            free = (rates > low) & (rates < high) | (np.abs(steady) < STILL)
        for _ in range(MAX_SLOWDOWNS):
            if turns_elbow:
                next_motion = self._with_elbow(tool.chain, state, fraction, dt)
            elif rates is not None:
                wanted = fraction * rates
                straight = free.all() and in_proportion(self._any, motion, steady, wanted, dt)
                next_motion = straight or self._any.at_rate(motion, wanted, dt)
            else:
                next_motion = self._towards(limiter, state, dt, fraction)
            speed = tool.tool_speed(next_motion.q, next_motion.qd)
            enough = max(self._tool_speed, tool.tool_speed(motion.q, motion.qd))
            if speed <= enough and self._slow_to_rest(tool, next_motion):
                return next_motion
            fraction *= 0.9 * min(1.0, self._tool_speed / speed)
        return self._slow_or_braking(tool, motion, next_motion, dt)

    def _with_elbow(self, chain: Chain, state: State, fraction: float, dt: float) -> JointMotion:
        """Return the next motion of an arm that moves its elbow while its tool rests."""
        jogging, motion = state.jogging, state.motion
        assert jogging is not None
        assert jogging.kept is not None
        rate = 0.0 if state.paused else fraction * jogging.elbow_rate
        angle = math.inf if jogging.turn is None else abs(jogging.turn)
        moved = elbow_moved(chain, self._any.limits, motion, jogging.kept, rate, angle, dt)
        return self._any.stop(motion, dt) if moved is None else moved

    @staticmethod
    def _towards(limiter: Limiter, state: State, dt: float, fraction: float) -> JointMotion:
        """Return the next motion to the goal or along the stream, at a fraction of the speeds."""
        if state.servo is not None:
            return stream_step(limiter, state.motion, state.servo, state.t, dt, fraction)
        return limiter.towards(state.motion, state.goal, dt, fraction)

    def _slow_or_braking(
        self, tool: ToolKinematics, now: JointMotion, next_motion: JointMotion, dt: float
    ) -> JointMotion:
        return next_motion if self._slow_to_rest(tool, next_motion) else self._any.stop(now, dt)

    def _slow_to_rest(self, tool: ToolKinematics, motion: JointMotion) -> bool:
        """Return whether the tool stays below its maximum speed if every joint brakes now."""
        return self._below(BRAKE_SPEED_FRACTION * self._maximum, tool, motion, COARSE_SAMPLING)

    def _below(
        self, maximum: float, tool: ToolKinematics, motion: JointMotion, spacing: float
    ) -> bool:
        """Return whether the tool stays below ``maximum`` [m/s] in samples of a brake begun now.

        The samples are at least ``spacing`` [s] apart, and farther where the tool needs longer to
        become so fast.
        """
        fastest = self._any.fastest(motion)
        if tool.tool_speed_bound(fastest) <= maximum:
            return True
        limits = self._any.limits
        # Joints that brake also turn the tool about each other's axes, which can speed it up.
        pull = tool.tool_speed_bound(limits.acceleration + fastest * float(fastest.sum()))
        rising = float((np.abs(motion.qdd) / limits.jerk).max())
        end, duration = self._any.braking(motion)
        t, braking = 0.0, motion
        while (speed := tool.tool_speed(braking.q, braking.qd)) <= maximum:
            t += max(spacing, (maximum - speed) / pull)
            if t >= duration:
                return True
            braking = end(t)
            # Slow joints cannot make the tool too fast in any posture.
            if t > rising and tool.tool_speed_bound(braking.qd) <= maximum:
                return True
        return False

    def _brake(self, state: State, dt: float) -> tuple[JointMotion, Following | None]:
        """Return the same step to rest that the tick before found clear."""
        if state.following is None:
            return self._elbow_braking(state, dt) or self.limiter(state).stop(
                state.motion, dt
            ), None
        along = self._follower.braking(state.following, dt)
        return along.motion(), along

    def _elbow_brake(self, state: State) -> ElbowBrake | None:
        """Return the brake of an elbow that moves while the tool rests; None if it does not."""
        jogging, tool = state.jogging, self._tool(state)
        if tool is None or jogging is None or jogging.kept is None:
            return None
        return ElbowBrake(tool.chain, self._any.limits, jogging.kept)

    def _elbow_braking(self, state: State, dt: float) -> JointMotion | None:
        """Return the next motion of an elbow that comes to rest and keeps its tool.

        None without one from which the joints, each by itself, have a clear path to rest.
        """
        brake = self._elbow_brake(state)
        if brake is None:
            return None
        moved = elbow_moved(brake.chain, brake.limits, state.motion, brake.T, 0.0, 0.0, dt)
        if moved is None or self._world is None:
            return moved
        x = np.append(state.setpoint, state.gripper_setpoint)
        contact = met_before_rest(self._world, self.limiter(state), x, moved)
        return moved if contact is None else None

    def _fraction(self, tool: ToolKinematics, state: State) -> float:
        """Return the fraction of the joint speeds at which the tool keeps its limit to the goal."""
        change, chain = state.goal - state.setpoint, tool.chain
        if state.jogging is not None or state.servo is not None or not change.any():
            return 1.0
        fastest = change / float(np.max(np.abs(change) / chain.speed))
        # The tool may be farther out at the place where the arm can have slowed down.
        soon = np.clip(state.setpoint + SLOWDOWN_TIME * state.motion.qd, chain.lower, chain.upper)
        speed = max(tool.tool_speed(q, fastest) for q in (state.setpoint, soon))
        return min(1.0, self._tool_speed / speed) if speed > 0.0 else 1.0

    def _fingers(self, state: State, dt: float) -> float:
        reach = self._gripper.speed * dt
        if state.stopped is not None or state.paused:
            return state.gripper_setpoint
        return state.gripper_setpoint + min(
            max(state.gripper_goal - state.gripper_setpoint, -reach), reach
        )

    def _met(
        self, state: State, next_motion: JointMotion, along: Following | None, fingers: float
    ) -> Contact | None:
        """Return the contact on the path to ``next_motion`` and on to rest; None if it is clear."""
        assert self._world is not None
        if state.following is not None and along is not None:
            contact = self._follower.met(state.following, along, fingers)
            if contact is None:
                return None
            return measured(self._world, contact, np.append(state.setpoint, fingers))
        x = np.append(state.setpoint, fingers)
        contact = met_before_rest(self._world, self.limiter(state), x, next_motion)
        brake = self._elbow_brake(state)
        # The elbow comes to rest with the tool at its pose, and on STOP each joint by itself.
        if contact is not None or brake is None:
            return contact
        return met_before_rest(self._world, brake, x, next_motion)

    def _may_go_on(self, state: State) -> bool:
        """Return whether the first part of the path of a waiting arm is clear again."""
        assert self._world is not None
        if state.following is not None:
            return self._follower.may_go_on(state.following, state.gripper_setpoint)
        return may_go_on(self._world, state)
