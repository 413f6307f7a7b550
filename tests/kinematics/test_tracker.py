"""Following a drag: the nearest pose where it is continuous, and no leap where it is not."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pytest

from katana450.arm.control.state.messages import PRIORITIES
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics import tracker
from katana450.maths.kinematics.branch import Branch, branch_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.nearest_posture import NearestPosture, nearest_posture
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import ANGLE_WORTH_TELLING, POSITION_WORTH_TELLING
from katana450.maths.kinematics.tool import ToolTarget, pitch_and_roll
from katana450.maths.kinematics.tracker import HOP, MAX_POSES, Tracked, leap, track
from tests.kinematics.family import random_member, random_pose

READY = np.radians([0.0, -68.0, 85.0, 8.0, 0.0])
FRONT_UP = Branch("front", "up")


class Split(NamedTuple):
    """A drag in the plane y = 0 across a point where the nearest pose leaps on one branch."""

    branch: str
    point: tuple[float, float]
    pitch: float
    way: tuple[float, float]
    leap: float

    def target(self, along: float) -> ToolTarget:
        """Return the target `along` [m] past the point."""
        (x, z), (dx, dz) = self.point, self.way
        return ToolTarget(np.array([x + along * dx, 0.0, z + along * dz]), self.pitch, 0.0)


# Found by searching straight drags for leaps of the nearest pose by more than 1.2 rad within 1 mm,
# with the tool point in place on both sides. The limits of axes 2, 3 and 4 leave two ranges of
# pitch there, and the nearer range ends or becomes the farther one.
SPLITS = [
    Split("front-up", (0.2413, 0.3683), -0.601, (-0.798, -0.603), 1.72),
    Split("front-up", (0.1042, 0.4239), -1.536, (0.076, -0.997), 1.33),
    Split("front-up", (0.4353, 0.0323), -0.205, (-0.810, -0.586), 1.24),
    Split("front-down", (0.0344, 0.4422), -1.241, (-0.910, -0.414), 1.80),
    Split("front-down", (0.4369, 0.1401), -0.133, (-1.000, 0.008), 1.30),
    Split("back-down", (-0.2579, 0.3794), -1.628, (-0.435, -0.900), 1.20),
]

STEP = 5e-4
"""Length [m] of each move of these slow drags."""


def dragged(
    chain: Chain, split: Split, q: FloatArray, stops: FloatArray
) -> Iterator[tuple[ToolTarget, Tracked]]:
    """Yield each target of a drag, and its result."""
    branch = Branch.parse(split.branch)
    since = ToolTarget.at(chain, q)
    for along in stops:
        target = split.target(float(along))
        tracked = track(chain, q, target, branch=branch, since=since)
        yield target, tracked
        q, since = tracked.best.q, target


def arrived(
    chain: Chain, q: FloatArray, target: ToolTarget, since: ToolTarget, priority: Priority
) -> Tracked:
    """Return the final result of repeated calls, as in successive ticks."""
    tracked = track(chain, q, target, branch=FRONT_UP, priority=priority, since=since)
    for _ in range(40):
        if tracked.since is None:
            break
        assert tracked.beyond_gap is None
        tracked = track(
            chain,
            tracked.best.q,
            target,
            branch=FRONT_UP,
            priority=priority,
            since=tracked.since,
        )
    assert tracked.since is None
    return tracked


@pytest.mark.parametrize("split", SPLITS, ids=str)
def test_where_limits_split_the_pitches_the_goal_does_not_leap(chain: Chain, split: Split) -> None:
    branch = Branch.parse(split.branch)
    stops = np.arange(-0.02, 0.02, STEP)
    plain = [
        leap(chain, READY, split.target(float(along)), branch, Priority.POSE) for along in stops
    ]
    start = plain[0].q
    leaps = np.abs(np.diff([best.q for best in plain], axis=0)).max(axis=1)
    assert leaps.max() == pytest.approx(split.leap, abs=0.05)
    place = int(leaps.argmax())
    assert max(plain[place].position_error, plain[place + 1].position_error) < 1e-9

    goals = list(dragged(chain, split, start, stops))
    steps = np.abs(np.diff([tracked.best.q for _, tracked in goals], axis=0)).max(axis=1)
    # Before the leap nothing differs; after it the goal moves on as the target does.
    assert all(np.allclose(goals[i][1].best.q, plain[i].q, atol=1e-9) for i in range(place))
    assert steps.max() < HOP
    end = goals[-1][1]
    assert end.beyond_gap is not None
    assert end.beyond_gap is not None
    assert np.allclose(end.beyond_gap.q, plain[-1].q, atol=1e-9)
    axis, far = end.leap_ahead()
    assert far == pytest.approx(np.abs(plain[-1].q - end.best.q)[axis])
    assert far > 1.0

    back = list(dragged(chain, split, end.best.q, stops[::-1]))
    assert np.abs(np.diff([b.best.q for _, b in back], axis=0)).max() < HOP
    assert np.allclose(back[-1][1].best.q, start, atol=1e-9)
    assert back[-1][1].beyond_gap is None


def test_round_the_base_the_goal_stops_at_the_gap_of_axis_1(chain: Chain) -> None:
    """The goal stays at the limit for any further drag, and returns with it."""
    q, held = READY, 0
    since = ToolTarget.at(chain, q)
    radius, height = float(np.hypot(*since.position[:2])), float(since.position[2])
    for azimuth in np.radians(np.arange(2.0, 240.0, 2.0)):
        position = np.array([radius * math.cos(azimuth), radius * math.sin(azimuth), height])
        target = ToolTarget(position, since.pitch, since.roll)
        tracked = track(chain, q, target, branch=FRONT_UP, since=since)
        assert np.abs(tracked.best.q - q).max() < 2 * HOP
        if azimuth <= chain.upper[0]:
            assert is_exact(tracked)
        else:
            assert tracked.best.q[0] == pytest.approx(chain.upper[0], abs=1e-12)
            held += tracked.beyond_gap is not None
        q, since = tracked.best.q, target
    # Beyond the gap the place can be reached, but only the long way round.
    assert held > 20
    assert tracked.beyond_gap is not None
    assert tracked.beyond_gap.position_error < 1e-9
    axis, far = tracked.leap_ahead()
    assert axis == 0
    assert far == pytest.approx(chain.upper[0] + math.radians(122.0), abs=0.01)


def test_over_axis_1_the_arm_does_not_turn_round_by_itself(chain: Chain) -> None:
    q = np.radians([0.0, -110.0, 100.0, -60.0, 0.0])
    since = ToolTarget.at(chain, q)
    assert branch_of(chain, q) == FRONT_UP
    for x in np.arange(float(since.position[0]), -0.1, -0.01):
        target = ToolTarget(np.array([x, 0.0, since.position[2]]), since.pitch, 0.0)
        tracked = track(chain, q, target, branch=FRONT_UP, since=since)
        assert np.abs(tracked.best.q - q).max() < 2 * HOP
        assert abs(tracked.best.q[0]) < 1e-9
        q, since = tracked.best.q, target
    assert tracked.beyond_gap is not None
    assert forward(chain, q)[0, 3] == pytest.approx(0.0, abs=1e-9)
    axis, far = tracked.leap_ahead()
    assert axis == 0
    assert far == pytest.approx(math.pi, abs=0.3)


def test_beside_axis_1_the_arm_turns_with_the_hand(chain: Chain) -> None:
    """The same drag 6 cm to the side continues: the goal turns half round on the path."""
    q = np.radians([0.0, -110.0, 100.0, -60.0, 0.0])
    since = ToolTarget.at(chain, q)
    height = float(since.position[2])
    for x in np.arange(float(since.position[0]), -0.2, -0.005):
        target = ToolTarget(np.array([x, 0.06, height]), since.pitch, 0.0)
        tracked = track(chain, q, target, branch=FRONT_UP, since=since)
        q, since = tracked.best.q, target
        assert tracked.best.position_error < 1e-9
    assert q[0] > math.radians(155.0)


@pytest.mark.parametrize("priority", PRIORITIES)
def test_a_fast_drag_ends_where_the_slow_one_does(
    chain: Chain, priority: Priority, rng: np.random.Generator
) -> None:
    """The target leaps by up to 0.3 m inside the workspace."""
    agreed = 0
    for _ in range(12):
        q = READY + rng.normal(scale=0.1, size=5)
        since = ToolTarget.at(chain, q)
        shift = rng.normal(size=3)
        shift *= rng.uniform(0.05, 0.3) / np.linalg.norm(shift)
        target = ToolTarget(since.position + shift, since.pitch, since.roll)
        fast = arrived(chain, q, target, since, priority)
        slow, last = q, since
        for fraction in np.linspace(0.025, 1.0, 40):
            stop = since.towards(target, float(fraction))
            slow = track(chain, slow, stop, branch=FRONT_UP, priority=priority, since=last).best.q
            last = stop
        agreed += np.allclose(fast.best.q, slow, atol=1e-6)
    assert agreed >= 11


def is_exact(tracked: Tracked) -> bool:
    """Return whether the goal has no error that people read about, nor a gap before it."""
    best = tracked.best
    errors = best.position_error > POSITION_WORTH_TELLING, best.rotation_error > ANGLE_WORTH_TELLING
    return tracked.beyond_gap is None and not any(errors)


def test_reachable_target_is_reached_exactly(chain: Chain, rng: np.random.Generator) -> None:
    for _ in range(50):
        q = rng.uniform(chain.lower + 0.1, chain.upper - 0.1)
        desired = ToolTarget.at(chain, q + rng.normal(scale=0.02, size=5))
        tracked = track(chain, q, desired, branch=branch_of(chain, q))
        if is_exact(tracked):
            assert np.allclose(forward(chain, tracked.best.q)[:3, 3], desired.position, atol=1e-12)
            assert pitch_and_roll(chain, tracked.best.q) == pytest.approx(
                (desired.pitch, desired.roll), abs=1e-9
            )


@pytest.mark.parametrize("turn", [-0.5, 0.5])
def test_every_branch_follows_a_turn_of_axis_1_the_short_way(
    chain: Chain, turn: float, rng: np.random.Generator
) -> None:
    """Also test the back shoulder, where theta1 is not the direction of the target."""
    branches = set()
    for q in rng.uniform(chain.lower + 0.1, chain.upper - 0.1, size=(40, 5)):
        q[0] *= 0.75
        end = q + np.array([turn, 0.0, 0.0, 0.0, 0.0])
        branch, target, goal = branch_of(chain, q), ToolTarget.at(chain, end), q
        for _ in range(3):
            goal = track(chain, goal, target, branch=branch).best.q
        np.testing.assert_allclose(goal, end, atol=1e-6)
        branches.add(branch)
    assert len(branches) == 4


@pytest.mark.parametrize("priority", PRIORITIES)
def test_very_far_target_has_an_answer(chain: Chain, priority: Priority) -> None:
    for position in ([9.0, 9.0, 9.0], [0.0, 0.0, 0.0], [0.0, 0.0, 5.0], [-3.0, 0.0, -3.0]):
        target = ToolTarget(np.array(position), 40.0, -40.0)
        tracked = track(chain, READY, target, branch=FRONT_UP, priority=priority)
        assert np.isfinite(tracked.best.q).all()
        assert chain.within_limits(tracked.best.q)


def test_long_drag_continues_in_the_next_call(chain: Chain) -> None:
    """The target leaps half round the base: one call takes limited hops, the next continues."""
    since = ToolTarget.at(chain, READY)
    target = ToolTarget(np.array([-0.3, 0.3, 0.2]), since.pitch, since.roll)
    first = track(chain, READY, target, branch=FRONT_UP, since=since)
    assert first.since is not None
    assert math.dist(first.since.position, target.position) > 0.1
    for priority in (Priority.POSE, Priority.POSITION):
        best = arrived(chain, READY, target, since, priority).best
        assert np.allclose(forward(chain, best.q)[:3, 3], target.position, atol=1e-12)


@pytest.mark.parametrize("priority", PRIORITIES)
def test_one_call_searches_a_bounded_number_of_poses(
    chain: Chain, priority: Priority, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bound holds for any distance and any obstacle."""
    sought = 0

    def counted(*args: Any) -> NearestPosture:
        nonlocal sought
        sought += 1
        return nearest_posture(*args)

    monkeypatch.setattr(tracker, "nearest_posture", counted)
    rng = np.random.default_rng(3)
    maximum = 0
    for q in rng.uniform(chain.lower, chain.upper, size=(40, 5)):
        since = ToolTarget.at(chain, q)
        target = ToolTarget(rng.normal(size=3), since.pitch + 3.0 * rng.normal(), 0.0)
        before = sought
        track(chain, q, target, branch=branch_of(chain, q), priority=priority, since=since)
        maximum = max(maximum, sought - before)
    assert MAX_POSES // 2 < maximum <= MAX_POSES + 1


@pytest.mark.parametrize("priority", PRIORITIES)
@pytest.mark.parametrize("far", [1e3, 1e9, 1e300])
def test_very_long_drag_ends(chain: Chain, priority: Priority, far: float) -> None:
    since = ToolTarget.at(chain, READY)
    target = ToolTarget(far * np.array([0.4, 0.8, 0.4]), since.pitch, since.roll)
    best = arrived(chain, READY, target, since, priority).best
    assert np.isfinite(best.position_error)
    assert math.atan2(best.T[1, 3], best.T[0, 3]) == pytest.approx(math.atan2(0.8, 0.4), abs=1e-3)


def test_out_of_reach_the_tool_does_not_move_away() -> None:
    """Beside the roll axis a hop may turn the tool and lose a little of the position."""
    rng = np.random.default_rng(2)
    chain, _ = random_member(rng)
    middle, half = rng.uniform(-0.5, 0.5, 5), rng.uniform(1.0, 2.6, 5)
    chain = dataclasses.replace(chain, lower=middle - half, upper=middle + half)
    chain = chain.with_tool(chain.M @ random_pose(rng, 0.03))
    q = rng.uniform(chain.lower, chain.upper)
    branch, since = branch_of(chain, q), ToolTarget.at(chain, q)
    shift = rng.normal(size=3)
    shift *= 10.0 ** rng.uniform(-4.0, -1.6) / np.linalg.norm(shift)
    since = dataclasses.replace(since, position=3.0 * since.position)
    for k in range(12):
        pitch, roll = 0.3 * rng.normal(size=2) if k % 3 == 0 else (0.0, 0.0)
        target = ToolTarget(
            since.position + (shift if k < 6 else -shift), since.pitch + pitch, since.roll + roll
        )
        was = math.dist(forward(chain, q)[:3, 3], target.position)
        tracked = track(chain, q, target, branch=branch, since=since)
        while tracked.since is not None:
            tracked = track(chain, tracked.best.q, target, branch=branch, since=tracked.since)
        assert tracked.best.position_error <= was + 1e-8
        q, since = tracked.best.q, target


def test_unreachable_pitch_moves_nothing_away(chain: Chain) -> None:
    """With axes 2, 3 and 4 at their limits the pitch ends too, whatever the position would gain."""
    rng = np.random.default_rng(8)
    for number in range(300):
        side = number % 2
        q = rng.uniform(chain.lower, chain.upper)
        ends = (chain.lower, chain.upper)[side]
        q[1:4] = np.where(rng.random(3) < 0.8, ends[1:4], q[1:4])
        since = ToolTarget.at(chain, q)
        position = since.position + rng.normal(scale=0.05, size=3)
        pitch = since.pitch + (1.0 if side else -1.0) * rng.uniform(0.0, 1.5)
        target = ToolTarget(position, pitch, since.roll)
        tracked = track(chain, q, target, branch=branch_of(chain, q), priority=Priority.PITCH)
        pitch, _ = pitch_and_roll(chain, tracked.best.q)
        was, now = (math.remainder(p - target.pitch, math.tau) for p in (since.pitch, pitch))
        if np.abs(tracked.best.q - q).max() > HOP or tracked.beyond_gap is not None:
            assert abs(now) <= abs(was) + 1e-9
