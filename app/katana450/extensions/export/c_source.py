"""A robot as C source: the paper's three arrays per link, a draw function, and a viewer.

The arrays of a link are `vertices[][3]`, `normals[][3]` and `face_indices[][9]`: for each triangle
the numbers of its vertices, of its normals and of its texture points, which no link has.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import resources

import numpy as np

from katana450.arm.robot.initial_camera import FIELD_OF_VIEW, camera
from katana450.arm.robot.link import Joint, Link
from katana450.arm.robot.robot import Robot
from katana450.extensions.export.c_kinematics import kinematics_files
from katana450.extensions.export.c_text import comment, double, text
from katana450.extensions.export.names import distinct
from katana450.extensions.export.rows import distinct_rows
from katana450.maths.geometry.arrays import FloatArray

TEMPLATES = ("viewer.c", "Makefile", "CMakeLists.txt", "CMakePresets.json", "vcpkg.json")
"""Files that are copied unchanged."""

DIGITS, NORMAL_DIGITS = 5, 3
"""Decimal places of coordinates [m] and of normals."""

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
    vertices, at = distinct_rows([shape.vertices for shape in link.shapes], DIGITS)
    normals, along = distinct_rows([shape.normals for shape in link.shapes], NORMAL_DIGITS)
    firsts = np.cumsum([0] + [len(shape.vertices) for shape in link.shapes])
    faces = np.concatenate(
        [shape.faces + first for shape, first in zip(link.shapes, firsts, strict=False)]
    )
    rows = np.column_stack((at[faces], along[faces], np.zeros_like(faces)))
    index = "unsigned short" if rows.max() < 1 << 16 else "unsigned int"
    guard = f"{name.upper()}_H"
    arrays = (
        f"const float {name}_vertices[{len(vertices)}][3]",
        f"const float {name}_normals[{len(normals)}][3]",
        f"const {index} {name}_face_indices[{len(faces)}][9]",
    )
    header = "\n".join(
        (
            f"/* The link {comment(link.name)}: metres in its own frame. */",
            f"#ifndef {guard}",
            f"#define {guard}",
            "",
            "#ifdef __cplusplus",
            'extern "C" {',
            "#endif",
            "",
            f"#define {name.upper()}_FACES {len(faces)}",
            "",
            f"extern {arrays[0]};",
            f"extern {arrays[1]};",
            "",
            "/* Per triangle: 3 vertices, 3 normals, 3 texture points (unused). */",
            f"extern {arrays[2]};",
            "",
            "/* Draws the link with its materials in the current frame. */",
            f"void {name}_draw(void);",
            "",
            "#ifdef __cplusplus",
            "}",
            "#endif",
            "",
            "#endif",
            "",
        )
    )
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
    source = "\n".join(
        (
            f'#include "{name}.h"',
            "",
            '#include "robot.h"',
            "",
            f"{arrays[0]} = {{",
            *_float_rows(vertices),
            "};",
            "",
            f"{arrays[1]} = {{",
            *_float_rows(normals),
            "};",
            "",
            f"{arrays[2]} = {{",
            *(f"{{{','.join(map(str, row))}}}," for row in rows.tolist()),
            "};",
            "",
            "static const struct {",
            "    int first, count;",
            "    float colour[4], gleam, shine;",
            "} surfaces[] = {",
            *surfaces,
            "};",
            "",
            _DRAW.replace("NAME", name),
        )
    )
    return {f"{name}.h": header, f"{name}.c": source}


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
    return f"""\
/* {comment(robot.name)}: its joints, and a function that draws the whole robot. */
#ifndef ROBOT_H
#define ROBOT_H

#ifdef _WIN32
#include <windows.h>
#endif
#include <GL/gl.h>
#include <stddef.h>

#ifdef __cplusplus
extern "C" {{
#endif

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
void robot_draw(const double q[]);

#ifdef __cplusplus
}}
#endif

#endif
"""


def _source(robot: Robot, names: Mapping[str, str], values: Mapping[str, float]) -> str:
    view = camera(robot)
    joints = [robot.joints[name] for name in robot.driven]
    start = ", ".join(double(values[joint.name]) for joint in joints)
    table = "".join(
        f"    {{{text(joint.name)}, {int(joint.slides)}, "
        f"{double(joint.lower)}, {double(joint.upper)}}},\n"
        for joint in joints
    )
    lines = "\n".join(_drawn(robot, robot.links[0], names))
    headers = "\n".join(f'#include "{name}.h"' for name in sorted(names.values()))
    return f"""\
#include "robot.h"

{headers}

#include <math.h>

const robot_joint robot_joints[ROBOT_JOINTS + 1] = {{
{table}    {{NULL, 0, 0.0, 0.0}},
}};

const double robot_start[ROBOT_JOINTS + 1] = {{{start + ", " if start else ""}0.0}};

const double robot_eye[3] = {{{_triple(view.eye)}}};
const double robot_target[3] = {{{_triple(view.target)}}};
const double robot_field_of_view = {double(FIELD_OF_VIEW)};

static const double DEGREES = 57.29577951308232;

void robot_draw(const double q[])
{{
    (void)q;
    (void)DEGREES;
    glPushMatrix();
{lines}
    glPopMatrix();
}}
"""


def _drawn(robot: Robot, link: Link, names: Mapping[str, str]) -> Iterator[str]:
    """Yield statements that draw a link and its children; they leave the frame changed."""
    yield f"    /* {comment(link.name)} */"
    T = link.T_parent_link
    if not np.array_equal(T[:3, :3], np.eye(3)):
        # OpenGL stores matrices by columns.
        numbers = ", ".join(double(value) for value in T.T.ravel())
        yield f"    {{ static const double place[16] = {{{numbers}}}; glMultMatrixd(place); }}"
    elif T[:3, 3].any():
        yield f"    glTranslated({_triple(T[:3, 3])});"
    if link.joint is not None:
        yield f"    {_moved(robot, link.joint)}"
    if link.name in names:
        yield f"    {names[link.name]}_draw();"
    children = [child for child in robot.children(link) if _shows(robot, child)]
    for child in children:
        # The last child may change the frame, so a long chain needs no deep matrix stack.
        if child is children[-1]:
            yield from _drawn(robot, child, names)
        else:
            yield "    glPushMatrix();"
            yield from _drawn(robot, child, names)
            yield "    glPopMatrix();"


def _shows(robot: Robot, link: Link) -> bool:
    return bool(link.shapes) or any(_shows(robot, c) for c in robot.children(link))


def _moved(robot: Robot, joint: Joint) -> str:
    value = f"q[{robot.driven.index(joint.leader)}]"
    if (joint.factor, joint.offset) != (1.0, 0.0):
        value = f"({double(joint.factor)} * {value} + {double(joint.offset)})"
    if joint.slides:
        x, y, z = (f"{double(part)} * {value}" for part in joint.axis)
        return f"glTranslated({x}, {y}, {z});"
    return f"glRotated(DEGREES * {value}, {_triple(joint.axis)});"


def _float_rows(rows: FloatArray) -> Iterator[str]:
    for x, y, z in rows.tolist():
        yield f"{{{x!r}f,{y!r}f,{z!r}f}},"


def _single(value: float) -> str:
    return f"{round(float(value), 4)!r}f"


def _triple(values: FloatArray) -> str:
    return ", ".join(double(value) for value in values)
