"""The squeeze in the state, the forces that follow from it, and the object that slips."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects.support import SUPPORT_GAP
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.event_log import entries_between
from katana450.arm.control.state.messages import sentence
from katana450.arm.control.state.restart import restarted
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.control.state.state import Reason, State
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.extensions.touch.pad import ROWS, pads_of
from katana450.extensions.touch.solid_body import DENSITY, FRICTION, SLIDING_RESISTANCE, mass
from katana450.extensions.touch.squeeze import FORCE_LIMIT
from katana450.extensions.touch.touch_model import TouchModel
from katana450.maths.geometry import se3
from katana450.maths.water.units import GRAVITY
from tests.conftest import LONG
from tests.control.test_grip import OPEN, lifted
from tests.ticks import rested


def gripped_with(session: Session, model: TouchModel, holding: State, force: float) -> State:
    """Return the state after a command that presses with ``force`` [N]."""
    assert holding.grip is not None
    body = model._held(holding)
    assert body is not None
    squeeze, _ = body._squeeze_at(force)
    return rested(session, holding, cmd.Gripper(holding.grip - squeeze))


def test_pads_lie_on_the_inner_surface_of_the_fingers(session: Session, model: TouchModel) -> None:
    world = session.environment.world(())
    assert world is not None
    x = np.zeros(6)
    poses = world.linkage.poses(x)
    groups = {part.name: part.mover for part in world.parts}
    for pad in model.pads:
        T = poses[groups[pad.finger]]
        for place, normal in zip(
            pad.middles[::5, ::3].reshape(-1, 3), pad.normals[::640], strict=False
        ):
            point = T[:3, :3] @ place + T[:3, 3]
            ball = SceneObject("ball", Shape.SPHERE, (1e-3,), np.eye(4))
            moved = se3.from_rotation_translation(np.eye(3), point - (0.0, 0.0, 1e-3))
            near = session.environment.world([replace(ball, T=moved)])
            assert near is not None
            # A ball of 1 mm about the point is as deep in the finger as its radius, to 0.1 mm.
            assert near.gap(x, pad.finger, "ball") == pytest.approx(-1e-3, abs=2e-4)
            assert np.linalg.norm(normal) == pytest.approx(1.0)


def test_other_fingers_have_no_pads() -> None:
    assert pads_of(("finger_left_link", "thumb")) == ()


def test_wish_beyond_the_stop_is_kept_as_squeeze(session: Session, holding: State) -> None:
    assert holding.grip is not None
    assert holding.squeeze == holding.grip + 0.44
    softer = rested(session, holding, cmd.Gripper(holding.grip - 0.01))
    assert softer.squeeze == pytest.approx(0.01)
    assert softer.gripper_goal == softer.gripper_setpoint == holding.grip
    assert softer.findings == ()
    beyond = rested(session, holding, cmd.Gripper(-1.0))
    assert beyond.squeeze == holding.squeeze
    assert [finding.reason for finding in beyond.findings] == [Reason.GRIPPER_LIMIT]


def test_stop_and_restart_keep_the_squeeze_and_opening_clears_it(
    session: Session, holding: State
) -> None:
    stopped = rested(session, holding, cmd.Stop())
    assert stopped.held is not None
    assert stopped.squeeze == holding.squeeze
    start = session.begin(holding.q, holding.gripper, 0.0)
    assert restarted(start, holding).squeeze == holding.squeeze
    opened = rested(session, holding, cmd.Gripper(OPEN))
    assert opened.squeeze == 0.0
    assert opened.grip is None


def test_both_fingers_press_with_the_same_force_up_to_the_limit(
    model: TouchModel, holding: State
) -> None:
    squeeze = model.squeeze(holding)
    assert squeeze is not None
    right, left = squeeze.pads
    assert right.force == pytest.approx(FORCE_LIMIT, rel=1e-3)
    assert left.force == pytest.approx(right.force, rel=1e-3)
    # The cup touches the bend of the fingers with the faces towards their tips.
    assert right.pressure[ROWS // 2 :].sum() == pytest.approx(right.pressure.sum())
    assert right.centre is not None
    assert right.centre[1] == pytest.approx(0.0, abs=1e-3)
    np.testing.assert_allclose(squeeze.axis, (0.0, -1.0, 0.0), rtol=0, atol=1e-6)


def test_an_object_beside_the_middle_is_pressed_by_both_fingers_alike(
    model: TouchModel, holding: State
) -> None:
    objects = tuple(
        replace(
            scene_object,
            T=se3.from_rotation_translation(np.eye(3), (0.0, 1e-3, 0.0)) @ scene_object.T,
        )
        if scene_object.held
        else scene_object
        for scene_object in holding.objects
    )
    assert holding.grip is not None
    squeeze = model.squeeze(replace(holding, objects=objects, squeeze=0.02))
    centred = model.squeeze(replace(holding, squeeze=0.02))
    assert squeeze is not None
    assert centred is not None
    assert squeeze.pads[0].force == pytest.approx(squeeze.pads[1].force, rel=1e-3)
    assert squeeze.force == pytest.approx(centred.force, rel=0.05)


@pytest.mark.parametrize("force", [0.5, 3.0, 9.0])
def test_squeeze_for_a_force_gives_that_force(
    session: Session, model: TouchModel, holding: State, force: float
) -> None:
    squeeze = model.squeeze(gripped_with(session, model, holding, force))
    assert squeeze is not None
    assert squeeze.force == pytest.approx(force, rel=1e-3)


def slides(state: State) -> bool:
    return any(finding.reason is Reason.SLIDING for finding in state.findings)


def height_in_hand(session: Session, state: State) -> float:
    """Return the height of the held cup above the middle of the palm [m]."""
    assert state.held is not None
    x = state.x_setpoint
    palm = session.environment.into_hand(np.eye(4), x)
    in_base: float = session.environment.pose(state.held, x)[2, 3]
    return in_base - float(se3.inverse(palm)[2, 3])


@pytest.mark.long
def test_weak_grip_lets_the_cup_slide_down_to_the_table(
    session: Session, arm: MountedArm, model: TouchModel, holding: State
) -> None:
    (cup,) = (scene_object for scene_object in holding.objects if scene_object.held)
    weight = mass(cup, holding, {"cup": 0.0614}) * GRAVITY
    needed = weight / (2.0 * FRICTION)
    firm = lifted(session, arm, gripped_with(session, model, holding, 1.1 * needed), 0.04)
    assert not slides(firm)
    weak = gripped_with(session, model, holding, 0.9 * needed)
    # The table carries the cup until the arm lifts it.
    assert not slides(weak)
    start = height_in_hand(session, weak)
    after = lifted(session, arm, weak, 0.015)
    assert slides(after)
    (sliding,) = after.findings
    assert sliding.amount == pytest.approx(weight, rel=0.05)
    assert sentence(after).startswith("Cup slides in the fingers under a load of 0.6 N")
    (logged,) = entries_between(weak, after)
    assert logged.began
    assert height_in_hand(session, after) < start - 1e-3
    # At rest it slides as fast as a tenth of its weight says.
    later = after
    for _ in range(50):
        later = session.step(later, (), later.t + 0.01)
    fell = height_in_hand(session, after) - height_in_hand(session, later)
    assert fell == pytest.approx(0.5 * 0.1 * weight / SLIDING_RESISTANCE, rel=0.05)
    assert entries_between(after, later) == ()
    while slides(later):
        later = session.step(later, (), later.t + 0.05)
        assert later.t < after.t + 60.0
    # It stands on the table again, still between the fingers.
    assert later.held is not None
    assert later.findings == ()
    height = session.environment.pose(later.held, later.x_setpoint)[2, 3]
    assert 0.0 <= height <= SUPPORT_GAP
    (ended,) = entries_between(after, later)
    assert not ended.began


def test_firm_grip_ends_a_slide(
    session: Session, arm: MountedArm, model: TouchModel, holding: State
) -> None:
    (cup,) = (scene_object for scene_object in holding.objects if scene_object.held)
    needed = mass(cup, holding, {"cup": 0.0614}) * GRAVITY / (2.0 * FRICTION)
    after = lifted(session, arm, gripped_with(session, model, holding, 0.8 * needed), 0.04)
    assert slides(after)
    held = rested(session, after, cmd.Gripper(-0.44))
    assert not slides(held)
    still = session.step(held, (), held.t + 0.01)
    assert still.held is held.held


def test_cup_slides_out_of_the_fingers_and_falls(
    session: Session, arm: MountedArm, model: TouchModel, holding: State
) -> None:
    high = lifted(session, arm, holding, 0.11)
    assert not slides(high)
    state = gripped_with(session, model, high, 0.1)
    lowest = height_in_hand(session, state)
    began = state.t
    while state.held is not None:
        height = height_in_hand(session, state)
        assert height <= lowest
        lowest = height
        state = session.step(state, (), state.t + 0.02)
        assert state.t < began + 20.0
    # Its weight is 0.6 N, of which the fingers hold 0.16 N while their pads are on it.
    assert state.t - began > 1.0
    assert (state.grip, state.squeeze) == (None, 0.0)
    (slipped,) = state.findings
    assert slipped.reason is Reason.SLIPPED
    assert sentence(state).startswith("Cup slipped out of the fingers under a load of 0.6 N")
    (stands,) = (scene_object for scene_object in state.objects if scene_object.name == "cup")
    assert stands.T[2, 3] == 0.0
    opened = rested(session, state, cmd.Gripper(OPEN))
    assert opened.findings == ()


def test_acceleration_makes_a_held_cup_slide_until_it_ends(
    session: Session, arm: MountedArm, model: TouchModel, holding: State
) -> None:
    (cup,) = (scene_object for scene_object in holding.objects if scene_object.held)
    weight = mass(cup, holding, {"cup": 0.0614}) * GRAVITY
    up = lifted(session, arm, gripped_with(session, model, holding, 0.65 * weight), 0.06)
    assert up.held is not None
    assert not slides(up)
    loads, state = [], session.step(up, [cmd.Joint(4, up.q[3] + 0.5)], up.t + 0.01)
    while state.moving:
        loads += [finding.amount for finding in state.findings if finding.reason is Reason.SLIDING]
        state = session.step(state, (), state.t + 0.01)
    assert loads
    assert min(loads) > 1.02 * weight
    assert state.held is not None
    assert not slides(state)
    slid = np.linalg.norm(state.held.T[:3, 3] - up.held.T[:3, 3])
    assert 1e-5 < slid < 0.01


def test_mass_follows_from_the_cup_with_its_water_or_from_the_volume(
    session: Session, holding: State
) -> None:
    (cup,) = (scene_object for scene_object in holding.objects if scene_object.name == "cup")
    filled = rested(session, holding, cmd.Fill(100.0))
    assert mass(cup, filled, {"cup": 0.06}) == pytest.approx(0.06 + 0.09982, rel=1e-6)
    box = SceneObject("box", Shape.BOX, (0.1, 0.1, 0.1), np.eye(4))
    assert mass(box, filled, {"cup": 0.06}) == pytest.approx(1e-3 * DENSITY)


def test_map_takes_less_than_five_percent_of_a_processor_at_30_hertz(
    model: TouchModel, holding: State
) -> None:
    model.report(holding)
    took = []
    for number in range(40):
        # Another force in each state, which is the most work.
        state = replace(holding, squeeze=0.01 + 2e-4 * number)
        start = time.process_time()
        model.report(state)
        took.append(time.process_time() - start)
    # The lower quartile, because other programs take the processor and its cache.
    # Beside three other processes of tests the same work takes longer.
    assert sorted(took)[len(took) // 4] < (0.05 if LONG else 0.1) / 30.0


def test_equal_objects_share_the_work_of_a_grip(model: TouchModel, holding: State) -> None:
    before = model.squeeze(holding)
    # As in a state from a pipe in which another object has moved.
    objects = tuple(replace(scene_object) for scene_object in holding.objects)
    assert model.squeeze(replace(holding, objects=objects)) is before


def test_object_beside_the_pads_has_no_force_and_does_not_slip(
    session: Session, model: TouchModel, holding: State
) -> None:
    away = se3.from_rotation_translation(np.eye(3), (-0.2, 0.0, 0.0))
    objects = tuple(
        replace(scene_object, T=away @ scene_object.T) if scene_object.held else scene_object
        for scene_object in holding.objects
    )
    displaced = replace(holding, objects=objects)
    squeeze = model.squeeze(displaced)
    assert squeeze is not None
    assert squeeze.normal_force == 0.0
    assert model.overload(displaced) is None
    assert session.step(displaced, (), displaced.t + 0.01).held is not None


def test_report_has_pressures_only_while_something_is_pressed(
    model: TouchModel, around: State, holding: State
) -> None:
    free, tight = model.report(around), model.report(holding)
    assert [pad["pressure"] for pad in free["pads"]] == [[], []]
    assert free["squeeze"] == 0.0
    for pad in tight["pads"]:
        assert len(pad["pressure"]) == 128
        assert pad["force"] == pytest.approx(FORCE_LIMIT, rel=1e-3)
