"""Loading an arm from its URDF file."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from katana450.assembly.robot_files import read_robot
from katana450.assembly.robot_session import find_robot
from katana450.extensions.general_arms.driven_tool import solved_arm
from katana450.extensions.importers.formats.scene_file import load_initial_scene
from katana450.library.arm import Arm
from katana450.library.pose_frame import PoseFrame
from katana450.resources import URDF_PATH
from katana450.settings import Settings

FrameName = Literal["shoulder", "base"]


def load(
    urdf: str | Path | None = None,
    tool: str | None = None,
    *,
    frame: FrameName = "shoulder",
    scene: str | Path | None = None,
) -> Arm:
    """Load an arm from a URDF file.

    Its poses are solved in closed form for the arms listed in docs/library.md, else numerically;
    ``method`` of the arm says which.

    Args:
        urdf: the file; None for the Katana450.
        tool: link to which poses refer; None for the default (``tcp`` for the Katana450).
        frame: coordinates of all poses and points: "shoulder", the paper's frame {S} where axes 1
            and 2 cross, parallel to the base; or "base", the root link of the URDF.
        scene: YAML file of further obstacles for plans, beside the arm itself and the table
            (docs/scenes.md); None for those of the app, a cup and a basin.

    Raises:
        RobotDescriptionError: the file cannot be read or has no arm of three or more turning axes.
        InputError: the frame is unknown or the scene is invalid; the message says what to do.

    >>> arm = katana450.load()
    >>> arm.name, arm.tool, arm.n
    ('katana450', 'tcp', 5)
    >>> katana450.load(tool="hand")
    Traceback (most recent call last):
        ...
    katana450.errors.RobotDescriptionError: ...
    """
    path = URDF_PATH if urdf is None else Path(urdf)
    scene_path = None if scene is None else Path(scene)
    robot, session, notes = find_robot(Settings(), path, tool)
    if robot.arm is None:
        # Beside the arm are joints that a server would drive one by one.
        tool = read_robot(path, None, solved_arm).require_arm().default_tool
        robot, session, notes = find_robot(Settings(), path, tool)
    return Arm(
        robot=robot,
        session=session,
        notes=notes,
        pose_frame=PoseFrame.of(robot.require_arm().T_base_shoulder, frame),
        objects=load_initial_scene(session, scene_path).scene.objects,
    )
