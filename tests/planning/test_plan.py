"""Plans: clear on their whole path, or refused with the obstacle and the place."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.arm.control.arm import ArmModel
from katana450.arm.robot.collision import world_of
from katana450.arm.robot.robot import Robot
from katana450.errors import BlockedError, InputError
from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.maths.collision.shape import box, half_space
from katana450.maths.collision.world import MAX_PATH_LENGTH, CollisionWorld, obstacle
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.planning.clearance import Sweep, SweptClearance
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.joint_path import JointPath
from katana450.maths.planning.path import Path, joint_derivatives, point_derivatives
from katana450.maths.planning.plan import MARGIN, check_clear, plan
from katana450.maths.planning.sampling import collision_free_path
from katana450.maths.planning.scaling import Bounds
from tests.conftest import LONG


@pytest.fixture(scope="module")
def bare(robot: Robot) -> CollisionWorld:
    """The arm without an environment."""
    world, _ = world_of(robot)
    assert world is not None
    return world


@pytest.fixture(scope="module")
def world(bare: CollisionWorld) -> CollisionWorld:
    """The arm on its table, with a wall as thin as a sheet beside it."""
    wall_at = se3.from_rotation_translation(np.eye(3), (0.35, 0.0, 0.16))
    wall = obstacle("wall", wall_at, box((0.30, 0.001, 0.32)))
    return bare.with_obstacles([obstacle("table", np.eye(4), half_space()), wall])


def brute_force(path: Path, world: CollisionWorld, places: int = 400) -> float:
    """Return the minimum clearance [m] over many places."""
    sweep = Sweep(path)
    contacts = (world.nearest(sweep.at(s, 0.0)) for s in np.linspace(0.0, 1.0, places).tolist())
    return min(contact.distance for contact in contacts if contact is not None)


def across(arm: ArmModel, lift: float) -> JointPath:
    """Return a path from one side of the wall to the other, in one leg."""
    q = np.radians([[50.0, -60.0, 80.0, 10.0, 0.0], [-50.0, -60.0, 80.0, 10.0, 0.0]])
    return JointPath(arm.chain, q + np.array([0.0, lift, 0.0, 0.0, 0.0]))


def test_a_wall_thinner_than_any_step_is_not_passed(arm: ArmModel, world: CollisionWorld) -> None:
    path = across(arm, 0.0)
    with pytest.raises(BlockedError, match=r"wall would .* mm are required") as raised:
        check_clear(path, world, 0.0)
    numbers = r"blocked (\d+) % .*\((-?[\d.]+), (-?[\d.]+), (-?[\d.]+)\)"
    fraction, *point = map(float, re.findall(numbers, str(raised.value))[0])
    sweep = Sweep(path)
    places = [sweep.at(0.01 * (fraction + off), 0.0) for off in np.linspace(-0.6, 0.6, 41)]
    near = [world.nearest(x) for x in places]
    assert min(contact.distance for contact in near if contact is not None) < MARGIN
    tools = np.array([1e3 * forward(arm.chain, x[:5])[:3, 3] for x in places])
    assert np.abs(tools - point).max(axis=1).min() < 3.0


def test_far_turn_is_looked_at_in_places_that_a_bound_holds_for(world: CollisionWorld) -> None:
    start = np.radians([90.0, -90.0, 0.0, 0.0, -140.0, 0.0])
    line, places = np.radians([0.0, 0.0, 0.0, 0.0, 280.0, 0.0]), []

    def posture_at(fraction: float) -> FloatArray:
        places.append(fraction)
        return np.asarray(start + fraction * line)

    room = SweptClearance.about(world, 1e-3, start)
    assert room.blocked(posture_at, lambda a, b: (b - a) * np.abs(line)) is None
    turns = np.diff([0.0, *sorted(places), 1.0]) * np.abs(line).sum()
    assert turns.max() < 2.0 * MAX_PATH_LENGTH


def test_the_nearest_clearance_is_that_of_brute_force(arm: ArmModel, world: CollisionWorld) -> None:
    rng, looked, near = np.random.default_rng(8), 0, 0
    start = across(arm, 0.0).start
    while looked < 4:
        a = start + rng.uniform(-0.2, 0.2, 5)
        path = JointPath(arm.chain, np.array((a, a + rng.uniform((-0.7, 0, 0, 0, 0), 0.1))))
        clearance = brute_force(path, world, 100)
        try:
            check_clear(path, world, 0.0)
        except BlockedError:
            assert clearance < MARGIN + 1e-3
            continue
        sweep = Sweep(path)
        nearest = sweep.nearest(SweptClearance.about(world, MARGIN, sweep.at(0.0, 0.0)), 0.0)
        assert nearest is not None
        looked += 1
        near += clearance < 0.06
        assert clearance >= MARGIN - 1e-4
        assert nearest.contact.distance <= 1.1 * clearance + 1e-3
        assert nearest.contact.distance >= 0.9 * clearance - 1e-3
    assert near > 0


def test_path_around_the_wall_is_clear_and_deterministic(
    arm: ArmModel, world: CollisionWorld
) -> None:
    blocked = across(arm, 0.0)
    path = collision_free_path(arm.chain, blocked.start, blocked.end, world, 0.0, seed=2)
    assert brute_force(path, world) >= MARGIN - 1e-4
    again = collision_free_path(arm.chain, blocked.start, blocked.end, world, 0.0, seed=2)
    assert (path.vias == again.vias).all()
    assert (path.blend == again.blend).all()


def test_an_end_in_the_wall_is_refused(arm: ArmModel, world: CollisionWorld) -> None:
    clear, inside = across(arm, 0.0).start, np.radians([0.0, -60.0, 80.0, 10.0, 0.0])
    with pytest.raises(BlockedError, match=r"At the end, .* are required"):
        collision_free_path(arm.chain, clear, inside, world, 0.0, 0)


def test_unsuccessful_search_ends(
    arm: ArmModel, bare: CollisionWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Past an infinite wall the arm would have to reach over itself."""
    wall_at = se3.from_rotation_translation(np.eye(3), (1.15, 0.0, 0.0))
    endless = bare.with_obstacles([obstacle("wall", wall_at, box((2.0, 0.01, 6.0)))])
    monkeypatch.setattr("katana450.maths.planning.sampling.MAX_POSTURES", 5)
    path = across(arm, 0.0)
    with pytest.raises(
        BlockedError, match=r"found in 5 tries from seed 0\. On the straight .*wall"
    ):
        collision_free_path(arm.chain, path.start, path.end, endless, 0.0, 0)


def test_path_out_of_a_contact_is_allowed_and_deeper_is_not(
    arm: ArmModel, world: CollisionWorld
) -> None:
    """Test an object that is put where the arm already is."""
    touching = np.radians([0.0, -60.0, 80.0, 10.0, 0.0])
    contact = world.nearest(np.append(touching, 0.0))
    assert contact is not None
    assert contact.distance < MIN_CLEARANCE
    away = np.radians([0.0, -110.0, 80.0, 10.0, 0.0])
    check_clear(JointPath(arm.chain, np.array([touching, away])), world, 0.0)
    with pytest.raises(BlockedError):
        check_clear(JointPath(arm.chain, np.array([away, touching])), world, 0.0)


def test_paths_that_do_not_meet_are_refused(
    arm: ArmModel, bounds: Bounds, paths: dict[str, Path], ready: FloatArray
) -> None:
    with pytest.raises(InputError, match=r"Path 2 begins .* deg from where path 1 ends"):
        plan([paths["line"], paths["joints"]], bounds)
    with pytest.raises(InputError, match="at least one path"):
        plan([], bounds)
    outward = JointPath(arm.chain, np.array([ready, ready + 0.1]))
    back = JointPath(arm.chain, np.array([ready + 0.1, ready]))
    both = plan([outward, back], bounds)
    assert both.nearest is None
    assert both.begins[1] == both.segments[0].scaling.span
    assert both.q(both.begins[1]) == pytest.approx(ready + 0.1, abs=1e-14)
    assert both.postures(3)[[0, -1]] == pytest.approx(np.array([ready, ready]), abs=1e-14)
    one = both.segments[0]
    assert both.duration == pytest.approx(2.0 * one.scaling.duration, rel=0.05)


def test_the_length_of_the_circle_is_that_of_a_circle(
    paths: dict[str, Path], bounds: Bounds
) -> None:
    circle = plan([paths["circle"]], bounds)
    assert circle.length == pytest.approx(0.2 * np.pi, rel=1e-5)


def test_a_plan_to_a_limit_never_exceeds_it_by_rounding(arm: ArmModel, bounds: Bounds) -> None:
    chain = arm.chain
    for number in range(20 if LONG else 8):
        start = np.random.default_rng(number).uniform(chain.lower, chain.upper)
        # Vias may exceed a limit by rounding too.
        motion = plan([JointPath(chain, np.array([start, chain.upper + 5e-10]))], bounds)
        close = motion.span - np.geomspace(1e-9, 1e-2, 50)
        assert (np.array([motion.q(tau) for tau in close.tolist()]) <= chain.upper).all()
        np.testing.assert_array_equal(motion.end, chain.upper)


def test_a_plan_ends_at_its_goal_to_the_bit(arm: ArmModel, bounds: Bounds) -> None:
    chain, rng = arm.chain, np.random.default_rng(5)
    for start, goal in rng.uniform(chain.lower, chain.upper, (20 if LONG else 8, 2, 5)):
        motion = plan([JointPath(chain, np.array([start, goal]))], bounds)
        np.testing.assert_array_equal(motion.q(0.0), start)
        np.testing.assert_array_equal(motion.q(motion.span), goal)


def random_vias(arm: ArmModel, seed: int) -> tuple[FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 6))
    vias = rng.uniform(arm.chain.lower, arm.chain.upper, (count, 5))
    return vias, rng.uniform(0.05, 1.0, count - 2)


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_corners_join_their_legs_smoothly_and_stay_inside(arm: ArmModel, seed: int) -> None:
    vias, blend = random_vias(arm, seed)
    path = JointPath(arm.chain, vias, blend)
    assert (path.start == vias[0]).all()
    assert (path.end == vias[-1]).all()
    ends = joint_derivatives(path, np.array([0.0, 1.0]))[0]
    assert ends == pytest.approx(vias[[0, -1]], abs=1e-13)
    joins = np.array(path.joins)
    before, after = (joint_derivatives(path, joins + step) for step in (-1e-9, 1e-9))
    for order in range(3):
        scale = np.abs(after[order + 1]).max(initial=1.0)
        assert after[order] == pytest.approx(before[order], abs=1e-8 * scale)
    q = joint_derivatives(path, np.linspace(0.0, 1.0, 400))[0]
    assert (q >= vias.min(axis=0) - 1e-12).all()
    assert (q <= vias.max(axis=0) + 1e-12).all()


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_the_tool_point_is_that_of_forward_kinematics(arm: ArmModel, seed: int) -> None:
    path = JointPath(arm.chain, *random_vias(arm, seed))
    sigma = np.linspace(0.0, 1.0, 9)
    q, p = joint_derivatives(path, sigma)[0], point_derivatives(path, sigma)[0]
    for angles, point in zip(q, p, strict=True):
        assert point == pytest.approx(forward(arm.chain, angles)[:3, 3], abs=1e-14)


def test_a_leg_alone_is_straight(arm: ArmModel) -> None:
    vias = np.array([[0.0, -1.0, 1.0, 0.0, 0.0], [1.0, -0.5, 0.5, 0.3, 0.0]])
    path = JointPath(arm.chain, vias)
    for sigma in (0.0, 0.3, 1.0):
        q = np.array([joint.c0 for joint in path.joints(Jet.variable(sigma))])
        assert q == pytest.approx(vias[0] + sigma * (vias[1] - vias[0]), abs=1e-15)


def test_a_smaller_blend_passes_its_via_nearer(arm: ArmModel) -> None:
    vias, _ = random_vias(arm, 3)
    sigma = np.linspace(0.0, 1.0, 2000)
    away = []
    for blend in (1.0, 0.5, 0.1):
        path = JointPath(arm.chain, vias, np.full(len(vias) - 2, blend))
        q = joint_derivatives(path, sigma)[0]
        away.append(max(np.linalg.norm(q - via, axis=1).min() for via in vias[1:-1]))
    for more, less in pairwise(away):
        assert less < more


def test_invalid_vias_are_refused(arm: ArmModel, ready: FloatArray) -> None:
    goal = ready + 0.1
    none = np.empty(0)
    for vias, blend in (
        (np.array([ready]), none),
        (np.array([ready, ready]), none),
        (np.array([ready, goal, goal]), np.ones(1)),
        (np.array([ready, goal, ready]), none),
        (np.array([ready, goal, ready]), np.zeros(1)),
        (np.array([ready, goal, ready]), np.array([1.1])),
        (np.array([ready, goal * np.nan]), none),
        (np.array([ready[:4], goal[:4]]), none),
    ):
        with pytest.raises(InputError):
            JointPath(arm.chain, vias, blend)
    with pytest.raises(
        InputError, match=r"Place 2 of the path has axis 2 at 57.3 deg, 49.55 deg beyond"
    ):
        JointPath(arm.chain, np.array([ready, [0.0, 1.0, 0.0, 0.0, 0.0]]))
