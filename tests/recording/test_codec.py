"""Every command and every state of random sessions survives its text form to the bit."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable
from contextlib import suppress
from copy import deepcopy
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from msgspec import Struct, msgpack

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.commands.act import classes_of
from katana450.arm.control.lease import SERVER, Actor, CommandChannel, Grounds, Person, Role
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.modes import Target, Tracking
from katana450.arm.control.state.scene_objects import Attachment, SceneObject, Shape
from katana450.arm.control.state.solid import Solid
from katana450.arm.control.state.state import Finding, Reason, State
from katana450.arm.control.state.stop_cause import pressed
from katana450.arm.robot.props import load_props, water_environment
from katana450.extensions.programs.planning.curve_path import ToolPath
from katana450.extensions.programs.planning.curves import (
    Curve,
    Linear,
    Swing,
    ToolArc,
    ToolLine,
    ToolLines,
    ToolTurn,
    TurnedCurve,
)
from katana450.extensions.recording.codec import Codec, form_of, key_of, recorded_classes
from katana450.extensions.recording.former_forms import target_content
from katana450.extensions.recording.forms import (
    MAX_TEXT_BYTES,
    FormError,
    json_form,
    json_text,
)
from katana450.extensions.recording.ticks import Digester
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import branch_of
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.path import Path
from katana450.maths.planning.plan import Plan, plan
from katana450.maths.planning.scaling import Bounds
from katana450.maths.water.flow import Course, MotionWithWater, VesselMotion, WaterFlow
from katana450.maths.water.units import ML
from katana450.settings import Settings
from tests.conftest import LONG
from tests.control.test_commands import KINDS, examples


def copied(kind: Any, value: Any) -> Any:
    """Return ``value`` read from its text, by a reader that knows only the texts."""
    writer, reader = Codec(), Codec()
    text = json_text(writer.encoded(value))
    for shared in writer.shared.take_new():
        reader.shared.add(shared)
    return reader.decoded(kind, json_form(text))


def text_of(value: Any) -> bytes:
    return json_text(Codec().encoded(value))


@pytest.fixture(scope="module")
def follow(arm: ArmModel) -> cmd.Follow:
    """A command with a plan that has every kind of curve, one segment twice."""
    session = Session(arm, np.array(Settings().ready))
    chain = session.require_arm().chain
    near = session.ready
    point = ToolTarget.at(chain, near)
    target = ToolTarget(point.position + np.array((0.0, 0.05, 0.0)), point.pitch, 0.3)
    branch = branch_of(chain, near)
    centre = point.position + np.array((0.0, 0.0, 0.03))
    swing = Swing(point.pitch, 0.05, 0.02, 0.0, 1.0)
    curves: list[Curve] = [
        ToolLine(point, target),
        ToolLines((target, point, ToolTarget(target.position, point.pitch, 0.0)), np.array([0.5])),
        ToolArc(
            point.position, centre, np.array((0.3, 0.1, 0.2)), 0.7, Linear(point.pitch, 0.5), swing
        ),
        ToolTurn(point, np.array((0.1, 0.2, 0.1))),
    ]
    paths: list[Path] = [ToolPath(chain, curve, branch, near) for curve in curves]
    bounds = Bounds(session.require_arm().limits, 0.5)
    # Each alone, because they do not meet.
    plans = [plan([path], bounds, session.world, 0.1) for path in paths]
    segments = [plans[0].segments[0], *(plan.segments[0] for plan in plans)]
    return cmd.Follow(replace(plans[0], segments=tuple(segments)))


def test_every_command_survives_to_the_bit(
    session: Session, state: State, follow: cmd.Follow
) -> None:
    solid = Solid("abc123", (0.1, 0.1, 0.1), np.random.default_rng(3).random((12, 3)))
    mesh = SceneObject("mesh", Shape.MESH, (), np.eye(4), solid=solid)
    cause = pressed("Ada", "key", "press", 1e9 + 0.1)
    commands = [
        *examples(session, state),
        follow,
        cmd.PlaceObject(mesh),
        cmd.ReplaceScene((mesh,), 1e-4),
        cmd.Servo(np.zeros(5), -np.zeros(5)).timed(0.1),
        cmd.Stop(cause, Finding(Reason.DRIVER_SILENT, 0.3, 2, ("a", "b"), math.inf), ("x",)),
        cmd.HoldFor(Finding(Reason.WAITING)),
        cmd.MoveObject("mesh", np.full(3, -0.0), np.eye(3).T),
        cmd.Batch((cmd.ReplaceScene((mesh,)), cmd.Follow(follow.plan, 0.01))),
    ]
    assert {type(command) for command in commands} == set(KINDS) == set(classes_of(cmd.Command))
    for command in commands:
        back = copied(cmd.Command, command)
        assert type(back) is type(command)
        assert text_of(back) == text_of(command), command


def test_water_of_older_versions_is_read_and_other_liquids_are_refused() -> None:
    """They wrote the liquid in the cup."""
    fill = cmd.Fill(100.0)
    form = Codec().encoded(fill)
    liquid = ["water", 998.2, 0.0010016, 0.07274, [74, 148, 192]]
    assert Codec().decoded(cmd.Command, {**form, "liquid": liquid}) == fill
    honey = ["honey", 1421.0, 19.0, 0.055, [194, 116, 0]]
    with pytest.raises(FormError, match="Fill has no field 'liquid'"):
        Codec().decoded(cmd.Command, {**form, "liquid": honey})


def test_water_of_versions_with_one_vessel_is_read() -> None:
    """They wrote the cup's fields beside those of the basin."""
    water = WaterFlow(water_environment(load_props())).begin(1e-4, np.eye(4))
    poured = MotionWithWater(water, (VesselMotion(Course(), (0.0, 0.0, 0.1)),))
    form = Codec().encoded(poured)
    ((cup,), (motion,)) = form["water"].pop("vessels"), form.pop("motions")
    old = form["water"] | {"cup": cup["volume"] - 7, "T_base_cup": cup["T"]}
    old |= {"slosh": cup["slosh"], "film": 7, "wetted": 0.01}
    decoded = Codec().decoded(MotionWithWater, {**form, **motion, "waited": 0.5, "water": old})
    assert text_of(decoded) == text_of(poured)
    forms: tuple[Any, ...] = ({}, {"water": 1}, {"water": {"cup": 1}}, {"course": {}})
    for wrong in forms:
        with pytest.raises(FormError):
            Codec().decoded(MotionWithWater, wrong)


def test_repeated_segment_is_one_object_again(follow: cmd.Follow) -> None:
    back = copied(cmd.Command, follow)
    first, again, *others = back.plan.segments
    assert first is again
    assert all(segment is not first for segment in others)
    # The derived values are computed again from the same numbers.
    for tau in np.linspace(0.0, follow.plan.span, 50).tolist():
        assert back.plan.q(tau).tobytes() == follow.plan.q(tau).tobytes()
    arcs = [step.plan.segments[3].path.curve for step in (back, cast(Any, follow))]
    assert arcs[0].axis.tobytes() == arcs[1].axis.tobytes()


def test_shared_value_is_written_once(follow: cmd.Follow) -> None:
    codec = Codec()
    forms = [json_text(codec.encoded(follow)) for _ in range(3)]
    assert len(list(codec.shared.take_new())) == 1
    # An equal plan has the same key.
    equal = copied(cmd.Command, follow)
    forms.append(json_text(codec.encoded(equal)))
    assert not list(codec.shared.take_new())
    assert len(set(forms)) == 1
    assert len(forms[0]) < 100


def test_actors_survive() -> None:
    person = Person("k", "Ada \u0001\N{ROBOT FACE} é", Role.ADMIN, "3", "::1")
    for actor in (SERVER, Actor(person, CommandChannel.TCP, 3, Grounds.LEASE), None):
        back = copied(Actor | None, actor)
        assert text_of(back) == text_of(actor)
        assert back == actor


def bits(value: float) -> bytes:
    return struct.pack(">d", value)


ODD = (0.0, -0.0, math.inf, -math.inf, math.nan, 5e-324, -2.2e-308, 1.7976931348623157e308)
NANS = st.integers(1, 2**52 - 1).map(
    lambda n: struct.unpack(">d", (0x7FF << 52 | n).to_bytes(8))[0]
)


@settings(max_examples=3000 if LONG else 100)
@given(value=st.floats() | st.sampled_from(ODD) | NANS)
def test_floats_survive_to_the_bit(value: float) -> None:
    assert bits(copied(float, value)) == bits(value)
    back = copied(FloatArray, np.array([value, 1.0]))
    assert back.tobytes() == np.array([value, 1.0]).tobytes()


def arrays() -> Iterable[np.ndarray[Any, Any]]:
    whole = np.random.default_rng(1).normal(size=(4, 5, 3))
    yield whole
    yield whole[0]
    yield np.asfortranarray(whole[0])
    yield whole[0].T
    yield whole[1:3, ::2, 1]
    yield whole[:, 0, 0]
    yield np.broadcast_to(whole[0, 0], (6, 3))
    yield np.zeros((0, 5))
    yield np.array(3.5)
    yield np.arange(6).reshape(2, 3)
    yield np.full((2, 2), np.nan)


@pytest.mark.parametrize("array", list(arrays()))
def test_arrays_keep_shape_type_and_order_in_memory(array: np.ndarray[Any, Any]) -> None:
    back = copied(FloatArray, array)
    assert back.dtype == array.dtype
    assert back.shape == array.shape
    assert back.tobytes() == array.tobytes()
    for axis, (mine, other) in enumerate(zip(back.strides, array.strides, strict=True)):
        assert array.shape[axis] <= 1 or mine == other or array.flags.c_contiguous


def test_whole_number_in_place_of_a_float_stays_one() -> None:
    back = copied(cmd.Command, cmd.Joint(2, 2))
    assert type(back.value) is int
    assert type(copied(cmd.Command, cmd.Gripper(np.float64(0.1))).angle) is float


WRONG: st.SearchStrategy[Any] = st.sampled_from(
    [None, True, -1, 10**30, 1e300, "", "x", "nan", [], [[]], [1, "x"], {}, {"is": "Plan"}]
).map(deepcopy)  # A form is changed several times, and must not become a part of itself.


def places(form: Any, path: tuple[Any, ...] = ()) -> Iterable[tuple[Any, ...]]:
    """Yield the path to each value in ``form``."""
    items = form.items() if isinstance(form, dict) else enumerate(form)
    for key, value in items:
        yield (*path, key)
        if isinstance(value, dict | list):
            yield from places(value, (*path, key))


def changed(form: Any, path: tuple[Any, ...], how: str, wrong: Any) -> None:
    *inner, last = path
    for key in inner:
        form = form[key]
    if how == "replace" or not isinstance(form, dict):
        form[last] = wrong
    elif how == "remove":
        del form[last]
    else:
        form[f"{last}_"] = wrong


def mutated(data: st.DataObject, kind: Any, value: Any) -> None:
    """Change the text of ``value``; its reader returns a value or raises FormError."""
    writer, reader = Codec(), Codec()
    form = json_form(json_text(writer.encoded(value)))
    texts = list(writer.shared.take_new())
    all_places = list(places(form))
    for _ in range(data.draw(st.integers(1, 3))):
        path = data.draw(st.sampled_from(all_places))
        how = data.draw(st.sampled_from(("replace", "remove", "add")))
        try:
            changed(form, path, how, data.draw(WRONG))
        except (KeyError, IndexError, TypeError):
            continue
    for text in texts:
        reader.shared.add(text)
    with suppress(FormError):
        reader.decoded(kind, json_form(json_text(form)))


@settings(max_examples=1500 if LONG else 60)
@given(data=st.data())
def test_changed_text_raises_only_the_error_of_forms(data: st.DataObject) -> None:
    session = SESSIONS["session"]
    state = session.begin(session.ready, 0.0, 0.0)
    if data.draw(st.booleans()):
        mutated(data, cmd.Command, data.draw(st.sampled_from(SESSIONS["commands"])))
    elif data.draw(st.booleans()):
        mutated(data, State, replace(state, mode=SESSIONS["mode"]))
    else:
        mutated_plan(data)


def mutated_plan(data: st.DataObject) -> None:
    writer, reader = Codec(), Codec()
    form = writer.encoded(SESSIONS["follow"])
    (text,) = writer.shared.take_new()
    plan_form = json_form(text.text)
    path = data.draw(st.sampled_from(list(places(plan_form))))
    changed(plan_form, path, "replace", data.draw(WRONG))
    # The value may be the one that was there.
    assume(json_text(plan_form) != text.text)
    text = text._replace(text=json_text(plan_form))
    with pytest.raises(FormError, match="was changed"):
        reader.shared.add(text)
    text = text._replace(key=key_of(text.text))
    reader.shared.add(text)
    form["plan"] = text.key
    with suppress(FormError):
        reader.decoded(cmd.Command, form)


SESSIONS: dict[str, Any] = {}


@pytest.fixture(autouse=True, scope="module")
def _examples(arm: ArmModel, follow: cmd.Follow) -> None:
    session = Session(arm, np.array(Settings().ready))
    state = session.begin(session.ready, 0.0, 0.0)
    SESSIONS["session"] = session
    SESSIONS["commands"] = [*examples(session, state), follow]
    SESSIONS["follow"] = follow
    SESSIONS["mode"] = session.step(state, [cmd.Position(np.array((0.3, 0.1, 0.0)))], 0.01).mode


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (b"", "not JSON"),
        (b"[" * 100_000, "not JSON"),
        (b'{"is": "joint"}', "Joint lacks axis, value"),
        (b'{"is": "os.system", "command": "true"}', "not one of"),
        (b'{"is": "State"}', "not one of"),
        (b'{"is": "joint", "axis": 0, "value": 1, "x": 1}', "has no field"),
        (b'{"is": "joint", "axis": 0.5, "value": 1}', "axis: 0.5 is not a whole number"),
        (b'{"is": "joint", "axis": 1, "value": "nan"}', "must be a finite number|nan"),
        (b'{"is": "joints", "q": [0, 1, [2]]}', "q: "),
        (b'{"is": "joints", "q": {"shape": [1e9], "type": "float64"}}', "is not an array"),
        (
            b'{"is":"joints","q":{"shape":[9999999999],"type":"float64","steps":[0],"data":[1]}}',
            "does not have",
        ),
        (b'{"is": "follow", "plan": "0123", "tau": 0}', "plan: the Plan with the key '0123' is"),
        (b'{"is":"batch","commands":[{"is":"hold"},{"is":"home","a":1}]}', r"commands\[1\]"),
    ],
)
def test_error_names_the_place_and_the_fault(text: bytes, expected: str) -> None:
    with pytest.raises(FormError, match=expected):
        Codec().decoded(cmd.Command, json_form(text))


CAUSE = Finding(Reason.WAITING)
CAUSE_FORM = {"reason": "WAITING", "amount": 0.0, "axis": None, "parts": None, "time": 0.0}
PAINT = {"is": "set_appearance", "name": "cup", "trait": "CHOICE", "value": -1}
SAMPLE = {"is": "Servo", "q": [0.1, 0.2], "qd": None, "gripper": None}


@pytest.mark.parametrize(
    ("form", "expected"),
    [
        ({"is": "SetJoint", "axis": 0, "value": 0.5}, cmd.Joint(1, 0.5)),
        ({"is": "Nudge", "axis": 4, "by": 0.5}, cmd.Nudge(5, 0.5)),
        ({"is": "SetAxes", "values": [[0, 0.5], [2, 1.5]]}, cmd.SetAxes(((1, 0.5), (3, 1.5)))),
        ({"is": "MoveTool", "position": [0.1, 0.2, 0.3]}, cmd.Position(np.array((0.1, 0.2, 0.3)))),
        ({"is": "TakeBranch", "branch": "left-up"}, cmd.Branch(name="left-up")),
        (
            {"is": "TakeBranch", "branch": {"shoulder": "back", "elbow": "up"}},
            cmd.Branch(name="back-up"),
        ),
        ({"is": "SpeedScale", "value": 0.5}, cmd.Speed(0.5)),
        ({"is": "attach", "name": "cup", "to": "TABLE"}, cmd.Attach("cup", Attachment.WORLD)),
        ({"is": "offer_detour", "plan": "0123"}, cmd.Batch(())),
        ({**PAINT, "is": "SetAppearance"}, cmd.Batch(())),
        ({"is": "batch", "commands": [PAINT, {"is": "home"}]}, cmd.Batch((cmd.Home(),))),
        ({"is": "Fill", "volume": ML * 100.0}, cmd.Fill(100.0)),
        ({"is": "Hold", "finding": None}, cmd.Hold()),
        ({"is": "Pause", "finding": CAUSE_FORM}, cmd.PauseFor(CAUSE)),
        ({**SAMPLE, "t": None}, cmd.Servo(np.array((0.1, 0.2)))),
        ({**SAMPLE, "t": 0.3}, cmd.Servo(np.array((0.1, 0.2))).timed(0.3)),
        (
            {"is": "Batch", "commands": [{"is": "SetTool", "name": "tcp"}, {"is": "Home"}]},
            cmd.Batch((cmd.Tool("tcp"), cmd.Home())),
        ),
    ],
    ids=lambda value: value["is"] if isinstance(value, dict) else "",
)
def test_commands_of_older_versions_are_read(form: dict[str, Any], expected: cmd.Command) -> None:
    command = Codec().decoded(cmd.Command, form)
    assert text_of(command) == text_of(expected)


def test_state_of_a_version_that_painted_links_is_read_and_has_its_digest(state: State) -> None:
    painted = Codec().encoded(state) | {"appearance": {"changed": [["cup", {"choice": "HIDDEN"}]]}}
    assert text_of(Codec().decoded(State, painted)) == text_of(state)
    assert b"\x81\xa7changed\x90" in Digester().content(state)


def test_detour_of_an_older_version_is_read_as_a_plan_that_is_followed() -> None:
    writer, reader = Codec(), Codec()
    offer = {"is": "offer_detour", "plan": writer.encoded(SESSIONS["follow"])["plan"]}
    for shared in writer.shared.take_new():
        reader.shared.add(shared)
    reader.decoded(cmd.Command, offer)
    command = reader.decoded(cmd.Command, {"is": "go"})
    np.testing.assert_array_equal(command.plan.end, SESSIONS["follow"].plan.end)


def test_target_of_an_older_version_is_read_and_has_its_digest(state: State) -> None:
    """Poses were a class of their own, and targets of five axes had no rotation."""
    form = {"is": "ToolPose", "position": [0.1, 0.2, 0.3], "R": np.eye(3).tolist()}
    pose = Codec().decoded(Target, form)
    np.testing.assert_array_equal(pose.T[:3], np.column_stack((np.eye(3), (0.1, 0.2, 0.3))))
    assert target_content(pose) == ("ToolPose", {"position": pose.position, "R": pose.R})
    rows = [{"position": [x, 0.0, 0.3], "R": np.eye(3).tolist()} for x in (0.1, 0.2, 0.3)]
    lines = Codec().decoded(Curve, {"is": "PoseLines", "vias": rows, "blend": [0.5]})
    assert lines.at(Jet.variable(1.0)).target.apart(lines.vias[-1]) == (0.0, 0.0)
    five = Codec().decoded(
        Target, {"is": "ToolTarget", "position": [1, 2, 3], "pitch": 0.1, "roll": 0.2}
    )
    content = {"position": five.position, "pitch": 0.1, "roll": 0.2}
    assert target_content(five) == ("ToolTarget", content)
    drag = replace(state, mode=Tracking(five, five))
    former = msgpack.encode({"target": content}, enc_hook=lambda value: value.tobytes())
    assert former[1:] in Digester().content(drag)


@given(st.floats(0.0, 300.0))
def test_volume_of_an_older_version_stays_the_same_to_the_bit(ml: float) -> None:
    volume = ML * ml
    assert Codec().decoded(cmd.Command, {"is": "Fill", "volume": volume}).volume == volume


@pytest.mark.parametrize(
    "form",
    [
        {"is": "SetJoint", "axis": "0", "value": 0.5},
        {"is": "SetAxes", "values": [["0", 0.5], 3]},
        {"is": "TakeBranch", "branch": {"shoulder": "left"}},
        {"is": "Fill", "volume": "1"},
        {"is": "Hold", "finding": 3},
    ],
)
def test_wrong_command_of_an_older_version_is_refused(form: dict[str, Any]) -> None:
    with pytest.raises(FormError):
        Codec().decoded(cmd.Command, form)


def test_deep_batches_and_long_texts_are_refused() -> None:
    text = b'{"is": "batch","commands":[' * 400 + b"]}" * 400
    with pytest.raises(FormError, match="too often"):
        Codec().decoded(cmd.Command, json_form(text))
    with pytest.raises(FormError, match=f"bytes, more than {MAX_TEXT_BYTES}"):
        json_form(b" " * (MAX_TEXT_BYTES + 1))


def test_every_class_that_is_recorded_is_frozen() -> None:
    kinds = recorded_classes()
    assert {State, cmd.Follow, Plan, ToolPath, Linear, TurnedCurve} <= set(kinds)
    for kind in kinds:
        frozen = kind.__struct_config__ if issubclass(kind, Struct) else kind.__dataclass_params__  # type: ignore[attr-defined]
        assert frozen.frozen, kind


def test_values_of_other_classes_are_refused(state: State) -> None:
    class Other:
        pass

    with pytest.raises(FormError, match="has no form"):
        Codec().encoded(Other())
    with pytest.raises(TypeError, match="not a type of recorded values"):
        form_of(Other)
    with pytest.raises(FormError, match="not a number of 64 bits"):
        Codec().encoded(replace(state, gripper=10**40))
