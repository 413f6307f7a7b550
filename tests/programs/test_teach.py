"""Tests of taught poses as scripts, and of the folder in which scripts are saved."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control.arm import NO_GRIPPER, ArmModel
from katana450.assembly.robot_session import describe_robot
from katana450.errors import ConfigurationError, InputError
from katana450.extensions.general_arms.driven_tool import DrivenTool
from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.run.simulation import plan_script
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.script.script_files import Scripts
from katana450.extensions.programs.script.teach import TaughtPose, taught
from katana450.resources import INCLUDED, URDF_PATH
from katana450.settings import Settings
from tests.general_arms.published_arms import UR5E
from tests.programs.conftest import Stage

TAUGHT = """\
name: "Shown"
steps:
  - repeat:
      times: 3
      steps:
        - speed: 0.5
        - joints: [10, -68, 85, 8, 0]
        - gripper: 3
        - wait: 1.5
        - via: {through: [{joints: [20, -68, 85, 8, 0]}, {joints: [30, -68, 85, 8, 0]}]}
        - speed: 1
        - joints: [40, -68, 85, 8, 0]
"""


def test_a_script_of_poses_is_read_as_poses() -> None:
    teaching = taught(parse(TAUGHT))
    assert teaching is not None
    assert (teaching.name, teaching.times) == ("Shown", 3)
    rest = (-68.0, 85.0, 8.0, 0.0)
    assert teaching.poses == (
        TaughtPose((10.0, *rest), 0.5, gripper=3.0, wait=1.5),
        TaughtPose((20.0, *rest), 0.5, blend=True),
        TaughtPose((30.0, *rest), 0.5),
        TaughtPose((40.0, *rest)),
    )


def test_a_script_of_poses_goes_through_them(stage: Stage) -> None:
    program = stage.planned(TAUGHT)
    ends = [task.action.plan.end for task in program.tasks if isinstance(task.action, FollowPlan)]
    assert np.degrees([q[0] for q in ends]) == pytest.approx([10.0, 30.0, 40.0] * 3)


@pytest.mark.parametrize(
    "text",
    [
        "steps: [home]",
        "about: x\nsteps:\n  - joints: [0, 0, 0, 0, 0]",
        "gripper: none\nsteps:\n  - joints: [0, 0, 0, 0, 0]",
        "speed: 0.5\nsteps:\n  - joints: [0, 0, 0, 0, 0]",
        "steps:\n  - joints: [0, 0, 0, 0, 0]\n  - gripper: open",
        "steps:\n  - wait: 1\n  - joints: [0, 0, 0, 0, 0]",
        "steps:\n  - joints: [0, 0, 0, 0, 0]\n  - wait: 1\n  - gripper: 3",
        "steps:\n  - joints: [0, 0, 0, 0, 0]\n  - wait: 1\n  - wait: 1",
        "steps:\n  - via: {through: [{joints: [0, 0, 0, 0, 0]}, {x: 1, y: 1, z: 1}]}",
        "steps: [{via: {through: [{joints: [0,0,0,0,0]}, {joints: [1,1,1,1,1]}], blend: 0.2}}]",
        "steps: [{speed: 0.5}]",
    ],
)
def test_a_script_that_says_more_is_no_list_of_poses(text: str) -> None:
    assert taught(parse(text)) is None


def test_poses_of_a_partial_repetition_are_written_out() -> None:
    text = (
        "steps:\n  - repeat: {times: 2, steps: [{joints: [1, 0, 0, 0, 0]}]}\n"
        "  - joints: [2, 0, 0, 0, 0]\n"
    )
    teaching = taught(parse(text))
    assert teaching is not None
    assert (teaching.times, [pose.joints[0] for pose in teaching.poses]) == (1, [1.0, 1.0, 2.0])


def test_scripts_of_the_library_are_offered_to_arms_with_their_tools(tmp_path: Path) -> None:
    """The circle of the Katana, and its pour, are for arms of five axes with the same tools."""
    scripts, katana = Scripts(tmp_path), describe_robot(Settings(), URDF_PATH, None).session
    tools = {"tool0": katana.require_arm().chain.M}
    arm = replace(katana.require_arm(), tools=tools, default_tool="tool0")
    scripts.save("Mine", TAUGHT.replace("steps:", "tool: grasp\nsteps:"))
    assert scripts.offered(arm) == ("Mine", "Turn")
    bare = describe_robot(replace(Settings(), bare=True), URDF_PATH, None).session.require_arm()
    assert scripts.offered(bare) == ("Mine", "Circle", "Turn")
    so101 = describe_robot(Settings(), INCLUDED["so101"], None).session.require_arm()
    assert scripts.offered(so101) == ("Mine", "Small circle", "Turn")
    plan_script(parse(scripts.text("Small circle")), INCLUDED["so101"])
    six = ArmModel(UR5E, {"flange": UR5E.M}, "flange", NO_GRIPPER, to_tool=DrivenTool)
    assert scripts.offered(six) == ("Mine", "Turn")
    assert len(scripts.offered(None)) == len(scripts.paths)


@pytest.mark.parametrize("name", ["", "../out", "a/b", ".hidden", "x" * 41, "a\nb", "Mine"])
def test_an_invalid_name_is_refused(tmp_path: Path, name: str) -> None:
    scripts = Scripts(tmp_path)
    scripts.save("Mine", "steps: [home]")
    with pytest.raises(InputError):
        scripts.save(name, "steps: [home]")
    assert [path.name for path in tmp_path.iterdir()] == ["Mine.yaml"]


def test_without_a_folder_nothing_is_saved(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no folder for scripts"):
        Scripts().save("Mine", "steps: [home]")
    with pytest.raises(InputError, match="no longer exists"):
        Scripts().text("Mine")
    with pytest.raises(ConfigurationError, match="--programs"):
        Scripts(tmp_path / "none")
