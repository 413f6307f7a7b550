"""A detour round a gap: offered at rest, taken by Go alone, withdrawn when anything changes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.outcome import NO_DETOUR
from katana450.arm.control.session.plans import detour_from, plan_to
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.appearance import AppearanceTrait
from katana450.arm.control.state.following import Following
from katana450.arm.control.state.messages import sentence
from katana450.arm.control.state.modes import JointTarget
from katana450.arm.control.state.state import Reason, State, Status, Verdict
from katana450.arm.robot.loader import load
from katana450.errors import BlockedError
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.priority import Priority
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.sampling import BranchRegion, collision_free_paths
from tests.ticks import TICK, rested

TARGET = np.array((0.008, 0.025, 0.443))
"""[m] A point above the shoulder. A drag there from the ready posture ends at limits."""


def offer(session: Session, state: State) -> cmd.OfferDetour:
    world = session.world_at(state)
    return cmd.OfferDetour(detour_from(session.require_arm(), world, state))


@pytest.fixture
def held(shipped: Session) -> State:
    """The shipped arm at the edge of a gap, with the hand still on the handle."""
    state = rested(shipped, shipped.begin(shipped.ready, 0.0, 0.0), cmd.Position(TARGET))
    assert state.status is Status.GAP
    assert state.detour is None
    return state


@pytest.fixture
def offered(shipped: Session, held: State) -> State:
    """The same state with a detour on offer."""
    state = shipped.step(held, [offer(shipped, held)], held.t + TICK)
    assert state.outcomes[0].verdict is Verdict.ACCEPTED
    assert state.detour is not None
    return state


def test_plan_that_begins_elsewhere_keeps_the_offer(shipped: Session, offered: State) -> None:
    start = shipped.begin(shipped.ready, 0.0, 0.0)
    elsewhere = plan_to(shipped.require_arm(), None, start, shipped.ready + 0.1)
    after = shipped.step(offered, [cmd.Follow(elsewhere)], offered.t + TICK)
    assert after.outcomes[0].verdict is Verdict.REFUSED
    assert after.detour is offered.detour


def point(session: Session, state: State) -> FloatArray:
    return forward(session.require_arm().chain_to(state.tool), state.setpoint)[:3, 3]


def test_offer_is_in_the_same_sentence_and_moves_nothing(shipped: Session, offered: State) -> None:
    assert offered.detour is not None
    seconds = offered.detour.duration
    assert sentence(offered).startswith(
        f"Reachable by a {seconds:.1f} s detour: press Enter or Go; "
    )
    assert "would have to leap" not in sentence(offered)
    after = offered
    for _ in range(200):
        after = shipped.step(after, (), after.t + TICK)
    np.testing.assert_array_equal(after.setpoint, offered.setpoint)
    assert after.detour is offered.detour
    slow = shipped.step(after, [cmd.Speed(0.5)], after.t + TICK)
    assert f"a {2.0 * seconds:.1f} s detour" in sentence(slow)


@pytest.mark.parametrize("let_go", [False, True])
def test_go_arrives_on_the_same_branch(shipped: Session, offered: State, let_go: bool) -> None:
    chain = shipped.require_arm().chain
    state = offered
    if let_go:
        state = shipped.step(state, [cmd.EndDrag()], state.t + TICK)
        assert isinstance(state.target, JointTarget)
        # An offer outlasts the end of the drag.
        assert state.detour is offered.detour
    region = BranchRegion(chain, state.branch)  # type: ignore[arg-type]
    state = shipped.step(state, [cmd.Go()], state.t + TICK)
    assert isinstance(state.mode, Following)
    for _ in range(2000):
        if not state.moving:
            break
        state = shipped.step(state, (), state.t + TICK)
        assert region.holds(state.setpoint)
    assert not state.moving
    assert state.branch == offered.branch
    np.testing.assert_allclose(point(shipped, state), TARGET, rtol=0, atol=1e-6)
    assert Reason.ACROSS_GAP not in {finding.reason for finding in state.findings}


def test_detour_can_be_offered_after_the_drag_ended(shipped: Session, held: State) -> None:
    state = shipped.step(held, [cmd.EndDrag()], held.t + TICK)
    state = shipped.step(state, [offer(shipped, state)], state.t + TICK)
    state = rested(shipped, state, cmd.Go())
    np.testing.assert_allclose(point(shipped, state), TARGET, rtol=0, atol=1e-6)


CHANGES: list[cmd.Command] = [
    cmd.Gripper(0.2),
    cmd.Tool("flange"),
    cmd.SetPriority(Priority.POSITION),
    cmd.MoveObject("cup", np.array([0.3, 0.35, 0.0])),
    cmd.Remove("basin"),
    cmd.Pause(),
    cmd.Position(TARGET + 0.01),
    cmd.Turn(0.3, 0.1),
    cmd.Nudge(1, 0.1),
    cmd.Home(),
    cmd.Hold(),
    cmd.Jog(np.array([0.05, 0.0, 0.0, 0.0, 0.0])),
    cmd.Stop(),
]


@pytest.mark.cases(2)
@pytest.mark.parametrize("change", CHANGES, ids=lambda change: type(change).__name__)
def test_any_change_withdraws_the_offer(
    shipped: Session, offered: State, change: cmd.Command
) -> None:
    state = shipped.step(offered, [change], offered.t + TICK)
    assert state.detour is None
    assert "detour" not in sentence(state)
    before = shipped.step(state, (), state.t + TICK)
    after = shipped.step(state, [cmd.Go()], state.t + TICK)
    assert after.outcomes[0].verdict is Verdict.REFUSED
    np.testing.assert_array_equal(after.setpoint, before.setpoint)
    # Go in the same tick comes too late as well.
    at_once = shipped.step(offered, [change, cmd.Go()], offered.t + TICK)
    assert at_once.following is None


def test_appearance_and_speed_leave_the_offer(shipped: Session, offered: State) -> None:
    dressed = cmd.SetAppearance("cup", AppearanceTrait.CHOICE, -1)
    for command in (dressed, cmd.Speed(0.7)):
        state = shipped.step(offered, [command], offered.t + TICK)
        assert state.detour is offered.detour


def test_go_without_an_offer_is_refused_with_the_reason(shipped: Session, held: State) -> None:
    for state in (shipped.begin(shipped.ready, 0.0, 0.0), held):
        after = shipped.step(state, [cmd.Go()], state.t + TICK)
        (outcome,) = after.outcomes
        assert outcome.verdict is Verdict.REFUSED
        assert outcome.why == NO_DETOUR
        assert after.following is None


def test_offer_of_another_state_is_refused(shipped: Session, held: State) -> None:
    arm = shipped.require_arm()
    elsewhere = plan_to(arm, None, held, shipped.ready)
    moving = shipped.step(held, [cmd.Position(TARGET - 0.05)], held.t + TICK)
    idle = shipped.begin(shipped.ready, 0.0, 0.0)
    stopped = shipped.step(held, [cmd.Stop()], held.t + TICK)
    good = offer(shipped, held)
    for state, command in (
        (held, cmd.OfferDetour(elsewhere)),
        (moving, good),
        (idle, good),
        (stopped, good),
    ):
        after = shipped.step(state, [command], state.t + TICK)
        assert after.outcomes[0].verdict is Verdict.REFUSED
        assert after.detour is None


def test_line_on_a_branch_is_proven_for_every_place(pincher_back: BranchRegion) -> None:
    region, held, left = pincher_back, 0, 0
    for a, b in pairs_on(region, 60):
        on_line = [region.holds(a + s * (b - a)) for s in np.linspace(0.0, 1.0, 300)]
        assert region.holds_line(a, b) == all(on_line)
        held += all(on_line)
        left += not all(on_line)
    assert held > 10
    assert left > 10


def test_sampled_path_stays_on_its_branch_with_rounded_corners(pincher_back: BranchRegion) -> None:
    region = pincher_back
    bent = [pair for pair in pairs_on(region, 60) if not region.holds_line(*pair)]
    for a, b in bent[:2]:
        for path in collision_free_paths(region.chain, a, b, None, 0.0, 0, region.branch):
            for sigma in np.linspace(0.0, 1.0, 500).tolist():
                q = [joint.derivatives()[0] for joint in path.joints(Jet.constant(sigma))]
                assert region.holds(np.array(q))


@pytest.fixture
def pincher_back() -> BranchRegion:
    """A branch of the PincherX-150 that straight lines leave often."""
    path = Path(__file__).parents[1] / "robot" / "arms" / "pincherx_150.urdf"
    return BranchRegion(load(path).require_arm().chain, Branch("back", "up"))


def pairs_on(region: BranchRegion, count: int) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield pairs of random postures (5,) [rad] on a branch."""
    chain, rng = region.chain, np.random.default_rng(1)
    drawn = rng.uniform(chain.lower, chain.upper, (5000, 5))
    inside = [q for q in drawn if region.holds(q)]
    assert len(inside) >= 2 * count
    yield from zip(inside[:count], inside[count : 2 * count], strict=True)


def test_no_path_on_the_branch_is_refused(shipped: Session) -> None:
    chain = shipped.require_arm().chain
    front = chain.clamp(np.radians((0.0, -68.0, 85.0, 8.0, 0.0)))
    back = chain.clamp(np.radians((0.0, -120.0, 10.0, -100.0, 0.0)))
    assert not BranchRegion(chain, Branch("front", "up")).holds(back)
    with pytest.raises(BlockedError, match="was found"):
        collision_free_paths(chain, front, back, None, 0.0, 0, Branch("front", "up"))
