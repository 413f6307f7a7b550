"""The table under robots that are driven joint by joint: its height, and what is checked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from katana450.arm.robot.loader import load
from katana450.assembly.robot_session import find_arm
from katana450.extensions.bodies.robot_world import robot_world
from katana450.maths.collision.world import CollisionWorld
from tests.general_arms.links_of_arms import ur5e
from tests.robot.hands import column, hand, rail
from tests.robot.urdf_files import saved


def read(tmp_path: Path, text: str) -> tuple[CollisionWorld, tuple[str, ...]]:
    world, notes, _ = robot_world(load(saved(tmp_path, text)))
    assert world is not None
    return world, notes


def table_of(world: CollisionWorld) -> float:
    (table,) = (part for part in world.parts if part.name == "table")
    return float(table.T_mover_shape[0][2, 3])


def over_the_table(world: CollisionWorld) -> set[str]:
    """Return the names of the parts that are checked against the table."""
    number = [part.name for part in world.parts].index("table")
    return {world.parts[a].name for a, b in world.pairs if b == number}


@pytest.mark.parametrize("foot", [0.0, -0.3, -2e-5])
def test_table_is_under_the_lowest_point(tmp_path: Path, foot: float) -> None:
    world, notes = read(tmp_path, column(foot))
    assert table_of(world) == pytest.approx(0.0 if foot > -1e-4 else foot, abs=1e-6)
    assert over_the_table(world) == {"beam"}
    wanted = ("The table is 300 mm below the base, under base.",) if foot < -1e-4 else ()
    assert notes == wanted


def test_table_is_at_the_base_of_a_robot_that_is_higher(tmp_path: Path) -> None:
    world, notes = read(tmp_path, rail())
    assert (table_of(world), notes) == (0.0, ())
    assert over_the_table(world) == {"left", "right", "follower"}


def test_every_finger_of_a_hand_may_meet_the_table_under_its_palm(tmp_path: Path) -> None:
    world, notes = read(tmp_path, hand())
    assert (table_of(world), notes) == (0.0, ())
    assert over_the_table(world) == {part.name for part in world.parts} - {"palm", "table"}


def test_wheel_stands_on_the_table_and_is_not_checked_against_it(tmp_path: Path) -> None:
    world, notes = read(tmp_path, column(-0.1, carried="wheel"))
    assert table_of(world) == pytest.approx(-0.1, abs=1e-6)
    assert over_the_table(world) == {"beam"}
    assert notes == (
        "The table is 100 mm below the base, under wheel.",
        "Not checked against the table, which they touch: wheel.",
    )


def test_robot_that_can_move_its_lowest_part_down_has_no_table(tmp_path: Path) -> None:
    # Without its column the beam is all there is, and hangs below the base.
    text = column(-0.5).replace('<box size="0.06 0.06 0.4"/>', '<box size="0.06 0.06 0.1"/>')
    text = text.replace(f'xyz="0.0 0 {-0.5 + 0.2}"', 'xyz="0.0 0 0.2"')
    world, notes = read(tmp_path, text)
    assert "table" not in {part.name for part in world.parts}
    (note,) = notes
    assert note.startswith("No table is checked, because nothing says where the robot stands: beam")


def test_part_that_is_near_the_table_at_rest_keeps_half_of_its_distance(tmp_path: Path) -> None:
    low = column().replace('xyz="0 0 0.35"', 'xyz="0 0 0.024"').replace('"-0.4"', '"-0.01"')
    world, _ = read(tmp_path, low)
    number = [part.name for part in world.parts].index("table")
    distances = {world.parts[a].name: d for (a, b), d in world.close.items() if b == number}
    assert distances == {"beam": pytest.approx(2e-3, abs=1e-6)}


def test_arm_has_its_table_in_its_session(tmp_path: Path) -> None:
    path = saved(tmp_path, ur5e())
    world, _, _ = robot_world(load(path, find=find_arm))
    assert world is not None
    assert "table" not in {part.name for part in world.parts}
    # Without its arm it is driven joint by joint, and has one.
    world, _, _ = robot_world(load(path))
    assert world is not None
    np.testing.assert_allclose(table_of(world), 0.0)
