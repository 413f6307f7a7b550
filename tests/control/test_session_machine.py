"""Random commands to the real session, which keeps its invariants after every tick."""

from __future__ import annotations

import numpy as np
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import precondition, rule, run_state_machine_as_test

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.plans import plan_to
from katana450.arm.control.session.tool_targets import current_target
from katana450.arm.control.state.messages import PRIORITIES
from katana450.arm.control.state.modes import Following, Jogging, Positioning, Tracking
from katana450.errors import KatanaError
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import BRANCHES, Branch
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.velocity import JogFrame
from katana450.maths.planning.plan import Plan
from tests.conftest import LONG
from tests.control.invariants import JointRules, fractions, ticks


class ArmRules(JointRules):
    """The commands of an arm with gripper, objects and plans."""

    names = ("shipped", "bare")
    plan: Plan | None = None

    @rule(rates=fractions(5), frame=st.sampled_from(JogFrame), ticks=ticks)
    def jog(self, rates: FloatArray, frame: JogFrame, ticks: int) -> None:
        command = cmd.Jog(rates * (0.1, 0.1, 0.1, 0.5, 0.5), frame)
        for _ in range(ticks):
            refused = self.state.stopped is not None or self.state.paused
            self.tick([command])
            # A jog that is held continues in every mode.
            assert refused or isinstance(self.state.intent, Jogging)

    @rule(step=fractions(3), ticks=ticks, let_go=st.booleans())
    def drag(self, step: FloatArray, ticks: int, let_go: bool) -> None:
        start = current_target(self.session.require_arm(), self.state).position
        begins = not isinstance(self.state.intent, Tracking)
        for tick in range(1, ticks + 1):
            position = start + 0.02 * tick * step
            self.tick([cmd.Position(position)])
            if self.state.stopped is None:
                self.check_drag(position, start if begins else None)
        self.run([cmd.EndDrag()] if let_go else (), 2)

    def check_drag(self, position: FloatArray, start: FloatArray | None) -> None:
        """Check that the drag is tracked along the line from its start, and in no other mode."""
        intent = self.state.intent
        assert isinstance(intent, Tracking | Positioning)
        assert isinstance(intent.target, ToolTarget)
        np.testing.assert_array_equal(intent.target.position, position)
        if isinstance(intent, Tracking) and start is not None:
            line, off = position - start, intent.since.position - start
            assert np.linalg.norm(np.cross(line, off)) <= 1e-9
            assert -1e-12 <= line @ off <= line @ line + 1e-12

    @rule(
        kinds=st.permutations(("jog", "servo", "drag", "set_joints", "grip", "stop", "pause")),
        data=st.data(),
    )
    def switch(self, kinds: list[str], data: st.DataObject) -> None:
        """Replace one mode by another, or interrupt it, while the arm is free."""
        self.wait_and_clear(1, cmd.Resume())
        for kind in kinds:
            ticks = data.draw(st.integers(2, 12))
            if kind == "jog":
                self.jog(rates=data.draw(fractions(5)), frame=JogFrame.BASE, ticks=ticks)
            elif kind == "servo":
                self.servo(data=data, ticks=ticks, every=1, jump=False)
            elif kind == "drag":
                self.drag(step=data.draw(fractions(3)), ticks=ticks, let_go=False)
            elif kind == "set_joints":
                self.set_joints(data=data, ticks=ticks)
            elif kind == "grip":
                self.grip(angle=data.draw(st.integers(-3, 9)), ticks=ticks)
            elif kind == "pause":
                self.run([cmd.Pause()], ticks)
                self.run([cmd.Resume()], 5)
            else:
                wide = self.state.gripper_setpoint < 0.1
                self.tick([cmd.Gripper(0.3 if wide else -0.3)])
                self.run([cmd.Stop()], ticks)
                self.run([cmd.Home(), cmd.Gripper(0.0)], 2)
                self.wait_and_clear(5)

    @rule(pitch=fractions(1), roll=fractions(1), ticks=ticks)
    def turn(self, pitch: FloatArray, roll: FloatArray, ticks: int) -> None:
        self.run([cmd.Turn(1.5 * float(pitch[0]), float(roll[0]))], ticks)

    @rule(ticks=ticks)
    def end_drag(self, ticks: int) -> None:
        self.run([cmd.EndDrag()], ticks)

    @rule(off=fractions(3), ticks=ticks)
    def set_pose(self, off: FloatArray, ticks: int) -> None:
        chain = self.session.require_arm().chain_to(self.state.tool)
        T = np.array(forward(chain, self.state.goal))
        T[:3, 3] += 0.1 * off
        self.run([cmd.Pose(T)], ticks)

    @rule(branch=st.sampled_from(BRANCHES), ticks=ticks)
    def take_branch(self, branch: Branch, ticks: int) -> None:
        self.run([cmd.Branch(name=str(branch))], ticks)

    @rule(priority=st.sampled_from(tuple(PRIORITIES)), ticks=ticks)
    def set_priority(self, priority: Priority, ticks: int) -> None:
        self.run([cmd.SetPriority(priority)], ticks)

    @rule(data=st.data(), ticks=ticks)
    def set_tool(self, data: st.DataObject, ticks: int) -> None:
        tools = sorted(self.session.require_arm().tools)
        self.run([cmd.Tool(data.draw(st.sampled_from(tools)))], ticks)

    @precondition(lambda self: self.state.motion.at_rest)
    @rule(off=fractions(5), ticks=st.integers(1, 60))
    def follow(self, off: FloatArray, ticks: int) -> None:
        arm, state = self.session.require_arm(), self.state
        goal = arm.chain.clamp(state.setpoint + 0.5 * off)
        try:
            self.plan = plan_to(arm, self.session.world_at(state), state, goal)
        except KatanaError:
            return
        self.run([cmd.Follow(self.plan)], ticks)
        if self.state.stopped is None:
            assert isinstance(self.state.mode, Following)

    @precondition(lambda self: self.plan is not None)
    @rule(ticks=ticks)
    def follow_again(self, ticks: int) -> None:
        """Follow the plan again from any place of the arm."""
        assert self.plan is not None
        self.run([cmd.Follow(self.plan)], ticks)

    @rule(angle=st.integers(-3, 9), ticks=ticks)
    def grip(self, angle: int, ticks: int) -> None:
        self.run([cmd.Gripper(angle / 8.0)], ticks)

    @precondition(lambda self: self.name == "shipped")
    @rule(xy=fractions(2), ticks=ticks)
    def move_cup(self, xy: FloatArray, ticks: int) -> None:
        self.run([cmd.MoveObject("cup", np.array([0.35 + 0.2 * xy[0], 0.4 * xy[1], 0.0]))], ticks)

    @precondition(lambda self: self.name == "shipped")
    @rule(cup=st.booleans(), ticks=ticks)
    def change_scene(self, cup: bool, ticks: int) -> None:
        objects = tuple(prop for prop in self.first.objects if cup or prop.name != "cup")
        self.run([cmd.ReplaceScene(objects, 1e-4 if cup else None)], ticks)


def bounded(quick: int, many: int) -> settings:
    """Return settings with this number of examples: always the same ones, or many others."""
    return settings(
        max_examples=many if LONG else quick,
        stateful_step_count=60 if LONG else 25,
        deadline=None,
        derandomize=not LONG,
        # The shrinking of an example takes minutes.
        phases=tuple(Phase) if LONG else (Phase.explicit, Phase.generate),
        suppress_health_check=list(HealthCheck),
    )


def test_arm_keeps_its_invariants() -> None:
    run_state_machine_as_test(ArmRules, settings=bounded(4, 250))


def test_joints_keep_their_invariants() -> None:
    run_state_machine_as_test(JointRules, settings=bounded(4, 400))
