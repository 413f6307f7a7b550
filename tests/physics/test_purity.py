"""A step depends on the motion and the bodies alone, to the bit."""

from __future__ import annotations

import hashlib
import pickle
import subprocess
import sys

import numpy as np
import pytest

from katana450.maths.collision.shape import box, cylinder, sphere
from katana450.maths.collision.world import Part
from katana450.maths.geometry import so3
from katana450.maths.physics.body import BodyMotion
from tests.physics.scenes import HALF, TABLE, Scene, body, pose, same_bits, slider, with_velocity

TICKS = 40
"""Ticks of the whole motion."""


def scene() -> Scene:
    """Return bodies that fall onto others, roll, and are pushed by a link."""
    hand = Part("hand", 1, (pose(-0.06, 0.0, 0.02),), (box((0.02, 0.1, 0.04)),))
    tilted = so3.rotation_x(0.4) @ so3.rotation_y(0.3)
    bodies = {
        body("lower"): pose(0.0, 0.0, HALF),
        body("upper"): pose(0.01, 0.0, 4.0 * HALF, tilted),
        body("ball", sphere(0.02)): pose(0.0, 0.1, 0.1),
        body("can", cylinder(0.02, 0.08)): pose(0.05, 0.02, 0.2, tilted),
        body("resting"): pose(0.1, 0.0, HALF),
    }
    return Scene(bodies, TABLE, hand, linkage=slider())


def first(bodies: Scene) -> BodyMotion:
    return with_velocity(bodies.begin("resting"), "ball", 0.5, -0.5, 0.0)


def course(bodies: Scene) -> list[BodyMotion]:
    """Return the motions of a course in which the link moves at 0.1 m/s."""
    return [*bodies.motions(first(bodies), 0.01 * TICKS, speed=0.1)]


def digest() -> str:
    """Return a digest of the whole course."""
    course_hash = hashlib.sha256()
    for motion in course(scene()):
        for values in (motion.place, motion.velocity, motion.memory, motion.rest_time):
            course_hash.update(values.tobytes())
    return course_hash.hexdigest()


@pytest.fixture(scope="module")
def motions() -> list[BodyMotion]:
    return course(scene())


def test_course_has_contacts_and_wakes_what_rested(motions: list[BodyMotion]) -> None:
    assert not motions[-1].resting.all()
    assert np.abs(motions[-1].place[-1] - motions[0].place[-1]).max() > 1e-3


def test_another_simulation_continues_with_the_same_bits(motions: list[BodyMotion]) -> None:
    # It has passed through other states before.
    used = scene()
    used.after(used.begin(), 0.1)
    again = course(used)
    assert [*map(same_bits, motions, again)] == [True] * TICKS


@pytest.mark.parametrize("number", range(4, TICKS, 7))
def test_interrupted_motion_continues_with_the_same_bits(
    motions: list[BodyMotion], number: int
) -> None:
    stored = pickle.loads(pickle.dumps(motions[number]))
    continued = scene()
    motion = continued.simulation.begin(continued.poses, stored, (), ())
    for tick in range(number + 1, min(number + 6, TICKS)):
        x, towards = (np.array((0.1 * 0.01 * (tick + step),)) for step in (0, 1))
        motion = continued.simulation.step(motion, x, towards, 0.01)
        assert same_bits(motion, motions[tick])


def test_step_changes_none_of_its_arguments() -> None:
    bodies = scene()
    motion = first(bodies)
    before = pickle.dumps(motion)
    x = np.zeros(1)
    once, again = (bodies.simulation.step(motion, x, x, 0.01) for _ in range(2))
    assert pickle.dumps(motion) == before
    assert same_bits(once, again)
    with pytest.raises(ValueError, match="read-only"):
        once.place[0, 0] = 1.0


def test_another_process_finds_the_same_bits() -> None:
    code = "from tests.physics.test_purity import digest; print(digest())"
    process = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert process.stdout.strip() == digest()


def test_motion_of_other_bodies_begins_without_their_forces(motions: list[BodyMotion]) -> None:
    bodies = scene()
    fewer = Scene({body("upper"): bodies.poses["upper"], body("new"): pose(0.3, 0.3, HALF)})
    motion = fewer.simulation.begin(fewer.poses, motions[-1], (), ())
    assert motion.names == ("upper", "new")
    assert (motion.place[0] == motions[-1].place[1]).all()
    assert (motion.velocity[0] == motions[-1].velocity[1]).all()
    assert motion.resting[1]
    assert not motion.memory.any()


def test_motion_is_continued_among_other_links(motions: list[BodyMotion]) -> None:
    still = scene()
    alone = Scene({piece: still.poses[piece.name] for piece in still.bodies})
    motion = alone.simulation.begin(alone.poses, motions[-1], (), ())
    after = alone.after(motion, 0.1)
    assert np.isfinite(after.place).all()
    assert len(after.memory) == 6 * len(after.names)
