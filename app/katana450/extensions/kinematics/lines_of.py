"""The kinematics behind ``katana450 fk`` and ``ik``, chosen by the arm in the file."""

from __future__ import annotations

from argparse import Namespace

from katana450.errors import InputError, RobotDescriptionError
from katana450.extensions.general_arms.described_arm import DescribedArm, described_arm
from katana450.extensions.kinematics.general_lines import GeneralLines
from katana450.extensions.kinematics.json_lines import JsonKinematics, answer_lines
from katana450.maths.kinematics.kinematics import FiveAxisKinematics
from katana450.maths.kinematics.priority import Priority


def fk(options: Namespace) -> int:
    """Execute ``katana450 fk``; return the exit status."""
    return answer_lines(lines_of(options).fk)


def ik(options: Namespace) -> int:
    """Execute ``katana450 ik``; return the exit status."""
    return answer_lines(lines_of(options).ik)


def lines_of(options: Namespace) -> JsonKinematics | GeneralLines:
    """Return the answers of the arm that ``options`` of ``fk`` or ``ik`` name.

    Raises RobotDescriptionError for a file without an arm, InputError for an option that such an
    arm does not have.
    """
    in_base_frame = options.frame == "base"
    priority = getattr(options, "priority", "pose")
    with_nearest = getattr(options, "nearest", False)
    try:
        return JsonKinematics(
            options.urdf,
            options.tool,
            in_base_frame=in_base_frame,
            priority=Priority[priority.upper()],
            with_nearest=with_nearest,
        )
    except RobotDescriptionError:
        arm = _other_arm(options)
        if arm is None:
            raise
    if priority != "pose":
        raise InputError(
            "--priority is for five-axis arms with a pan axis, three parallel axes and a roll "
            f"axis; the kinematics of this arm are {arm.kinematics.method}. Leave this option out."
        )
    return GeneralLines(arm, in_base_frame=in_base_frame, with_nearest=with_nearest)


def _other_arm(options: Namespace) -> DescribedArm | None:
    """Return the arm of another kind in the file; None if there is none."""
    try:
        arm = described_arm(options.urdf, options.tool)
    except RobotDescriptionError:
        return None
    return None if isinstance(arm.kinematics, FiveAxisKinematics) else arm
