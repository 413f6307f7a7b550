"""The kinematics of a robot as C: poses of its links, and of an arm the inverse kinematics too.

The algorithms are C files that are copied unchanged. The robot is in headers with its numbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from importlib import resources

import numpy as np

from katana450.arm.robot.link import Link
from katana450.arm.robot.robot import Robot
from katana450.extensions.export.c_text import comment, double, text
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import FiveAxisArm, arm_of
from katana450.maths.kinematics.chain import Chain

FRAMES, ARM = "frames.c", "arm_kinematics.c"
"""Files that are copied unchanged, the second only for an arm."""


def kinematics_files(robot: Robot) -> dict[str, str]:
    """Return names and texts of the files."""
    folder = resources.files("katana450.extensions.export") / "c"
    files = {
        "kinematics.h": _header(robot),
        "links_data.h": _links(robot),
        FRAMES: (folder / FRAMES).read_text(encoding="utf-8"),
    }
    arm = robot.arm
    if arm is not None:
        joints = [robot.driven.index(name) for name in arm.chain.names]
        files["arm_data.h"] = arm_data(robot.name, arm.chain, arm.T_base_shoulder, joints)
        files[ARM] = (folder / ARM).read_text(encoding="utf-8")
    return files


def _header(robot: Robot) -> str:
    if robot.arm is None:
        arm = f"/* There is no robot_fk and no robot_ik. {comment(robot.why)} */"
    else:
        arm = _ARM_HEADER.replace("TOOL", comment(robot.arm.default_tool))
    return f"""\
/* {comment(robot.name)}: the kinematics. Nothing is allocated, and there is no state.
 *
 * Poses are 4 x 4 matrices row by row that map coordinates of a frame into those of another.
 * Lengths in m, angles in rad.
 */
#ifndef KINEMATICS_H
#define KINEMATICS_H

#ifdef __cplusplus
extern "C" {{
#endif

#define ROBOT_LINKS {len(robot.links)}

/* Sets T to the pose of each link in the root link. q: values of the driven joints, in the order of
 * robot_joints in robot.h. */
void robot_frames(const double q[], double T[ROBOT_LINKS][16]);

/* The name of a link by its number from 0, parents first; a null pointer for other numbers. */
const char *robot_link_name(int link);

{arm}

#ifdef __cplusplus
}}
#endif

#endif
"""


_ARM_HEADER = """\
/* The arm: its five axes, whose tool is the link TOOL. */
#define ROBOT_AXES 5

/* For each axis the index of its joint in the q of robot_frames. */
extern const int robot_axis_joints[ROBOT_AXES];

/* The pose in the root link of {S}, the frame at the shoulder in which poses of the tool are. */
extern const double robot_shoulder[16];

/* Sets T to the pose of the tool in {S} at the angles q. */
void robot_fk(const double q[ROBOT_AXES], double T[16]);

/* Sets J so that J qd is the twist (omega, v) of the tool in {S}, at the angles q and rates qd; v
 * is the velocity of the point of the tool's body that is at the origin of {S}. */
void robot_jacobian(const double q[ROBOT_AXES], double J[6][ROBOT_AXES]);

/* One solution of the inverse kinematics.
 *   within_limits   whether every angle is inside its limits
 *   exact           whether the arm takes the pose, to within rounding
 *   position_error, rotation_error   distance [m] and angle [rad] of the arm's tool from the pose
 */
typedef struct {
    double q[ROBOT_AXES];
    int within_limits, exact;
    double position_error, rotation_error;
} robot_solution;

/* Finds the four solutions for the pose T of the tool in {S}: front and up, front and down, back
 * and up, back and down, for the side of the arm that faces the tool point and for the elbow.
 * Returns how many of them are exact and within the limits; -1 if T is no pose.
 *
 * For a pose that five axes cannot take, the solutions come near it and are not exact. Each angle
 * is in the turn inside its limits if there is one, else in [-pi, pi]. theta1 is used where the
 * pose leaves axis 1 free. */
int robot_ik(const double T[16], double theta1, robot_solution found[4]);"""


def _links(robot: Robot) -> str:
    numbers = {link.name: number for number, link in enumerate(robot.links)}
    rows = "\n".join(
        f"    {{{_link(robot, link, -1 if link.parent is None else numbers[link.parent])}}},"
        for link in robot.links
    )
    return f"""\
/* The links of {comment(robot.name)}. */

/* parent, joint: -1 without one. value of the joint = factor * q[joint] + offset. */
typedef struct {{
    const char *name;
    int parent, joint, slides;
    double factor, offset, axis[3], place[16];
}} link_data;

static const link_data links[ROBOT_LINKS] = {{
{rows}
}};
"""


def _link(robot: Robot, link: Link, parent: int) -> str:
    joint = link.joint
    place = _list(link.T_parent_link.ravel())
    if joint is None:
        return f"{text(link.name)}, {parent}, -1, 0, 0.0, 0.0, {{0.0, 0.0, 1.0}},\n     {place}"
    return (
        f"{text(link.name)}, {parent}, {robot.driven.index(joint.leader)}, {int(joint.slides)}, "
        f"{double(joint.factor)}, {double(joint.offset)}, {_list(joint.axis)},\n     {place}"
    )


def arm_data(name: str, chain: Chain, T_base_shoulder: FloatArray, joints: Sequence[int]) -> str:
    """Return the header `arm_data.h` with the numbers of an arm.

    Args:
        name: of the robot.
        chain: the axes of the arm.
        T_base_shoulder: (4, 4) pose of the chain's frame in the root link [m].
        joints: (n,) index of each axis among the driven joints.

    Raises:
        RobotDescriptionError: the chain is not in the family.
    """
    arm = arm_of(chain)
    lines = [
        f"/* The arm of {comment(name)}; arm_kinematics.c uses the names. */",
        f"const int robot_axis_joints[ROBOT_AXES] = {{{', '.join(map(str, joints))}}};",
        _array("const double robot_shoulder[16]", T_base_shoulder),
        _array("static const double tool_at_zero[16]", chain.M),
        _rows("static const double screws[ROBOT_AXES][6]", chain.S.T),
        _rows("static const double generators[ROBOT_AXES][16]", chain.generators),
        _rows("static const double squared_generators[ROBOT_AXES][16]", chain.generators_squared),
        _array("static const double arm_lower[ROBOT_AXES]", chain.lower),
        _array("static const double arm_upper[ROBOT_AXES]", chain.upper),
        "",
        "/* The canonical arm: its frames, alpha = sign * q + shift, and its lengths. */",
        *_canonical(arm),
        "",
        "/* Whether poses need no change of frames; whether half a turn about axis 1 mirrors the",
        " * plane of the arm; whether the angles of the joints are the canonical ones. */",
        f"#define ARM_IS_CANONICAL {int(arm.is_canonical)}",
        f"#define ARM_IS_MIRRORED {int(arm.is_mirrored)}",
        f"#define ARM_IS_DIRECT {int(_is_direct(arm, chain))}",
        "",
    ]
    return "\n".join(lines)


def _canonical(arm: FiveAxisArm) -> Iterator[str]:
    yield _array("static const double canonical_base[16]", arm.T_C_S)
    yield _array("static const double canonical_tool[16]", arm.T_tool_K)
    yield _array("static const double arm_signs[ROBOT_AXES]", arm.signs)
    yield _array("static const double arm_shifts[ROBOT_AXES]", arm.shifts)
    longest = arm.l1 + arm.l2
    for name, value in {
        "arm_a": arm.a,
        "arm_d": arm.d,
        "arm_tilt": arm.tilt,
        "arm_reach": arm.reach,
        "arm_longest": longest,
        "arm_shortest": abs(arm.l1 - arm.l2),
        "arm_squares": (arm.l1 - arm.l2) * longest,
        "arm_ahead": arm.l3 * math.cos(arm.tilt),
        "arm_below": arm.l3 * math.sin(arm.tilt),
        "arm_off_axis": arm.off_axis,
        "arm_skew": arm.skew,
        "arm_rounding": 4.0 * (arm.skew * arm.reach + arm.gap),
    }.items():
        yield f"static const double {name} = {double(value)};"


def _is_direct(arm: FiveAxisArm, chain: Chain) -> bool:
    """Return whether canonical angles are joint angles, and no limit is beyond half a turn."""
    return (
        arm.signs == (1.0,) * chain.n
        and arm.shifts == (0.0,) * chain.n
        and max(-float(chain.lower.min()), float(chain.upper.max())) <= math.pi
    )


def _list(values: Iterable[float]) -> str:
    return f"{{{', '.join(double(value) for value in values)}}}"


def _array(declaration: str, values: FloatArray | Sequence[float]) -> str:
    return f"{declaration} = {_list(np.asarray(values).ravel())};"


def _rows(declaration: str, rows: FloatArray) -> str:
    lines = "".join(f"    {_list(row.ravel())},\n" for row in rows)
    return f"{declaration} = {{\n{lines}}};"
