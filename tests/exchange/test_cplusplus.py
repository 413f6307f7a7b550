"""Tests of the C export in C++: its headers, linked with objects of either compiler.

OpenGL is replaced by stubs, so that none of its libraries is needed.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from katana450.arm.robot.robot import Robot
from katana450.extensions.export.c_source import c_files
from tests.exchange.conftest import GANTRY_POSE
from tests.exchange.tools import needs, run

GL = """\
#ifdef __cplusplus
extern "C" {
#endif
typedef unsigned GLuint;
enum { GL_COMPILE, GL_FRONT, GL_AMBIENT_AND_DIFFUSE, GL_SPECULAR, GL_SHININESS, GL_TRIANGLES };
GLuint glGenLists(int count);
void glNewList(GLuint list, unsigned mode);
void glEndList(void);
void glCallList(GLuint list);
void glMaterialfv(unsigned face, unsigned name, const float *values);
void glMaterialf(unsigned face, unsigned name, float value);
void glBegin(unsigned mode);
void glEnd(void);
void glNormal3fv(const float *v);
void glVertex3fv(const float *v);
void glPushMatrix(void);
void glPopMatrix(void);
void glMultMatrixd(const double *m);
#ifdef __cplusplus
}
#endif
"""

COMPILED = ("viewer.c", "robot.c", "frames.c", "arm_kinematics.c")

MAIN = """\
#include "robot.h"
#include "PART.h"
#include <cstdio>

static int corners = 0;
GLuint glGenLists(int) { return 1; }
void glNewList(GLuint, unsigned) {}
void glEndList() {}
void glCallList(GLuint) {}
void glMaterialfv(unsigned, unsigned, const float *) {}
void glMaterialf(unsigned, unsigned, float) {}
void glBegin(unsigned) {}
void glEnd() {}
void glNormal3fv(const float *) {}
void glVertex3fv(const float *) { corners++; }
void glPushMatrix() {}
void glPopMatrix() {}
void glMultMatrixd(const double *) {}

int main()
{
    robot_draw(robot_start);
    std::printf("%d %s %g %d\\n", corners, robot_joints[0].name, robot_start[0],
                int(sizeof PART_face_indices / sizeof PART_face_indices[0]) == PART_FACES);
    return 0;
}
"""


@needs("g++", "/usr/include/GL/freeglut.h")
def test_viewer_and_kinematics_compile_as_cplusplus(tmp_path: Path, katana: Robot) -> None:
    """Visual C++ takes files named .c as C, but as C++ in a project that says so."""
    files = c_files(katana, katana.values(()))
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    strict = ("-Wall", "-Wextra", "-pedantic", "-Werror", "-fsyntax-only")
    run("g++", "-std=c++98", *strict, "-x", "c++", *COMPILED, folder=tmp_path)


@needs("gcc", "g++")
@pytest.mark.parametrize("compiler", ["gcc -std=c99", "g++ -std=c++98"], ids=["C", "C++"])
def test_cplusplus_program_draws_the_exported_robot(
    tmp_path: Path, gantry: Robot, compiler: str
) -> None:
    files = c_files(gantry, gantry.values(GANTRY_POSE))
    (tmp_path / "GL").mkdir()
    (tmp_path / "GL" / "gl.h").write_text(GL)
    sources = [name for name in files if name.endswith(".c") and name != "viewer.c"]
    part = next(name[:-2] for name in sources if name != "robot.c")
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "main.cpp").write_text(
        MAIN.replace("PART_FACES", f"{part.upper()}_FACES").replace("PART", part)
    )
    strict = ("-Wall", "-Wextra", "-pedantic", "-Werror", "-I.", "-c")
    program, language = compiler.split()
    as_language = ("-x", "c++") if program == "g++" else ()
    run(program, language, *strict, *as_language, *sources, folder=tmp_path)
    run("g++", "-std=c++17", *strict, "main.cpp", folder=tmp_path)
    objects = [f"{name[:-2]}.o" for name in sources]
    run("g++", "-o", "drawn", "main.o", *objects, "-lm", folder=tmp_path)
    count, joint, start, has_faces = run(tmp_path / "drawn").split()
    faces = sum(len(shape.faces) for link in gantry.links for shape in link.shapes)
    assert int(count) == 3 * faces
    assert joint == gantry.driven[0]
    assert float(start) == pytest.approx(GANTRY_POSE[0])
    assert has_faces == "1"
