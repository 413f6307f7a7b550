"""Drawers and doors of a scene in the app's own session: pulled by a handle, and pushed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice, pairwise

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.commands.object_commands import MoveObject
from katana450.arm.control.objects.grip import FINGER_FORCE
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.scene_objects import Attachment, SceneObject, named
from katana450.arm.control.state.state import State, Verdict
from katana450.assembly.robot_session import describe_robot
from katana450.errors import InputError
from katana450.extensions.importers.formats.scene_file import written
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.script.script_scene import Scene, parsed
from katana450.extensions.recording.codec import Codec
from katana450.maths.physics.model import PAD_FRICTION
from katana450.resources import URDF_PATH
from katana450.settings import Settings
from tests.ticks import settled, states, ticked

DRAWER = """
scene: 1
objects:
- name: drawer
  shape: box
  size: [12, 212, 110]
  pose: [431, 0, 6, 0, 0, 0]
  joint: {type: slide, axis: -x, range: [0, 120], position: 5, friction: 2, damping: 5, mass: 0.8}
- {name: handle, shape: box, size: [70, 12, 60], pose: [390, 0, 36, 0, 0, 0], part_of: drawer,
   can_be_held: true}
"""

DOOR = """
scene: 1
objects:
- name: door
  shape: box
  size: [120, 8, 80]
  pose: [400, 34, 30, 0, 0, 0]
  can_be_held: true
  joint: {type: hinge, axis: z, origin: [60, 0, 0], range: [-100, 0], friction: 0.01, mass: 0.3}
"""

AT_HANDLE = np.array((0.0, -0.6691, 1.1633, 0.6402, 0.0))
"""[rad] The arm with the handle between its fingers."""

CLOSED = -0.44  # rad


@pytest.fixture(scope="module")
def session() -> Session:
    return describe_robot(Settings(), URDF_PATH, None).session


def begun(session: Session, text: str, fingers: float) -> State:
    """Return the state of an arm at the handle in the scene of ``text``."""
    arm = session.require_arm()
    start = session.begin(AT_HANDLE, arm.gripper.clamp(fingers), 0.0)
    return ticked(session, start, cmd.ReplaceScene(parsed(text).scene({}, np.eye(4)).objects))


def part(state: State, name: str) -> SceneObject:
    scene_object = named(state.objects, name)
    assert scene_object is not None
    return scene_object


def opening(state: State, name: str = "drawer") -> float:
    """Return the position of the joint of an object that is not held [m or rad]."""
    joint = part(state, name).joint
    assert joint is not None
    return joint.position(part(state, name).T)


def pulled(session: Session, speed: float) -> Iterator[State]:
    """Yield the states from the closed fingers on, while the tool is pulled for half a second."""
    start = begun(session, DRAWER, 0.3)
    closed = next(s for s in states(session, start, cmd.Gripper(CLOSED)) if s.held)
    yield closed
    pull = cmd.Jog(np.array((-speed, 0.0, 0.0, 0.0, 0.0)))
    yield from islice(states(session, closed, pull, every=True), 50)


def test_drawer_is_pulled_by_its_handle(session: Session) -> None:
    closed, *moving = pulled(session, 0.1)
    assert closed.held is not None
    assert closed.held.name == "handle"
    tool = [session.environment.tool_point(state.x_setpoint)[0] for state in (closed, moving[-1])]
    way = opening(moving[-1]) - opening(closed)
    assert way > 0.01
    assert way == pytest.approx(tool[0] - tool[1], abs=5e-4)
    assert part(moving[-1], "drawer").T[0, 3] == pytest.approx(0.431 - opening(moving[-1]))
    # The fingers pull with what the joint resists at least, and with no more than they can hold.
    forces = [sum(c.friction for c in s.bodies.contacts) for s in moving[30:45] if s.bodies]
    assert 2.0 < np.mean(forces) < PAD_FRICTION * 2.0 * FINGER_FORCE
    # Fingers that open leave it where it is, and it sleeps.
    rest = settled(session, ticked(session, moving[-1], cmd.Hold(), cmd.Gripper(0.3), ticks=20))
    assert rest.held is None
    assert rest.bodies is None
    assert opening(rest) == pytest.approx(opening(moving[-1]), abs=5e-3)
    assert ticked(session, rest, ticks=5).objects is rest.objects


def test_recording_holds_the_joint(session: Session) -> None:
    state, codec = begun(session, DRAWER, 0.3), Codec()
    copy = codec.decoded(State, json.loads(json.dumps(codec.encoded(state))))
    keys, copied = ([item.joint and item.joint.key for item in s.objects] for s in (state, copy))
    assert keys == copied
    assert ticked(session, copy, ticks=3).objects[0].T.tobytes() == state.objects[0].T.tobytes()


def test_door_is_pushed_open_by_a_finger(session: Session) -> None:
    start = begun(session, DOOR, CLOSED)
    after = ticked(session, start, cmd.Gripper(0.3), ticks=200)
    assert opening(after, "door") < np.radians(-5.0)
    assert not after.blocked
    # It hangs in its hinge and stays where it was pushed.
    assert part(after, "door").T[2, 3] == pytest.approx(0.03, abs=1e-9)
    assert after.bodies is None


def test_drawer_is_an_obstacle_where_it_is(session: Session) -> None:
    start = begun(session, DRAWER, 0.3)
    places = []
    for position in ("5", "100"):
        objects = parsed(DRAWER.replace("position: 5", f"position: {position}")).scene({}, None)
        world = session.environment.world(objects.objects)
        assert world is not None
        (number,) = [n for n, item in enumerate(world.parts) if item.name == "drawer"]
        places.append(world.parts[number].T_mover_shape[0][0, 3])
    assert places == pytest.approx([0.426, 0.331])
    assert opening(start) == pytest.approx(0.005)


def test_object_on_a_joint_is_not_put_elsewhere(session: Session) -> None:
    start = begun(session, DRAWER, 0.3)
    handle = part(start, "handle")
    moved = replace(handle, T=np.eye(4), joint=None)
    for command in (
        MoveObject("handle", position=np.zeros(3)),
        cmd.Attach("handle", Attachment.HAND),
    ):
        after = ticked(session, start, command)
        assert after.outcomes[0].verdict is Verdict.REFUSED
        assert "on a joint" in after.outcomes[0].why
    after = ticked(session, start, cmd.PlaceObject(moved))
    assert part(after, "handle").T.tobytes() == handle.T.tobytes()
    assert part(after, "handle").joint is handle.joint


@pytest.mark.parametrize("text", [DRAWER, DOOR])
def test_scene_is_written_as_it_is_read(text: str) -> None:
    objects = parsed(text).scene({}, None).objects
    copies = parsed(written(Scene(objects), {}, None)).scene({}, None).objects
    for one, other in pairwise((*objects, *copies)[:: len(objects)]):
        assert one.joint is not None
        assert other.joint is not None
        assert pytest.approx(one.T, abs=1e-9) == other.T
        assert other.joint.T_zero == pytest.approx(one.joint.T_zero, abs=1e-9)
        assert other.joint.joint.axis == pytest.approx(one.joint.joint.axis, abs=1e-9)
        assert other.joint.joint.point == pytest.approx(one.joint.joint.point, abs=1e-9)
        assert other.joint.joint.friction == one.joint.joint.friction
        assert other.joint.joint.mass == one.joint.joint.mass


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("type: slide", "type: ball", "`slide`, `hinge`"),
        ("axis: -x", "axis: [0, 0, 0]", "must not be zero"),
        ("range: [0, 120]", "range: [120, 0]", "range of a joint must contain 0"),
        ("range: [0, 120]", "range: [0, .inf]", "number from -4000 to 4000"),
        ("range: [0, 120]", "range: [10, 120]", "range of a joint must contain 0"),
        ("position: 5", "position: 500", "is not in its range"),
        ("friction: 2", "friction: -2", "not between 0"),
        ("friction: 2", "friction: 1e99", "not between 0"),
        ("mass: 0.8", "mass: 1e9", "not between"),
        ("part_of: drawer", "part_of: door", "another object with a `joint`"),
        ("part_of: drawer", "part_of: handle", "another object with a `joint`"),
        ("shape: box", "zone: slow, shape: box", "no zone"),
        ("can_be_held: true", "attach: hand", "not fixed to the"),
    ],
)
def test_impossible_joint_of_a_scene_is_refused(old: str, new: str, said: str) -> None:
    text = (
        DRAWER.replace(old, new, 1)
        if "shape" not in old
        else DRAWER.replace(
            "{name: handle, shape: box", "{name: handle, zone: slow, shape: box"
        ).replace("can_be_held: true", "hidden: false")
    )
    with pytest.raises((ScriptError, InputError), match=said):
        parsed(text).scene({}, np.eye(4))
