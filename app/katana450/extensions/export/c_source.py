"""A robot as C source: the paper's three arrays per link, a draw function, a viewer, kinematics.

The arrays of a link are `vertices[][3]`, `normals[][3]` and `face_indices[][9]`: for each triangle
the numbers of its vertices, of its normals and of its texture points, which no link has. The
algorithms of the kinematics are C files that are copied unchanged; headers have the numbers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib import resources

import numpy as np

from katana450.arm.robot.initial_camera import FIELD_OF_VIEW, camera
from katana450.arm.robot.link import Link
from katana450.arm.robot.robot import Robot
from katana450.extensions.export.files import distinct
from katana450.extensions.export.obj_text import indexed
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import FiveAxisArm, arm_of
from katana450.maths.kinematics.chain import Chain


def double(value: float) -> str:
    """Return ``value`` as a constant of type double, exactly."""
    if math.isinf(value):
        return "HUGE_VAL" if value > 0.0 else "-HUGE_VAL"
    return repr(float(value) + 0.0)


def text(value: str) -> str:
    """Return ``value`` as a string literal, with any characters."""
    plain = (
        chr(b) if 32 <= b < 127 and chr(b) not in '"\\?' else f"\\{b:03o}" for b in value.encode()
    )
    return f'"{"".join(plain)}"'


def comment(value: str) -> str:
    """Return ``value`` as it can stand in a comment."""
    return value.replace("*/", "* /").replace("/*", "/ *").replace("\n", " ").replace("\\", "/")


FRAMES, ARM = "frames.c", "arm_kinematics.c"
"""Files that are copied unchanged, the second only for an arm."""


def kinematics_files(robot: Robot) -> dict[str, str]:
    """Return names and texts of the files."""
    folder = resources.files("katana450.extensions.export") / "c"
    files = {
        "kinematics.h": _kinematics_header(robot),
        "links_data.h": _links(robot),
        FRAMES: (folder / FRAMES).read_text(encoding="utf-8"),
    }
    arm = robot.arm
    if arm is not None:
        joints = [robot.driven.index(name) for name in arm.chain.names]
        files["arm_data.h"] = arm_data(robot.name, arm.chain, arm.T_base_shoulder, joints)
        files[ARM] = (folder / ARM).read_text(encoding="utf-8")
    return files


def _kinematics_header(robot: Robot) -> str:
    if robot.arm is None:
        arm = f"/* There is no robot_fk and no robot_ik. {comment(robot.why)} */"
    else:
        arm = _ARM_HEADER.replace("TOOL", comment(robot.arm.default_tool))
    about = f"""\
/* {comment(robot.name)}: the kinematics. Nothing is allocated, and there is no state.
 *
 * Poses are 4 x 4 matrices row by row that map coordinates of a frame into those of another.
 * Lengths in m, angles in rad.
 */"""
    declarations = f"""\
#define ROBOT_LINKS {len(robot.links)}

/* Sets T to the pose of each link in the root link. q: values of the driven joints, in the order of
 * robot_joints in robot.h. */
void robot_frames(const double q[], double T[ROBOT_LINKS][16]);

/* The name of a link by its number from 0, parents first; a null pointer for other numbers. */
const char *robot_link_name(int link);

{arm}"""
    return header("KINEMATICS_H", about, declarations)


def header(guard: str, about: str, declarations: str, includes: str = "") -> str:
    """Return a header for C and C++ with the comment ``about``; ``guard``: its include guard."""
    return f"""\
{about}
#ifndef {guard}
#define {guard}
{includes}
#ifdef __cplusplus
extern "C" {{
#endif

{declarations}

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


TEMPLATES = ("viewer.c", "Makefile", "CMakeLists.txt", "CMakePresets.json", "vcpkg.json")
"""Files that are copied unchanged."""

RESERVED = frozenset(
    [
        *("auto", "break", "case", "char", "const", "continue", "default", "do", "double"),
        *("else", "enum", "extern", "float", "for", "goto", "if", "inline", "int", "long"),
        *("register", "restrict", "return", "short", "signed", "sizeof", "static", "struct"),
        *("switch", "typedef", "union", "unsigned", "void", "volatile", "while", "robot"),
        *("viewer", "kinematics", "links_data", "arm_data", "frames", "arm_kinematics"),
        *("main", "con", "prn", "aux", "nul"),
    ]
)
"""Keywords of C, file names of the project, and names that Windows reserves."""


def c_files(robot: Robot, values: Mapping[str, float]) -> dict[str, bytes]:
    """Return name and content of every file; the viewer starts at the joint ``values`` [rad, m]."""
    links = [link for link in robot.links if link.shapes]
    names = dict(
        zip(
            (link.name for link in links),
            distinct((link.name for link in links), RESERVED),
            strict=True,
        )
    )
    files: dict[str, str] = {}
    for link in links:
        files |= _part(link, names[link.name])
    files["robot.h"] = _header(robot)
    files["robot.c"] = _source(robot, names, values)
    files |= kinematics_files(robot)
    folder = resources.files("katana450.extensions.export") / "c"
    files |= {name: (folder / name).read_text(encoding="utf-8") for name in TEMPLATES}
    return {name: text.encode() for name, text in files.items()}


def _part(link: Link, name: str) -> dict[str, str]:
    """Return the header and the source of one link."""
    surface = indexed(link.shapes)
    faces = surface.faces
    rows = np.column_stack((faces, surface.normal_faces, np.zeros_like(faces)))
    index = "unsigned short" if rows.max() < 1 << 16 else "unsigned int"
    arrays = (
        f"const float {name}_vertices[{len(surface.points)}][3]",
        f"const float {name}_normals[{len(surface.normals)}][3]",
        f"const {index} {name}_face_indices[{len(faces)}][9]",
    )
    about = f"/* The link {comment(link.name)}: metres in its own frame. */"
    declarations = f"""\
#define {name.upper()}_FACES {len(faces)}

extern {arrays[0]};
extern {arrays[1]};

/* Per triangle: 3 vertices, 3 normals, 3 texture points (unused). */
extern {arrays[2]};

/* Draws the link with its materials in the current frame. */
void {name}_draw(void);"""
    surfaces, first = [], 0
    for shape in link.shapes:
        material = shape.material
        colour = ", ".join(_single(part) for part in material.colour)
        surfaces.append(
            f"    {{{first}, {len(shape.faces)}, {{{colour}, 1.0f}}, "
            f"{_single(round(material.gleam, 4))}, "
            f"{_single(round(96.0 * (1.0 - material.rough), 2))}}}, "
            f"/* {comment(material.name)} */"
        )
        first += len(shape.faces)
    rows_of = "\n".join
    source = f"""\
#include "{name}.h"

#include "robot.h"

{arrays[0]} = {{
{rows_of(_float_rows(surface.points))}
}};

{arrays[1]} = {{
{rows_of(_float_rows(surface.normals))}
}};

{arrays[2]} = {{
{rows_of(f"{{{','.join(map(str, row))}}}," for row in rows.tolist())}
}};

static const struct {{
    int first, count;
    float colour[4], gleam, shine;
}} surfaces[] = {{
{rows_of(surfaces)}
}};

{_DRAW.replace("NAME", name)}"""
    return {
        f"{name}.h": header(f"{name.upper()}_H", about, declarations),
        f"{name}.c": source,
    }


_DRAW = """\
void NAME_draw(void)
{
    static GLuint list;
    size_t s;
    int face, corner;
    if (list != 0) {
        glCallList(list);
        return;
    }
    list = glGenLists(1);
    glNewList(list, GL_COMPILE);
    for (s = 0; s < sizeof surfaces / sizeof surfaces[0]; s++) {
        const float gleam[4] = {surfaces[s].gleam, surfaces[s].gleam, surfaces[s].gleam, 1.0f};
        glMaterialfv(GL_FRONT, GL_AMBIENT_AND_DIFFUSE, surfaces[s].colour);
        glMaterialfv(GL_FRONT, GL_SPECULAR, gleam);
        glMaterialf(GL_FRONT, GL_SHININESS, surfaces[s].shine);
        glBegin(GL_TRIANGLES);
        for (face = surfaces[s].first; face < surfaces[s].first + surfaces[s].count; face++)
            for (corner = 0; corner < 3; corner++) {
                glNormal3fv(NAME_normals[NAME_face_indices[face][3 + corner]]);
                glVertex3fv(NAME_vertices[NAME_face_indices[face][corner]]);
            }
        glEnd();
    }
    glEndList();
    glCallList(list);
}
"""


def _header(robot: Robot) -> str:
    about = f"""\
/* {comment(robot.name)}: its joints, and a function that draws the whole robot. */"""
    includes = """
#ifdef _WIN32
#include <windows.h>
#endif
#include <GL/gl.h>
#include <stddef.h>
"""
    declarations = f"""\
#define ROBOT_NAME {text(robot.name)}
#define ROBOT_JOINTS {len(robot.driven)}

/* slides: nonzero if values are in m, else they are in rad. */
typedef struct {{
    const char *name;
    int slides;
    double lower, upper;
}} robot_joint;

/* The driven joints, and one empty entry at the end. */
extern const robot_joint robot_joints[ROBOT_JOINTS + 1];

/* Start values of the joints. */
extern const double robot_start[ROBOT_JOINTS + 1];

/* A camera that sees the whole robot: m in the base frame, z up; vertical field of view in rad. */
extern const double robot_eye[3], robot_target[3], robot_field_of_view;

/* Draws every link at the given joint values. */
void robot_draw(const double q[]);"""
    return header("ROBOT_H", about, declarations, includes)


def _source(robot: Robot, names: Mapping[str, str], values: Mapping[str, float]) -> str:
    view = camera(robot)
    joints = [robot.joints[name] for name in robot.driven]
    start = ", ".join(double(values[joint.name]) for joint in joints)
    table = "".join(
        f"    {{{text(joint.name)}, {int(joint.slides)}, "
        f"{double(joint.lower)}, {double(joint.upper)}}},\n"
        for joint in joints
    )
    draws = "".join(
        f"    {names[link.name]}_draw,\n" if link.name in names else "    NULL,\n"
        for link in robot.links
    )
    headers = "\n".join(f'#include "{name}.h"' for name in sorted(names.values()))
    return f"""\
#include "robot.h"

#include "kinematics.h"
{headers}

#include <math.h>

const robot_joint robot_joints[ROBOT_JOINTS + 1] = {{
{table}    {{NULL, 0, 0.0, 0.0}},
}};

const double robot_start[ROBOT_JOINTS + 1] = {{{start + ", " if start else ""}0.0}};

const double robot_eye[3] = {_list(view.eye)};
const double robot_target[3] = {_list(view.target)};
const double robot_field_of_view = {double(FIELD_OF_VIEW)};

/* The function that draws each link; a null pointer for a link without shapes. */
static void (*const draws[ROBOT_LINKS])(void) = {{
{draws}}};

void robot_draw(const double q[])
{{
    double T[ROBOT_LINKS][16], columns[16];
    int link, k;
    robot_frames(q, T);
    for (link = 0; link < ROBOT_LINKS; link++) {{
        if (draws[link] == NULL)
            continue;
        /* OpenGL has matrices column by column. */
        for (k = 0; k < 16; k++)
            columns[k] = T[link][4 * (k % 4) + k / 4];
        glPushMatrix();
        glMultMatrixd(columns);
        draws[link]();
        glPopMatrix();
    }}
}}
"""


def _float_rows(rows: FloatArray) -> Iterator[str]:
    for x, y, z in rows.tolist():
        yield f"{{{x!r}f,{y!r}f,{z!r}f}},"


def _single(value: float) -> str:
    return f"{round(float(value), 4)!r}f"
