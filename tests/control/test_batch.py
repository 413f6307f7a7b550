"""Batches, and commands about objects that move no joint."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.errors import InputError
from katana450.maths.geometry import so3

CUBE = SceneObject("cube", Shape.BOX, (0.1, 0.1, 0.1), np.eye(4))


def test_batch_is_executed_in_one_tick_or_not_at_all(session: Session) -> None:
    state = session.begin(session.ready, 0.0, 0.0)
    q = session.ready + np.array((0.1, 0.0, 0.05, 0.0, 0.0))
    batch = cmd.Batch(
        (cmd.SetAxes(((1, float(q[0])), (3, float(q[2])))), cmd.PlaceObject(CUBE)),
    )
    state = session.step(state, [batch], 0.01)
    np.testing.assert_array_equal(state.goal, q)
    assert state.objects == (CUBE,)
    for bad in (cmd.SetAxes(((6, 0.0),)), cmd.Tool("spoon")):
        with pytest.raises(InputError):
            session.check(cmd.Batch((cmd.PlaceObject(CUBE), bad)))
    with pytest.raises(InputError, match="singly"):
        cmd.Batch((batch,))
    with pytest.raises(InputError, match="finite"):
        cmd.SetAxes(((1, math.nan),))


def test_stopped_arm_accepts_objects_but_no_motion(session: Session) -> None:
    state = session.step(session.begin(session.ready, 0.0, 0.0), [cmd.Stop()], 0.01)
    batch = cmd.Batch((cmd.SetAxes(((1, 0.5),)), cmd.PlaceObject(CUBE)))
    state = session.step(state, [batch], 0.02)
    np.testing.assert_array_equal(state.goal, session.ready)
    assert state.objects == (CUBE,)


def test_object_moves_and_turns_separately_unless_it_is_held(session: Session) -> None:
    state = session.begin(session.ready, 0.0, 0.0)
    R = so3.rotation_z(0.4)
    state = session.step(
        state,
        [
            cmd.PlaceObject(CUBE),
            cmd.MoveObject("cube", position=np.array((0.3, 0.1, 0.0))),
            cmd.MoveObject("cube", R=R),
            cmd.MoveObject("nothing", R=R),
        ],
        0.01,
    )
    (scene_object,) = state.objects
    np.testing.assert_array_equal(scene_object.T[:3, 3], (0.3, 0.1, 0.0))
    np.testing.assert_allclose(scene_object.T[:3, :3], R, rtol=0, atol=1e-15)
    held = replace(state, objects=(replace(scene_object, held=True),))
    moved = session.step(held, [cmd.MoveObject("cube", position=np.zeros(3))], 0.02)
    np.testing.assert_array_equal(moved.objects[0].T, scene_object.T)
    assert session.step(state, [cmd.Remove("cube")], 0.02).objects == ()
    for bad in ({"position": np.array((0.0, 0.0, 9.0))}, {"R": np.ones((3, 3))}):
        with pytest.raises(InputError, match="cube"):
            cmd.MoveObject("cube", **bad)
