"""Appearance of parts: the traits that can be changed, and their effect in a session."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects.scene_changes import PAINT, appearance_of
from katana450.arm.control.session.session import Session
from katana450.arm.control.state import solid
from katana450.arm.control.state.appearance import (
    AS_MADE,
    MAX_CHANGED_PARTS,
    Appearance,
    AppearanceTrait,
    DisplayMode,
    LinkAppearance,
)
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.errors import InputError
from katana450.maths.geometry import so3

fractions = st.floats(0.0, 1.0)
changes = st.one_of(
    st.tuples(st.just(AppearanceTrait.CHOICE), st.sampled_from([-1, 0, 1, 0.0, 1.0, None])),
    st.tuples(
        st.just(AppearanceTrait.COLOUR), st.none() | st.tuples(fractions, fractions, fractions)
    ),
    st.tuples(st.just(AppearanceTrait.TRANSPARENCY), st.none() | fractions),
)
names = st.sampled_from(["pan_link", "cup", "basin"])


@settings(max_examples=50)
@given(st.lists(st.tuples(names, changes), max_size=12))
def test_appearance_keeps_only_changed_parts(
    edits: list[tuple[str, tuple[AppearanceTrait, Any]]],
) -> None:
    looks, each_alone = Appearance(), dict.fromkeys(("pan_link", "cup", "basin"), AS_MADE)
    for name, (trait, value) in edits:
        looks = looks.having(name, trait, value)
        each_alone[name] = each_alone[name].having(trait, value)
    assert {name: looks.of(name) for name in each_alone} == each_alone
    assert dict(looks.changed) == {n: look for n, look in each_alone.items() if look != AS_MADE}
    assert pickle.loads(pickle.dumps(looks)) == looks


def test_new_paint_is_shown_until_all_of_it_is_restored() -> None:
    red = AS_MADE.having(AppearanceTrait.COLOUR, (1, 0, 0))
    assert red == LinkAppearance(DisplayMode.PAINTED, (1.0, 0.0, 0.0))
    glass = red.having(AppearanceTrait.TRANSPARENCY, 0.5)
    assert glass.having(AppearanceTrait.COLOUR, None).choice is DisplayMode.PAINTED
    assert (
        glass.having(AppearanceTrait.COLOUR, None).having(AppearanceTrait.TRANSPARENCY, None)
        == AS_MADE
    )
    hidden = red.having(AppearanceTrait.CHOICE, -1)
    assert hidden.having(AppearanceTrait.COLOUR, (0, 1, 0)) == LinkAppearance(
        DisplayMode.HIDDEN, (0.0, 1.0, 0.0)
    )


@pytest.mark.parametrize(
    ("trait", "value", "message"),
    [
        (AppearanceTrait.CHOICE, 2, "-1 for hidden"),
        (AppearanceTrait.CHOICE, 0.5, "-1 for hidden"),
        (AppearanceTrait.CHOICE, math.nan, "-1 for hidden"),
        (AppearanceTrait.COLOUR, (1.0, 0.0), "shape"),
        (AppearanceTrait.COLOUR, (1.0, 0.0, 1.1), "0 to 1"),
        (AppearanceTrait.COLOUR, (1.0, 0.0, math.nan), "finite"),
        (AppearanceTrait.COLOUR, ("1", "0", "0"), "numbers|values"),
        (AppearanceTrait.TRANSPARENCY, -0.1, "0 to 1"),
        (AppearanceTrait.TRANSPARENCY, math.inf, "finite"),
    ],
)
def test_invalid_appearance_is_refused(trait: AppearanceTrait, value: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        cmd.SetAppearance("pan_link", trait, value)
    with pytest.raises(InputError, match="1 to 100 characters"):
        cmd.SetAppearance("x" * 101, AppearanceTrait.CHOICE, 0)


def test_remembered_outcomes_are_bounded() -> None:
    looks = Appearance()
    for number in range(MAX_CHANGED_PARTS + 5):
        looks = looks.having(f"part {number}", AppearanceTrait.CHOICE, -1)
    assert len(looks.changed) == MAX_CHANGED_PARTS
    assert (
        looks.having("part 3", AppearanceTrait.CHOICE, 1).of("part 3").choice is DisplayMode.PAINTED
    )


def test_batch_is_executed_in_one_tick_or_not_at_all(session: Session) -> None:
    state = session.begin(session.ready, 0.0, 0.0)
    q = session.ready + np.array((0.1, 0.0, 0.05, 0.0, 0.0))
    batch = cmd.Batch(
        (
            cmd.SetAxes(((1, float(q[0])), (3, float(q[2])))),
            cmd.SetAppearance("pan_link", AppearanceTrait.CHOICE, -1),
        )
    )
    state = session.step(state, [batch], 0.01)
    np.testing.assert_array_equal(state.goal, q)
    assert state.appearance.of("pan_link").choice is DisplayMode.HIDDEN
    for bad in (cmd.SetAxes(((6, 0.0),)), cmd.Tool("spoon")):
        with pytest.raises(InputError):
            session.check(
                cmd.Batch((cmd.SetAppearance("pan_link", AppearanceTrait.CHOICE, 0), bad))
            )
    with pytest.raises(InputError, match="singly"):
        cmd.Batch((batch,))
    with pytest.raises(InputError, match="finite"):
        cmd.SetAxes(((1, math.nan),))


def test_stopped_arm_accepts_paint_but_no_motion(session: Session) -> None:
    state = session.step(session.begin(session.ready, 0.0, 0.0), [cmd.Stop()], 0.01)
    batch = cmd.Batch(
        (cmd.SetAxes(((1, 0.5),)), cmd.SetAppearance("cup", AppearanceTrait.CHOICE, -1))
    )
    state = session.step(state, [batch], 0.02)
    np.testing.assert_array_equal(state.goal, session.ready)
    assert appearance_of(state, "cup").choice is DisplayMode.HIDDEN


def test_object_moves_and_turns_separately_and_is_removed_with_its_paint(
    session: Session,
) -> None:
    cube = SceneObject("cube", Shape.BOX, (0.1, 0.1, 0.1), np.eye(4))
    state = session.begin(session.ready, 0.0, 0.0)
    R = so3.rotation_z(0.4)
    state = session.step(
        state,
        [
            cmd.PlaceObject(cube),
            cmd.SetAppearance("cube", AppearanceTrait.COLOUR, (0.0, 0.0, 1.0)),
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
    assert scene_object.appearance == solid.ObjectAppearance((0, 0, 255))
    assert appearance_of(state, "cube") == LinkAppearance(DisplayMode.PAINTED, (0.0, 0.0, 1.0))
    for trait, value, look in (
        (AppearanceTrait.TRANSPARENCY, 0.4, solid.ObjectAppearance((0, 0, 255), 0.6)),
        (AppearanceTrait.CHOICE, -1, solid.ObjectAppearance((0, 0, 255), 0.6, hidden=True)),
        (AppearanceTrait.CHOICE, 1, solid.ObjectAppearance((0, 0, 255), 0.6)),
        (AppearanceTrait.TRANSPARENCY, 1.0, solid.ObjectAppearance((0, 0, 255), solid.MIN_OPACITY)),
        (AppearanceTrait.CHOICE, 0, solid.PLAIN),
        (AppearanceTrait.CHOICE, 1, solid.ObjectAppearance(PAINT)),
        (AppearanceTrait.COLOUR, None, solid.PLAIN),
    ):
        state = session.step(state, [cmd.SetAppearance("cube", trait, value)], 0.02)
        assert state.objects[0].appearance == look
    removed = session.step(state, [cmd.Remove("cube")], 0.02)
    assert (removed.objects, removed.appearance) == ((), Appearance())
    for bad in ({"position": np.array((0.0, 0.0, 9.0))}, {"R": np.ones((3, 3))}):
        with pytest.raises(InputError, match="cube"):
            cmd.MoveObject("cube", **bad)
