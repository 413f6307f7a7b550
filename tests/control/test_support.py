"""Loose objects in the air are refused, and parts of the work cell may hang there."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects.environment import Environment
from katana450.arm.control.objects.support import check_carried, check_mounted, is_loose
from katana450.arm.control.state.scene_objects import Attachment, SceneObject, Shape
from katana450.assembly.robot_session import describe_robot
from katana450.errors import InputError
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.environment import TableTop
from katana450.resources import URDF_PATH
from katana450.settings import Settings

TABLE = TableTop((-0.25, 0.75), (-0.7, 0.7), -0.025)


def at(x: float, y: float, z: float, R: FloatArray | None = None) -> FloatArray:
    return se3.from_rotation_translation(np.eye(3) if R is None else R, (x, y, z))


def can(T: FloatArray, name: str = "can") -> SceneObject:
    return SceneObject(name, Shape.CYLINDER, (0.03, 0.1), T, can_be_held=True)


def crate(T: FloatArray) -> SceneObject:
    return SceneObject("crate", Shape.BOX, (0.2, 0.1, 0.15), T)


@pytest.mark.parametrize(("x", "y"), [(0.3, 0.0), (-0.249, 0.0), (0.749, 0.699), (0.0, -0.699)])
def test_table_carries_objects_whose_middle_is_over_it(x: float, y: float) -> None:
    check_carried(TABLE, (), can(at(x, y, 0.0)))


@pytest.mark.parametrize(("x", "y"), [(1.5, 0.0), (-0.251, 0.0), (0.0, 0.701), (0.751, -0.701)])
def test_object_beyond_the_table_is_refused(x: float, y: float) -> None:
    with pytest.raises(InputError, match="nothing carries it there") as refused:
        check_carried(TABLE, (), can(at(x, y, 0.0)))
    assert f"x {1e3 * x:.1f}, y {1e3 * y:.1f} mm" in str(refused.value)
    assert "from x -250 to 750 and from y -700 to 700 mm" in str(refused.value)


def test_object_above_the_table_is_in_the_air() -> None:
    with pytest.raises(InputError, match=r"120\.0 mm above its support"):
        check_carried(TABLE, (), can(at(0.3, 0.0, 0.12)))


def test_object_may_fall_on_the_table_but_not_beside_it() -> None:
    check_carried(TABLE, (), can(at(0.3, 0.0, 0.12)), may_fall=True)
    with pytest.raises(InputError, match="nothing carries it there"):
        check_carried(TABLE, (), can(at(1.5, 0.0, 0.12)), may_fall=True)


def test_object_lying_on_its_side_stands_on_its_lowest_point() -> None:
    lying = so3.rotation_y(np.pi / 2.0)
    check_carried(TABLE, (), can(at(0.3, 0.0, 0.03, lying)))
    with pytest.raises(InputError, match=r"20\.0 mm above"):
        check_carried(TABLE, (), can(at(0.3, 0.0, 0.05, lying)))


def test_object_stands_on_another_one() -> None:
    below = crate(at(0.3, 0.2, 0.0, so3.rotation_z(np.pi / 2.0)))
    check_carried(TABLE, (below,), can(at(0.3, 0.29, 0.15)))
    with pytest.raises(InputError, match=r"150\.0 mm above"):
        check_carried(TABLE, (below,), can(at(0.39, 0.2, 0.15)))
    beyond = crate(at(1.5, 0.0, 0.0))
    check_carried(TABLE, (beyond,), can(at(1.5, 0.0, 0.15)))


def test_only_work_cell_parts_may_hang_in_the_air() -> None:
    far = at(1.5, 0.0, 0.4)
    assert not is_loose(crate(far))
    assert is_loose(can(far))
    assert is_loose(SceneObject("basin", Shape.CYLINDER, (0.1, 0.1), far))


def test_scene_with_the_cup_in_the_air_is_refused_as_a_whole() -> None:
    session = describe_robot(Settings(), URDF_PATH, None).session
    table = session.environment.table
    assert table is not None
    assert (table.x, table.y) == (TABLE.x, TABLE.y)
    session.check(cmd.ReplaceScene((can(at(0.3, 0.0, 0.0)), crate(at(1.5, 0.0, 0.4)))))
    with pytest.raises(InputError, match="can would be in the air"):
        session.check(cmd.ReplaceScene((can(at(1.5, 0.0, 0.0)), crate(at(0.5, 0.3, 0.0)))))
    session.check(cmd.ReplaceScene((can(at(1.5, 0.0, 0.15)), crate(at(1.5, 0.0, 0.0)))))


def test_detached_object_may_fall_on_the_table_but_not_beside_it() -> None:
    rules = describe_robot(Settings(), URDF_PATH, None).session
    x = rules.begin(rules.ready, 0.0, 0.0).x
    around: Environment = rules.environment
    held = around.mounted(can(at(0.3, 0.0, 0.3)), Attachment.HAND, x)
    assert held.fixed
    for to in (Attachment.TABLE, Attachment.WORLD):
        check_mounted(around, (), held, to, x)
    outside = around.mounted(can(at(1.5, 0.0, 0.3)), Attachment.HAND, x)
    with pytest.raises(InputError, match="nothing carries it there"):
        check_mounted(around, (), outside, Attachment.WORLD, x)
    camera = around.mounted(crate(at(0.3, 0.0, 0.3)), Attachment.HAND, x)
    check_mounted(around, (), camera, Attachment.WORLD, x)
    mounted = around.mounted(crate(at(0.3, 0.9, 0.3)), Attachment.HAND, x)
    with pytest.raises(InputError, match="nothing carries it there"):
        check_mounted(around, (), mounted, Attachment.TABLE, x)
