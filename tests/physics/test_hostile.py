"""Scenes that no one builds on purpose: every motion is finite and slow, and nothing is written."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from katana450.maths.collision.shape import box, sphere
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import frozen
from katana450.maths.physics import model
from katana450.maths.physics.model import BodyMotion
from katana450.maths.physics.simulation import MAX_SPEED, PARTING_SPEED
from tests.physics.scenes import CUBE, HALF, SIDE, Scene, body, pose, position
from tests.ticks import TICK

ROOT = Path(__file__).parents[2]


def speeds(motion: BodyMotion) -> tuple[float, float]:
    """Return the greatest linear [m/s] and angular speed [rad/s]."""
    lengths = np.linalg.norm(motion.velocity.reshape(-1, 2, 3), axis=2)
    linear, angular = lengths.max(axis=0).tolist()
    return linear, angular


def check_bounded(scene: Scene, seconds: float, fastest: float = MAX_SPEED) -> BodyMotion:
    """Return the last motion, after checking that each is finite and no place jumps."""
    before = motion = scene.begin()
    for motion in scene.motions(before, seconds):
        assert all(np.isfinite(values).all() for values in (motion.place, motion.memory))
        linear, angular = speeds(motion)
        assert linear <= fastest * (1.0 + 1e-9)
        assert angular <= 10.0 * MAX_SPEED * (1.0 + 1e-9)
        ways = np.linalg.norm(motion.place[:, :3] - before.place[:, :3], axis=1)
        assert ways.max() <= 1.1 * TICK * fastest
        before = motion
    return motion


def heap(count: int, spread: float) -> Scene:
    """Return boxes in each other, ``spread`` [m] round one place."""
    rng = np.random.default_rng(450)
    places = rng.uniform(-spread, spread, (count, 2)).tolist()
    return Scene({body(f"box {n}"): pose(x, y, HALF) for n, (x, y) in enumerate(places)})


@pytest.mark.parametrize("spread", [0.0, 0.01])
def test_two_bodies_in_each_other_part_slowly(spread: float) -> None:
    scene = Scene({body("one"): pose(0.0, 0.0, HALF), body("two"): pose(spread, 0.0, HALF + 1e-3)})
    motion = check_bounded(scene, 0.1, fastest=PARTING_SPEED)
    assert np.linalg.norm(position(motion, "two") - position(motion, "one")) > 5e-3
    motion = scene.after(motion, 2.0)
    assert np.linalg.norm(position(motion, "two") - position(motion, "one")) > SIDE - 1e-3


@pytest.mark.parametrize("spread", [0.0, 0.05])
def test_many_bodies_in_each_other_part(spread: float) -> None:
    scene = heap(64, spread)
    motion = check_bounded(scene, 0.3, fastest=1.0)
    assert motion.place[:, 2].min() > 0.0
    assert np.ptp(motion.place[:, :2], axis=0).min() > 2.0 * 0.3 * 0.8 * PARTING_SPEED


@pytest.mark.long
@pytest.mark.parametrize("spread", [0.0, 0.01, 0.03, 0.05, 0.1])
def test_heap_settles_without_overlaps(spread: float) -> None:
    scene = heap(64, spread)
    before = scene.after(check_bounded(scene, 3.0, fastest=5.0), 22.0)
    motion = scene.after(before, 3.0)
    # Boxes that lean on others may still rock, and move what touches them.
    assert np.count_nonzero(motion.resting) > 32
    ways = np.linalg.norm(motion.place[:, :3] - before.place[:, :3], axis=1)
    assert np.median(ways) < 1e-3
    assert ways.max() < HALF
    assert np.abs(motion.place[:, :2]).max() < 1.0
    middles = motion.place[:, :3]
    apart = np.linalg.norm(middles[:, None] - middles, axis=2) + np.eye(64)
    assert apart.min() > SIDE - 2e-3
    assert middles[:, 2].min() > HALF - 1e-3


def test_needle_falls_and_lies_still() -> None:
    tilted = so3.rotation_y(0.5)
    needle = body("needle", box((1e-3, 1e-3, 0.2)), mass=1e-4)
    scene = Scene({needle: pose(0.0, 0.0, 0.3, tilted), body("box"): pose(0.03, 0.0, HALF)})
    motion = scene.after(check_bounded(scene, 1.0), 3.0)
    assert motion.resting.all()
    assert 0.0 < position(motion, "needle")[2] < 0.12


@pytest.mark.parametrize("heavy_above", [False, True])
def test_masses_of_ratio_a_million_stay_on_each_other(heavy_above: bool) -> None:
    masses = (1e-3, 1e3) if heavy_above else (1e3, 1e-3)
    lower, upper = (body(f"box {n}", mass=mass) for n, mass in enumerate(masses))
    scene = Scene({lower: pose(0.0, 0.0, HALF), upper: pose(0.0, 0.0, 3.0 * HALF + 0.05)})
    motion = check_bounded(scene, 1.0)
    # A ton presses a gram into the table, but not through it.
    assert motion.place[:, 2].min() > -HALF
    assert np.abs(motion.place[:, :2]).max() < 0.5
    if not heavy_above:
        assert position(motion, "box 1")[2] == pytest.approx(3.0 * HALF, abs=1e-3)


@pytest.mark.parametrize("depth", [0.02, 0.049, 0.2])
def test_body_deep_in_the_table_comes_out_slowly(depth: float) -> None:
    scene = Scene({body("box"): pose(0.0, 0.0, HALF - depth)})
    motion = check_bounded(scene, 0.05, fastest=PARTING_SPEED)
    motion = scene.after(motion, depth / PARTING_SPEED + 1.5)
    assert position(motion, "box") == pytest.approx((0.0, 0.0, HALF), abs=2e-3)


def test_light_bodies_of_a_micrometre_and_a_gram_are_bounded() -> None:
    scene = Scene({
        body("dust", sphere(1e-3), mass=1e-6): pose(0.0, 0.0, 0.1),
        body("block", box((0.3, 0.3, 0.3)), mass=1e3): pose(0.0, 0.0, 0.3),
    })  # fmt: skip
    check_bounded(scene, 0.6)


def test_speeds_are_limited() -> None:
    scene = Scene({body("box"): pose(0.0, 0.0, 1.0)})
    start = scene.begin()
    fast = replace(start, velocity=frozen(np.full((1, 6), 1e6)))
    motion = scene.after(fast, 0.05)
    linear, angular = speeds(motion)
    assert linear <= MAX_SPEED * (1.0 + 1e-9)
    assert angular <= 10.0 * MAX_SPEED * (1.0 + 1e-9)
    assert np.linalg.norm(position(motion, "box") - (0.0, 0.0, 1.0)) <= 1.1 * 0.05 * MAX_SPEED


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300])
def test_motion_that_is_not_finite_leaves_bodies_where_they_were(value: float) -> None:
    scene = Scene({body("box"): pose(0.1, 0.2, 1.0), body("other"): pose(0.3, 0.0, 1.0)})
    start = scene.begin()
    velocity = np.zeros((2, 6))
    velocity[0, 0] = value
    motion = scene.after(replace(start, velocity=frozen(velocity)), TICK)
    assert np.isfinite(motion.place).all()
    assert np.isfinite(motion.velocity).all()
    assert np.abs(motion.place - start.place).max() <= 1.1 * TICK * MAX_SPEED


def test_contacts_beyond_the_memory_leave_bodies_where_they_were(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(model, "MEMORY", 1 << 18)
    scene = heap(12, 0.02)
    start = scene.begin()
    motion = scene.after(start, TICK)
    assert motion.place.tobytes() == start.place.tobytes()
    assert scene.after(motion, 0.5).resting.all()


QUIET = """
import numpy as np
from dataclasses import replace
from katana450.maths.geometry.arrays import frozen
from tests.physics.test_hostile import Scene, body, heap, pose
scene = Scene({body("box"): pose(0.0, 0.0, 1.0)})
scene.after(replace(scene.begin(), velocity=frozen(np.full((1, 6), 1e300))), 0.01)
scene = heap(20, 0.0)
scene.after(scene.begin(), 0.05)
"""


def test_engine_writes_no_warning(tmp_path: Path) -> None:
    path = f"import sys; sys.path[:0] = [{str(ROOT)!r}]\n"
    process = subprocess.run(
        [sys.executable, "-c", path + QUIET],
        cwd=tmp_path, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert (process.stdout, process.stderr) == ("", "")
    assert not list(tmp_path.iterdir())


def test_flat_and_usual_bodies_make_no_heap() -> None:
    # Plates on each other and boxes side by side do not overlap, so that each has its contacts.
    plates = {
        body(f"plate {n}", box((0.1, 0.1, 0.004))): pose(0.0, 0.0, 2e-3 + 4e-3 * n)
        for n in range(8)
    }
    boxes = {body(f"box {n}", CUBE): pose(0.2 + SIDE * n, 0.0, HALF) for n in range(8)}
    scene = Scene(plates | boxes)
    motion = scene.after(scene.begin(), 1.0)
    drift = motion.place[:, :3] - [T[:3, 3] for T in scene.poses.values()]
    assert np.linalg.norm(drift, axis=1).max() < 1e-3
    assert motion.resting.all()
