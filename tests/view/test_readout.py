"""The read-out shows limit distances and velocity measures for any posture."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control.session import Session
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.velocity import limit_distances, singular_values
from katana450.server.view.controls import ends
from katana450.server.view.readout import BASE, SHOULDER, UNITS, PoseDisplay, details, page


def test_limit_distance_of_every_axis_is_shown_and_the_nearest_marked(
    arm: MountedArm, session: Session
) -> None:
    random, chain = np.random.default_rng(2), arm.chain
    for q in random.uniform(chain.lower, chain.upper, (20, 5)):
        text = details(arm, replace(session.begin(session.ready, 0.0, 0.0), q=q))
        (rooms,) = re.findall(r"data-now='limits'>(.*?)</table>", text)
        cells = re.findall(r"<td( class=nearest)?>(\d+)°</td>", rooms)
        distances = np.degrees(limit_distances(chain, q))
        assert [int(degrees) for _, degrees in cells] == [round(x) for x in distances.tolist()]
        assert [bool(mark) for mark, _ in cells] == (distances == distances.min()).tolist()


def test_velocity_measures_equal_those_of_the_kinematics(arm: MountedArm, session: Session) -> None:
    chain, state = arm.chain, session.begin(session.ready, 0.0, 0.0)
    text = details(arm, state)
    values = singular_values(chain, state.q)
    assert f"<td data-now='condition'>{values[0] / values[-1]:.0f}</td>" in text
    assert f"<td data-now='manipulability'>{values.prod():.3f}</td>" in text


def test_condition_is_infinite_in_a_singularity(arm: MountedArm, session: Session) -> None:
    assert "<td data-now='condition'>∞</td>" in details(arm, session.begin(np.zeros(5), 0.0, 0.0))


@pytest.mark.parametrize(
    ("units", "frame", "x", "z", "pitch", "heading"),
    [
        ("mm, °", SHOULDER, "478.5", "7.6", "25.0", "tcp in {S}"),
        ("mm, °", BASE, "478.5", "282.1", "25.0", "tcp in base"),
        ("cm, rad", BASE, "47.85", "28.21", "0.436", "tcp in base"),
        ("in, °", SHOULDER, "18.840", "0.297", "25.0", "tcp in {S}"),
    ],
)
def test_tool_pose_is_shown_in_the_chosen_units_and_frame(
    arm: MountedArm,
    session: Session,
    units: str,
    frame: str,
    x: str,
    z: str,
    pitch: str,
    heading: str,
) -> None:
    display = PoseDisplay(*UNITS[units], frame, arm.T_base_shoulder)
    text = page(arm, session.begin(session.ready, 0.0, 0.0), display)
    assert f"<th>{heading}</th>" in text
    for place in ("now", "goal"):
        assert f"<td data-{place}='x'>{x}</td>" in text
        assert f"<td data-{place}='z'>{z}</td>" in text
        assert f"<td data-{place}='pitch'>{pitch}</td>" in text
    for unit in units.split(", "):
        assert text.count(f"<td class='unit'>{unit}</td>") == 3


@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize("frame", [BASE, SHOULDER])
def test_pose_is_the_same_from_its_numbers_in_any_units_and_frame(
    arm: MountedArm, units: str, frame: str
) -> None:
    T = forward(arm.chain, np.array([0.4, -1.0, 1.2, 0.3, -0.7]))
    display = PoseDisplay(*UNITS[units], frame, arm.T_base_shoulder)
    np.testing.assert_allclose(display.pose(*display.numbers(T)), T, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("limits", "shown"),
    [
        ((-108.861981, 108.861981), (-108.86, 108.86)),
        # Rounding errors of the conversion to radians and back.
        ((-173.35000000000002, 165.64999999999998), (-173.35, 165.65)),
    ],
)
def test_slider_ends_are_rounded_and_inside_the_limits(
    limits: tuple[float, float], shown: tuple[float, float]
) -> None:
    assert ends(*limits) == shown
