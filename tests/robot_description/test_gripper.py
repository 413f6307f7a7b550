"""The gripper on its raw solids: the fingers are clear, open like the real ones, and hold a cup."""

from __future__ import annotations

import functools
import json
import math

import numpy as np
import pytest
import yourdfpy
from manifold3d import Manifold
from numpy.typing import NDArray

from katana450.resources import PROPS_PATH, URDF_PATH
from robot_description.cad.build import parts
from robot_description.cad.fingers import CROWN_TEETH, pocket
from robot_description.cad.gripper import PINION_TEETH, PINION_TIP, PIVOT_X
from robot_description.cad.material import BRASS
from robot_description.cad.solid import rod
from tests.robot_description.solids import solid

# Gap between the fingers 89.3 mm from the pivot by finger angle, of the manufacturer's shapes: mm.
OPENING = {
    -0.44: 0.4,
    -0.30: 25.5,
    -0.20: 43.0,
    -0.10: 60.0,
    0.00: 76.4,
    0.10: 92.0,
    0.20: 106.8,
    0.30: 120.4,
}
OPENING_RADIUS = 89.3
MOTOR_RATIO = 0.32542  # finger radians a motor radian, of the manufacturer's configuration


@functools.cache
def limits() -> tuple[float, float]:
    limit = (
        yourdfpy.URDF.load(str(URDF_PATH), load_meshes=False).joint_map["finger_right_joint"].limit
    )
    return float(limit.lower), float(limit.upper)


def fingers(angle: float) -> tuple[Manifold, Manifold]:
    """Return the right and left finger at ``angle``, in the frame of the pivot, mm."""
    turn = math.degrees(angle)
    return (
        solid("finger_right_link").rotate((0.0, 0.0, turn)),
        solid("finger_left_link").rotate((0.0, 0.0, -turn)),
    )


def corners(solid: Manifold) -> NDArray[np.float64]:
    return np.asarray(solid.to_mesh64().vert_properties, dtype=np.float64)[:, :3]


def test_fingers_are_clear_of_each_other_and_of_the_body() -> None:
    body = solid("gripper_link").translate((-PIVOT_X, 0.0, 0.0))
    for angle in np.linspace(*limits(), 25):
        right, left = fingers(float(angle))
        assert (right ^ left).volume() == 0.0, f"the fingers meet at {angle:.2f} rad"
        for finger in (right, left):
            assert (finger ^ body).volume() == 0.0, f"a finger cuts the body at {angle:.2f} rad"


def test_closed_fingers_leave_a_slit() -> None:
    right, left = fingers(limits()[0])
    assert 0.0 < right.min_gap(left, 5.0) < 1.0


@pytest.mark.parametrize(("angle", "gap"), OPENING.items())
def test_fingers_open_as_far_as_the_real_ones(angle: float, gap: float) -> None:
    slab = rod(2 * OPENING_RADIUS + 0.2, -20.0, 20.0, segments=360) - rod(
        2 * OPENING_RADIUS - 0.2, -30.0, 30.0, segments=360
    )
    right, left = (corners(finger ^ slab)[:, 1] for finger in fingers(angle))
    assert right.min() - left.max() == pytest.approx(gap, abs=1.0)


def test_pinion_and_crowns_are_in_mesh_at_the_manufacturers_ratio() -> None:
    assert pytest.approx(MOTOR_RATIO, rel=1e-3) == PINION_TEETH / CROWN_TEETH
    for link in ("finger_right_link", "finger_left_link"):
        part = next(part for part in parts() if part.link == link)
        near = np.abs(corners(dict(part.bodies())[BRASS])[:, 2]).min()
        assert PINION_TIP < near < PINION_TIP + 0.3


def test_gripper_sits_on_the_roll_links_flange() -> None:
    gripper = solid("gripper_link").translate((32.3, 0.0, 0.0))
    assert (gripper ^ solid("roll_link")).volume() < 0.5
    assert gripper.min_gap(solid("roll_link"), 1.0) < 0.2


def test_pads_hold_the_cup_on_four_lines() -> None:
    cup = json.loads(PROPS_PATH.read_text("utf-8"))["cup"]
    angle, radius = cup["held_at_finger_angle"], 1e3 * cup["outer_radius"]
    centre = (1e3 * cup["held_before_pivot"], 0.0, 0.0)
    body = rod(2 * radius, -45.0, 45.0, at=centre, segments=720)
    assert limits()[0] < angle < limits()[1] - 0.1
    for finger in fingers(angle):
        assert (finger ^ body).volume() < 1.0
        assert finger.min_gap(body, 1.0) < 0.02
        pressed = finger ^ rod(2 * radius + 0.3, -45.0, 45.0, at=centre, segments=720)
        assert len(pressed.decompose()) == 2
    for finger in fingers(limits()[1]):
        assert finger.min_gap(body, 30.0) > 8.0, "the open fingers do not pass the cup"


def test_the_grasp_frame_is_on_the_axis_of_the_cup_held() -> None:
    cup = json.loads(PROPS_PATH.read_text("utf-8"))["cup"]
    urdf = yourdfpy.URDF.load(str(URDF_PATH), load_meshes=False, build_scene_graph=True)
    pivot, grasp = (urdf.get_transform(link)[:3, 3] for link in ("finger_left_link", "grasp"))
    np.testing.assert_allclose(grasp - pivot, (cup["held_before_pivot"], 0.0, 0.0), atol=1e-4)


def test_a_thicker_cylinder_opens_the_fingers_wider() -> None:
    angles = [pocket(radius)[0] for radius in (15.0, 25.0, 35.0)]
    assert angles == sorted(angles)
