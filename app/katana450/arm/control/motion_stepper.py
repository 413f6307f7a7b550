"""The step of one tick: on towards the goal under every limit, and clear of every contact.

No step is taken from which the arm could not stop in time: its whole way to rest has to be clear.
So what stands in the way is met at rest, and the brake is the same that a stop uses.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.following import Following
from katana450.arm.control.goals import with_place
from katana450.arm.control.modes import Jogging, Leaving
from katana450.arm.control.plan_follower import PlanFollower
from katana450.arm.control.state import Finding, Reason, State
from katana450.maths.collision.clearance import MIN_STOP_TIME, STOP, advance, is_surely_clear
from katana450.maths.collision.contact import Contact
from katana450.maths.collision.world import MAX_PATH_LENGTH, CollisionWorld
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.freedoms import pitched_frame
from katana450.maths.kinematics.velocity import JogFrame, jog, tool_speed, tool_speed_bound
from katana450.maths.motion.limiter import JointMotion, Limiter, Limits
from katana450.maths.motion.pursuit import stream_step

PROBE = 0.02
"""[rad] An arm that waits goes on once the way is clear so far; from less it would only come back
to where it was."""

PLANNED_SPEED_FRACTION = 0.9
"""Of the tool's most, what is planned for: what is planned at one place is faster at the next."""

SLOWDOWN_TIME = 0.3
"""[s] About what it takes to slow down by as much as the tool gains on a bend."""

SLOWINGS = 4
"""How often a step is planned slower when the tool would be too fast."""

BRAKE_SPEED_FRACTION = 0.97
"""[1] Of the tool's most, what it keeps below in the samples of a brake: between them it may be
faster."""

COARSE, FINE = 0.02, 0.005
"""[s] Between them at least: for a step of many, and for leaving a plan, which is done once."""


class MotionStepper:
    """Moves the setpoints of one arm, tick by tick. Its methods are pure."""

    def __init__(
        self,
        arm: ArmModel,
        world: CollisionWorld | None,
        tool_speed: float,
        touch: FloatArray | None = None,
    ) -> None:
        """``world``: what must not be touched. ``tool_speed``: the most of the tool point [m/s].

        ``touch``: (p,) how far apart the pairs of bodies stay while the fingers move [m].
        """
        self._arm = arm
        self._world = world
        self._touch = touch
        # What the fingers are to touch holds them back, which is nothing to be told.
        self._touching: frozenset[frozenset[str]] = frozenset()
        if world is not None and touch is not None:
            names = [world.parts[number].name for number in world.part_of.tolist()]
            soft = np.flatnonzero(touch < STOP).tolist()
            self._touching = frozenset(
                frozenset((names[world.first[pair]], names[world.second[pair]])) for pair in soft
            )
        self._maximum = tool_speed
        self._tool_speed = PLANNED_SPEED_FRACTION * tool_speed
        self._follower = PlanFollower(world, slides=arm.gripper.slides)
        self._any = Limiter(arm.limits)
        self._elbow = {elbow: Limiter(_bent(arm, elbow)) for elbow in ("up", "down")}

    def step(self, state: State, dt: float) -> State:
        """``state`` with its setpoints moved on by ``dt`` [s]."""
        if dt <= 0.0:
            return state
        if not state.under_way:
            return replace(state, blocked=False) if state.blocked else state
        if isinstance(state.mode, Leaving) and self._free_to_leave(state):
            state = replace(state, mode=state.mode.then)
        fingers = self._fingers(state, dt)
        if state.blocked and state.motion.at_rest and self._may_go_on(state):
            state = replace(state, blocked=False)
        # Once it brakes it comes to rest: at the edge of what is clear it would only quiver.
        braking = state.blocked and state.jogging is None
        ahead, along = self._brake(state, dt) if braking else self._ahead(state, dt)
        if self._world is None:
            return with_place(replace(state, motion=ahead, gripper_setpoint=fingers), along)
        contact = None if braking else self._met(state, ahead, along, state.gripper_setpoint)
        if contact is not None:
            ahead, along = self._brake(state, dt)
        hand = None
        if fingers != state.gripper_setpoint:
            here = np.append(ahead.q, state.gripper_setpoint)
            hand = advance(self._world, here, np.append(ahead.q, fingers), dt, self._touch)
            fingers = float(hand.x[-1])
            if self._met(state, ahead, along, fingers) is not None and not ahead.at_rest:
                fingers = state.gripper_setpoint
        stands = state.motion.at_rest and ahead.at_rest and (ahead.q == state.setpoint).all()
        pinched = bool(stands) and fingers == state.gripper_setpoint and hand is not None
        after = replace(
            state,
            motion=state.motion if stands else ahead,
            mode=with_place(state, along).mode,
            gripper_setpoint=fingers,
            blocked=braking or contact is not None or pinched,
        )
        if braking:
            return self._updated(after)
        held_back = None if hand is None else hand.contact
        if held_back is not None and frozenset(held_back.parts) in self._touching:
            held_back = None
        return _told(after, contact or held_back)

    def limiter(self, state: State) -> Limiter:
        """That which keeps the elbow on its branch, unless the motion is from or to another one."""
        limiter = self._elbow[state.branch.elbow]
        limits = limiter.limits
        for q in (state.setpoint, state.goal):
            if not ((q >= limits.lower) & (q <= limits.upper)).all():
                return self._any
        return limiter

    def stopping_point(self, state: State) -> tuple[FloatArray, float, float]:
        """Where a brake begun now ends (n,) [rad], how far off the tool is then [m], and when."""
        motion, chain = state.motion, self._arm.chain_to(state.tool)
        if state.following is not None:
            end = self._follower.stopping_point(state.following).motion().q
            time = self._follower.stopping_time(state.following)
        else:
            # A plan that ends at a limit may miss it by rounding, and nobody could go there.
            end, time = (
                chain.clamp(self._any.stopping_point(motion)),
                self._any.stopping_time(motion),
            )
        way = math.dist(forward(chain, end)[:3, 3], forward(chain, motion.q)[:3, 3])
        return frozen(end), way, time

    def may_leave(self, state: State) -> bool:
        """Whether the arm may brake beside the plan it follows, as hard as it can."""
        if state.motion.at_rest:
            return True
        chain = self._arm.chain_to(state.tool)
        if not self._below(self._maximum, chain, state.motion, FINE):
            return False
        return (
            self._world is None
            or self._met(state, state.motion, None, state.gripper_setpoint) is None
        )

    def _free_to_leave(self, state: State) -> bool:
        # How far a stop takes has been said, so it goes on as it began.
        return state.motion.at_rest or (state.stopped is None and self.may_leave(state))

    def _ahead(self, state: State, dt: float) -> tuple[JointMotion, Following | None]:
        """The next motion, and the place on the plan if one is followed."""
        following = state.following
        if following is None:
            return self._beside(state, dt), None
        if state.stopped is not None or state.paused or isinstance(state.mode, Leaving):
            return self._brake(state, dt)
        ahead = self._follower.ahead(following, dt, state.speed)
        return ahead.motion(), ahead

    def _beside(self, state: State, dt: float) -> JointMotion:
        """The next motion of an arm that follows no plan.

        From every step the arm could brake with the tool below its most speed all the way: where no
        step towards the goal is such a one, this brake is what the arm does.
        """
        limiter, motion = self.limiter(state), state.motion
        if state.stopped is not None:
            return self._any.stop(motion, dt)
        chain = self._arm.chain_to(state.tool)
        if state.paused:
            pause = limiter.pause(motion, state.goal, dt)
            return self._slow_or_braking(chain, motion, pause, dt)
        fraction = min(state.speed, self._fraction(chain, state))
        rates = None
        if state.jogging is not None:
            V = wished_twist(chain, motion.q, state.jogging)
            bounds = self._any.stoppable(motion.q)
            rates = jog(chain, motion.q, V, JogFrame.BASE, dt, bounds=bounds)
        for _ in range(SLOWINGS):
            if rates is not None:
                ahead = self._any.at_rate(motion, fraction * rates, dt)
            elif state.servo is not None:
                ahead = stream_step(limiter, motion, state.servo, state.t, dt, fraction)
            else:
                ahead = limiter.towards(motion, state.goal, dt, fraction)
            speed = tool_speed(chain, ahead.q, ahead.qd)
            enough = max(self._tool_speed, tool_speed(chain, motion.q, motion.qd))
            if speed <= enough and self._slow_to_rest(chain, ahead):
                return ahead
            fraction *= 0.9 * min(1.0, self._tool_speed / speed)
        return self._slow_or_braking(chain, motion, ahead, dt)

    def _slow_or_braking(
        self, chain: Chain, now: JointMotion, ahead: JointMotion, dt: float
    ) -> JointMotion:
        return ahead if self._slow_to_rest(chain, ahead) else self._any.stop(now, dt)

    def _slow_to_rest(self, chain: Chain, motion: JointMotion) -> bool:
        """Whether the tool keeps below its most speed if every joint brakes now."""
        return self._below(BRAKE_SPEED_FRACTION * self._maximum, chain, motion, COARSE)

    def _below(self, maximum: float, chain: Chain, motion: JointMotion, spacing: float) -> bool:
        """Whether the tool keeps below ``most`` [m/s] in samples of a brake begun now.

        They are ``spacing`` [s] apart, or as long as the tool needs in any case to get as fast.
        """
        fastest = self._any.fastest(motion)
        if tool_speed_bound(chain, fastest) <= maximum:
            return True
        limits = self._any.limits
        # Braking, the joints turn the tool about each other's axes and slow it down or speed it up.
        pull = tool_speed_bound(chain, limits.acceleration + fastest * float(fastest.sum()))
        rising = float((np.abs(motion.qdd) / limits.jerk).max())
        at, duration = self._any.braking(motion)
        t, braking = 0.0, motion
        while (speed := tool_speed(chain, braking.q, braking.qd)) <= maximum:
            t += max(spacing, (maximum - speed) / pull)
            if t >= duration:
                return True
            braking = at(t)
            # Soon they are so slow that no posture can make the tool too fast.
            if t > rising and tool_speed_bound(chain, braking.qd) <= maximum:
                return True
        return False

    def _brake(self, state: State, dt: float) -> tuple[JointMotion, Following | None]:
        """The very way to rest that the tick before found clear."""
        if state.following is None:
            return self.limiter(state).stop(state.motion, dt), None
        along = self._follower.braking(state.following, dt)
        return along.motion(), along

    def _fraction(self, chain: Chain, state: State) -> float:
        """Of the joints' speeds, how much the tool may have on its way to the goal."""
        way = state.goal - state.setpoint
        if state.jogging is not None or state.servo is not None or not way.any():
            return 1.0
        fastest = way / float(np.max(np.abs(way) / chain.speed))
        # Where the arm is by the time it could have slowed down the tool may be farther out.
        soon = np.clip(state.setpoint + SLOWDOWN_TIME * state.motion.qd, chain.lower, chain.upper)
        speed = max(tool_speed(chain, q, fastest) for q in (state.setpoint, soon))
        return min(1.0, self._tool_speed / speed) if speed > 0.0 else 1.0

    def _fingers(self, state: State, dt: float) -> float:
        reach = self._arm.gripper.speed * dt
        if state.stopped is not None or state.paused:
            return state.gripper_setpoint
        return state.gripper_setpoint + min(
            max(state.gripper_goal - state.gripper_setpoint, -reach), reach
        )

    def _met(
        self, state: State, ahead: JointMotion, along: Following | None, fingers: float
    ) -> Contact | None:
        """What is met on the way to ``ahead`` and on to rest; None when nothing is."""
        assert self._world is not None
        if state.following is not None and along is not None:
            met = self._follower.met(state.following, along, fingers)
            return None if met is None else self._as_it_is(met, np.append(state.setpoint, fingers))
        limiter, x = self.limiter(state), np.append(state.setpoint, fingers)
        if is_surely_clear(self._world, x, np.append(limiter.stopping_point(ahead), fingers)):
            return None
        way = limiter.stopping_path(ahead, MAX_PATH_LENGTH)
        for a, b in pairwise([state.setpoint, *way]):
            step = advance(self._world, np.append(a, fingers), np.append(b, fingers), MIN_STOP_TIME)
            if step.contact is not None or step.stopped:
                if step.contact is None:
                    return self._world.nearest(x)
                return self._as_it_is(step.contact, x)
        return None

    def _as_it_is(self, met: Contact, x: FloatArray) -> Contact:
        """The parts that are about to meet, and how far they are apart at ``x`` (k,) [rad]."""
        assert self._world is not None
        return replace(met, distance=self._world.gap(x, *met.parts))

    def _updated(self, state: State) -> State:
        """``state`` with the distance of the contact it brakes for as it is now."""
        assert self._world is not None
        x = state.x_setpoint
        findings = tuple(
            replace(finding, amount=self._world.gap(x, *finding.parts))
            if finding.reason is Reason.CONTACT and finding.parts is not None
            else finding
            for finding in state.findings
        )
        return replace(state, findings=findings)

    def _may_go_on(self, state: State) -> bool:
        """Whether the way of an arm that waits is clear again, at its beginning."""
        assert self._world is not None
        if state.following is not None:
            return self._follower.may_go_on(state.following, state.gripper_setpoint)
        way = state.goal - state.setpoint
        if not way.any():
            return True
        fraction = min(1.0, PROBE / float(np.abs(way).sum()))
        x = state.x_setpoint
        towards = np.append(state.setpoint + fraction * way, state.gripper_setpoint)
        step = advance(self._world, x, towards, MIN_STOP_TIME)
        return bool((step.x == towards).all())


def _bent(arm: ArmModel, elbow: str) -> Limits:
    """The limits of ``arm`` with its elbow kept on one side of the stretched arm."""
    canonical = arm_of(arm.chain)
    limits = arm.limits
    sign, shift = canonical.signs[2], canonical.shifts[2]
    seam = -sign * shift
    lower, upper = np.array(limits.lower), np.array(limits.upper)
    if lower[2] < seam < upper[2]:
        if (elbow == "up") == (sign > 0.0):
            lower[2] = seam
        else:
            upper[2] = seam
    return replace(limits, lower=lower, upper=upper)


def wished_twist(chain: Chain, q: FloatArray, jogging: Jogging) -> FloatArray:
    """What a jog wishes of the tool, (6,) in {S} [rad/s, m/s]."""
    R = forward(chain, q)[:3, :3]
    pitched = pitched_frame(chain, q)
    v = jogging.rates[:3] if jogging.frame is JogFrame.BASE else R @ jogging.rates[:3]
    omega = jogging.rates[3] * pitched[:, 1] + jogging.rates[4] * pitched[:, 0]
    return np.concatenate((omega, v))


def _told(state: State, contact: Contact | None) -> State:
    """``state`` with ``contact`` as its first finding, in place of any before it."""
    others = tuple(finding for finding in state.findings if finding.reason is not Reason.CONTACT)
    if contact is None:
        return state if others == state.findings else replace(state, findings=others)
    finding = Finding(Reason.CONTACT, contact.distance, parts=contact.parts)
    return replace(state, findings=(finding, *others))
