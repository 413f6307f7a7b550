"""Tests of the C export in C++: its sources compile as C++, and C++ calls the functions of C."""

from __future__ import annotations

from pathlib import Path

from katana450.arm.robot.robot import Robot
from katana450.extensions.export.c_source import c_files, kinematics_files
from tests.docs.code_blocks import code_block
from tests.exchange.tools import needs, run

STRICT = ("-Wall", "-Wextra", "-pedantic", "-Werror")


@needs("g++", "/usr/include/GL/freeglut.h")
def test_viewer_and_kinematics_compile_as_cplusplus(tmp_path: Path, katana: Robot) -> None:
    """Visual C++ takes files named .c as C, but as C++ in a project that says so."""
    for name, content in c_files(katana, katana.values(())).items():
        (tmp_path / name).write_bytes(content)
    sources = ("viewer.c", "robot.c", "frames.c", "arm_kinematics.c")
    run("g++", "-std=c++98", *STRICT, "-fsyntax-only", "-x", "c++", *sources, folder=tmp_path)


@needs("gcc", "g++")
def test_cplusplus_calls_the_functions_of_c(tmp_path: Path, katana: Robot) -> None:
    for name, text in kinematics_files(katana).items():
        (tmp_path / name).write_text(text)
    (tmp_path / "main.cpp").write_text(
        code_block("docs/exchange.md", '#include "kinematics.h"').text
    )
    run("gcc", "-std=c99", *STRICT, "-c", "frames.c", "arm_kinematics.c", folder=tmp_path)
    objects = ("frames.o", "arm_kinematics.o")
    run("g++", "-std=c++98", *STRICT, "main.cpp", *objects, "-lm", folder=tmp_path)
    assert run(tmp_path / "a.out").startswith("tool at ")
