"""How parts are shown: what can be changed of it, and what a session makes of that."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.arm.control import commands as cmd
from katana450.arm.control import solid
from katana450.arm.control.arrangement import PAINT, look_of
from katana450.arm.control.looks import AS_MADE, MOST, Choice, Look, Looks, Trait
from katana450.arm.control.session import Session
from katana450.arm.control.things import Form, Thing
from katana450.errors import InputError
from katana450.maths.geometry import so3

shares = st.floats(0.0, 1.0)
changes = st.one_of(
    st.tuples(st.just(Trait.CHOICE), st.sampled_from([-1, 0, 1, 0.0, 1.0, None])),
    st.tuples(st.just(Trait.COLOUR), st.none() | st.tuples(shares, shares, shares)),
    st.tuples(st.just(Trait.TRANSPARENCY), st.none() | shares),
)
names = st.sampled_from(["pan_link", "cup", "basin"])


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(names, changes), max_size=12))
def test_only_what_looks_otherwise_is_kept_and_each_part_is_changed_alone(
    said: list[tuple[str, tuple[Trait, Any]]],
) -> None:
    looks, each_alone = Looks(), dict.fromkeys(("pan_link", "cup", "basin"), AS_MADE)
    for name, (trait, value) in said:
        looks = looks.having(name, trait, value)
        each_alone[name] = each_alone[name].having(trait, value)
    assert {name: looks.of(name) for name in each_alone} == each_alone
    assert dict(looks.changed) == {n: look for n, look in each_alone.items() if look != AS_MADE}
    assert pickle.loads(pickle.dumps(looks)) == looks


def test_paint_is_seen_at_once_and_goes_when_none_of_it_is_left() -> None:
    red = AS_MADE.having(Trait.COLOUR, (1, 0, 0))
    assert red == Look(Choice.PAINTED, (1.0, 0.0, 0.0))
    glass = red.having(Trait.TRANSPARENCY, 0.5)
    assert glass.having(Trait.COLOUR, None).choice is Choice.PAINTED
    assert glass.having(Trait.COLOUR, None).having(Trait.TRANSPARENCY, None) == AS_MADE
    hidden = red.having(Trait.CHOICE, -1)
    assert hidden.having(Trait.COLOUR, (0, 1, 0)) == Look(Choice.HIDDEN, (0.0, 1.0, 0.0))


@pytest.mark.parametrize(
    ("trait", "value", "said"),
    [
        (Trait.CHOICE, 2, "-1 for hidden"),
        (Trait.CHOICE, 0.5, "-1 for hidden"),
        (Trait.CHOICE, math.nan, "-1 for hidden"),
        (Trait.COLOUR, (1.0, 0.0), "shape"),
        (Trait.COLOUR, (1.0, 0.0, 1.1), "0 to 1"),
        (Trait.COLOUR, (1.0, 0.0, math.nan), "finite"),
        (Trait.COLOUR, ("1", "0", "0"), "numbers|values"),
        (Trait.TRANSPARENCY, -0.1, "0 to 1"),
        (Trait.TRANSPARENCY, math.inf, "finite"),
    ],
)
def test_what_is_no_look_is_refused_at_the_door(trait: Trait, value: Any, said: str) -> None:
    with pytest.raises(InputError, match=said):
        cmd.Dress("pan_link", trait, value)
    with pytest.raises(InputError, match="1 to 100 characters"):
        cmd.Dress("x" * 101, Trait.CHOICE, 0)


def test_there_is_an_end_to_what_is_remembered() -> None:
    looks = Looks()
    for number in range(MOST + 5):
        looks = looks.having(f"part {number}", Trait.CHOICE, -1)
    assert len(looks.changed) == MOST
    assert looks.having("part 3", Trait.CHOICE, 1).of("part 3").choice is Choice.PAINTED


def test_what_is_said_together_happens_in_one_tick_or_not_at_all(session: Session) -> None:
    state = session.begin(session.ready, 0.0, 0.0)
    q = session.ready + np.array((0.1, 0.0, 0.05, 0.0, 0.0))
    said = cmd.Batch(
        (
            cmd.SetAxes(((0, float(q[0])), (2, float(q[2])))),
            cmd.Dress("pan_link", Trait.CHOICE, -1),
        )
    )
    state = session.step(state, [said], 0.01)
    np.testing.assert_array_equal(state.goal, q)
    assert state.looks.of("pan_link").choice is Choice.HIDDEN
    for bad in (cmd.SetAxes(((5, 0.0),)), cmd.SetTool("spoon")):
        with pytest.raises(InputError):
            session.check(cmd.Batch((cmd.Dress("pan_link", Trait.CHOICE, 0), bad)))
    with pytest.raises(InputError, match="singly"):
        cmd.Batch((said,))
    with pytest.raises(InputError, match="finite"):
        cmd.SetAxes(((0, math.nan),))


def test_a_stop_lets_parts_be_painted_and_no_joint_be_moved(session: Session) -> None:
    state = session.step(session.begin(session.ready, 0.0, 0.0), [cmd.Stop()], 0.01)
    said = cmd.Batch((cmd.SetAxes(((0, 0.5),)), cmd.Dress("cup", Trait.CHOICE, -1)))
    state = session.step(state, [said], 0.02)
    np.testing.assert_array_equal(state.goal, session.ready)
    assert look_of(state, "cup").choice is Choice.HIDDEN


def test_a_thing_is_shifted_by_halves_and_takes_its_paint_with_it_when_it_goes(
    session: Session,
) -> None:
    cube = Thing("cube", Form.BOX, (0.1, 0.1, 0.1), np.eye(4))
    state = session.begin(session.ready, 0.0, 0.0)
    R = so3.rotation_z(0.4)
    state = session.step(
        state,
        [
            cmd.Place(cube),
            cmd.Dress("cube", Trait.COLOUR, (0.0, 0.0, 1.0)),
            cmd.Shift("cube", position=np.array((0.3, 0.1, 0.0))),
            cmd.Shift("cube", R=R),
            cmd.Shift("nothing", R=R),
        ],
        0.01,
    )
    (thing,) = state.things
    np.testing.assert_array_equal(thing.T[:3, 3], (0.3, 0.1, 0.0))
    np.testing.assert_allclose(thing.T[:3, :3], R, rtol=0, atol=1e-15)
    held = replace(state, things=(replace(thing, held=True),))
    moved = session.step(held, [cmd.Shift("cube", position=np.zeros(3))], 0.02)
    np.testing.assert_array_equal(moved.things[0].T, thing.T)
    assert thing.look == solid.Look((0, 0, 255))
    assert look_of(state, "cube") == Look(Choice.PAINTED, (0.0, 0.0, 1.0))
    for trait, value, look in (
        (Trait.TRANSPARENCY, 0.4, solid.Look((0, 0, 255), 0.6)),
        (Trait.CHOICE, -1, solid.Look((0, 0, 255), 0.6, hidden=True)),
        (Trait.CHOICE, 1, solid.Look((0, 0, 255), 0.6)),
        (Trait.TRANSPARENCY, 1.0, solid.Look((0, 0, 255), solid.FAINTEST)),
        (Trait.CHOICE, 0, solid.PLAIN),
        (Trait.CHOICE, 1, solid.Look(PAINT)),
        (Trait.COLOUR, None, solid.PLAIN),
    ):
        state = session.step(state, [cmd.Dress("cube", trait, value)], 0.02)
        assert state.things[0].look == look
    gone = session.step(state, [cmd.Remove("cube")], 0.02)
    assert (gone.things, gone.looks) == ((), Looks())
    for bad in ({"position": np.array((0.0, 0.0, 9.0))}, {"R": np.ones((3, 3))}):
        with pytest.raises(InputError, match="cube"):
            cmd.Shift("cube", **bad)
