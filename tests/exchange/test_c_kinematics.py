"""Tests of the kinematics in the C export: the same answers as ours, and no allocation."""

from __future__ import annotations

import ctypes
import math
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.extensions.export.c_source import arm_data, kinematics_files
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_space
from katana450.maths.kinematics.solver import inverse
from katana450.resources import URDF_PATH
from tests.docs.code_blocks import code_block
from tests.exchange.conftest import GANTRY_POSE
from tests.exchange.tools import needs, run
from tests.kinematics.family import random_member

YOUBOT = Path(__file__).parents[1] / "robot" / "arms" / "youbot_arm.urdf"

SAME = 1e-12
"""[rad, m] Largest difference of an answer."""

MATHEMATICS = {
    *("atan2", "ceil", "cos", "fabs", "floor", "hypot", "remainder", "sin", "sincos", "sqrt"),
    # Calls that compilers make of copies of arrays, and of large local ones.
    *("memcpy", "memset", "memmove", "__stack_chk_fail", "_GLOBAL_OFFSET_TABLE_"),
}
"""Functions of others that the objects may use."""


class Solution(ctypes.Structure):
    _fields_ = (
        ("q", ctypes.c_double * 5),
        ("within_limits", ctypes.c_int),
        ("exact", ctypes.c_int),
        ("position_error", ctypes.c_double),
        ("rotation_error", ctypes.c_double),
    )


class Compiled:
    """The exported functions of one robot."""

    def __init__(self, folder: Path, files: dict[str, str]) -> None:
        folder.mkdir(exist_ok=True)
        for name, text in files.items():
            (folder / name).write_text(text)
        sources = sorted(name for name in files if name.endswith(".c"))
        strict = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-ffp-contract=off")
        library = folder / "kinematics.so"
        run(
            "gcc", *strict, "-O2", "-fPIC", "-shared", "-o", library, *sources, "-lm", folder=folder
        )
        self._library = ctypes.CDLL(str(library))

    def tool(self, q: FloatArray) -> FloatArray:
        T = np.empty((4, 4))
        self._library.robot_fk(_pointer(np.ascontiguousarray(q)), _pointer(T))
        return T

    def jacobian(self, q: FloatArray) -> FloatArray:
        J = np.empty((6, 5))
        self._library.robot_jacobian(_pointer(np.ascontiguousarray(q)), _pointer(J))
        return J

    def solutions(self, T: FloatArray, theta1: float = 0.0) -> tuple[int, list[Solution]]:
        solutions = (Solution * 4)()
        T = np.ascontiguousarray(T)
        count = self._library.robot_ik(_pointer(T), ctypes.c_double(theta1), solutions)
        return int(count), list(solutions)

    def frames(self, q: FloatArray, links: int) -> FloatArray:
        T = np.empty((links, 4, 4))
        self._library.robot_frames(_pointer(np.ascontiguousarray(q, dtype=float)), _pointer(T))
        return T

    def link_name(self, number: int) -> str | None:
        self._library.robot_link_name.restype = ctypes.c_char_p
        name = self._library.robot_link_name(number)
        return None if name is None else name.decode()


def _pointer(values: FloatArray) -> ctypes.c_void_p:
    return ctypes.c_void_p(values.ctypes.data)


@pytest.fixture(scope="module")
def katana_in_c(tmp_path_factory: pytest.TempPathFactory, katana: Robot) -> Compiled:
    return Compiled(tmp_path_factory.mktemp("katana"), kinematics_files(katana))


def check(
    compiled: Compiled, chain: Chain, T: FloatArray, theta1: float = 0.0, *, turns: bool = True
) -> float:
    """Compare all answers for one pose; return the largest difference of an angle.

    Whole turns are a difference only if ``turns`` count.
    """
    hint = np.array([theta1, 0.0, 0.0, 0.0, 0.0])
    ours = inverse(chain, T, q_hint=hint)
    count, theirs = compiled.solutions(T, theta1)
    worst = 0.0
    for mine, other in zip(ours, theirs, strict=True):
        apart = np.array(other.q) - mine.angles
        if not turns:
            apart -= math.tau * np.round(apart / math.tau)
        worst = max(worst, float(np.abs(apart).max()))
        assert other.within_limits == mine.within_limits
        assert other.exact == mine.exact
        assert other.position_error == pytest.approx(mine.position_error, abs=1e-12)
        assert other.rotation_error == pytest.approx(mine.rotation_error, abs=1e-7)
    assert count == sum(mine.exact and mine.within_limits for mine in ours)
    return worst


def compare(compiled: Compiled, chain: Chain, poses: int, seed: int) -> dict[str, float]:
    """Return the largest differences of all answers at random joint angles."""
    random = np.random.default_rng(seed)
    worst = dict.fromkeys(("fk", "jacobian", "ik"), 0.0)
    for q in random.uniform(chain.lower, chain.upper, (poses, 5)):
        T = forward(chain, q)
        fk = float(np.abs(compiled.tool(q) - T).max())
        J = float(np.abs(compiled.jacobian(q) - jacobian_space(chain, q)).max())
        ik = check(compiled, chain, T)
        for name, value in zip(worst, (fk, J, ik), strict=True):
            worst[name] = max(worst[name], value)
    return worst


@needs("gcc")
@pytest.mark.parametrize("poses", [200, pytest.param(10_000, marks=pytest.mark.long)])
@pytest.mark.parametrize("path", [URDF_PATH, YOUBOT], ids=lambda path: path.stem)
def test_an_arm_has_the_same_answers(tmp_path: Path, path: Path, poses: int) -> None:
    """The axes of the youBot have both signs, and its tool frame is turned."""
    robot = load(path)
    compiled = Compiled(tmp_path, kinematics_files(robot))
    assert max(compare(compiled, robot.require_arm().chain, poses, 450).values()) <= SAME


@needs("gcc")
@pytest.mark.long
@pytest.mark.parametrize("lateral", [False, True])
def test_members_of_the_family_have_the_same_answers(
    tmp_path: Path, katana: Robot, lateral: bool
) -> None:
    """{S} is anywhere, up to two metres away, so that our own answers have fewer digits."""
    random = np.random.default_rng(7)
    files = kinematics_files(katana)
    for number in range(20):
        chain, _ = random_member(random, lateral=lateral)
        files["arm_data.h"] = arm_data("a member", chain, np.eye(4), range(5))
        compiled = Compiled(tmp_path / str(number), files)
        worst = compare(compiled, chain, 100, number)
        assert worst["fk"] <= SAME
        assert worst["jacobian"] <= SAME
        assert worst["ik"] <= 1e-11


@needs("gcc")
def test_poses_beyond_reach_have_the_same_answers(katana: Robot, katana_in_c: Compiled) -> None:
    """Five axes cannot take these poses; both sides come equally near."""
    chain = katana.require_arm().chain
    random = np.random.default_rng(3)
    for _ in range(100):
        T = se3.from_rotation_translation(
            so3.exp(random.normal(size=3) * 2.0), random.uniform(-0.8, 0.8, 3)
        )
        assert check(katana_in_c, chain, T) <= SAME
        count, _ = katana_in_c.solutions(T)
        assert count == 0


@needs("gcc")
@pytest.mark.parametrize(
    "q",
    [
        # Stretched, folded, tool upright, on axis 1, and upright on axis 1 (theta1 is free).
        (0.3, 0.0, 0.0, 0.4, 0.1),
        (0.0, 0.0, 0.0, 0.0, 0.0),
        (0.3, -1.0, 1.2, 1.3707963267948966, 0.5),
        (0.7, -1.5707963267948966, 0.0, 0.0, 0.2),
    ],
)
def test_singular_poses_have_the_same_answers(
    katana: Robot, katana_in_c: Compiled, q: tuple[float, ...]
) -> None:
    """Rounding grows to its square root there, in both answers alike."""
    chain = katana.require_arm().chain
    for theta1 in (0.0, 0.7):
        assert check(katana_in_c, chain, forward(chain, q), theta1, turns=False) <= 1e-7


@needs("gcc")
def test_poses_near_axis_1_have_the_same_answers(katana: Robot, katana_in_c: Compiled) -> None:
    """There the tool's direction determines theta1, or nothing does."""
    chain = katana.require_arm().chain
    random = np.random.default_rng(5)
    upright = so3.rotation_y(0.5 * math.pi)
    for distance in (0.0, 1e-16, 1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-3, 1e-2):
        for turn in random.uniform(-3.0, 3.0, 10):
            R = so3.exp(random.normal(size=3) * 2.0)
            for rotation in (R, so3.rotation_z(turn) @ upright):
                place = (distance * math.cos(turn), distance * math.sin(turn), 0.3)
                T = se3.from_rotation_translation(rotation, place)
                assert check(katana_in_c, chain, T, turn, turns=False) <= SAME


@needs("gcc")
def test_what_is_no_pose_is_refused(katana_in_c: Compiled) -> None:
    for row, column, value in ((0, 0, 2.0), (1, 3, np.nan), (3, 0, 1.0), (2, 3, np.inf)):
        T = np.eye(4)
        T[row, column] = value
        assert katana_in_c.solutions(T)[0] == -1
    assert katana_in_c.solutions(np.diag([1.0, 1.0, -1.0, 1.0]))[0] == -1


@needs("gcc")
def test_links_have_the_same_poses(
    tmp_path: Path, katana: Robot, katana_in_c: Compiled, gantry: Robot
) -> None:
    pairs = (
        (katana, katana_in_c, (0.4, -1.187, 1.484, 0.14, 0.5, 0.2)),
        (gantry, Compiled(tmp_path / "gantry", kinematics_files(gantry)), GANTRY_POSE),
    )
    for robot, compiled, pose in pairs:
        frames = robot.frames(robot.values(pose))
        compiled_frames = compiled.frames(np.array(pose), len(robot.links))
        for number, (link, T) in enumerate(frames.items()):
            assert compiled.link_name(number) == link
            np.testing.assert_allclose(compiled_frames[number], T, atol=1e-12, err_msg=link)
        assert compiled.link_name(len(robot.links)) is None


@needs("gcc", "nm")
def test_nothing_is_allocated(tmp_path: Path, katana: Robot) -> None:
    """The objects call functions of mathematics only."""
    files = kinematics_files(katana)
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    for source in ("frames.c", "arm_kinematics.c"):
        run("gcc", "-std=c99", "-O2", "-c", source, folder=tmp_path)
        listed = run("nm", source.replace(".c", ".o"), folder=tmp_path)
        used = set(re.findall(r" U (\w+)", listed))
        assert used
        assert not {name for name in used if re.search("alloc|free|new|mmap|brk", name)}
        # Other systems have other names for the functions of mathematics.
        assert used <= MATHEMATICS or sys.platform != "linux"


@needs("gcc")
def test_printed_program_runs(tmp_path: Path, katana: Robot) -> None:
    for name, text in kinematics_files(katana).items():
        (tmp_path / name).write_text(text)
    (tmp_path / "main.c").write_text(code_block("docs/exchange.md", '#include "kinematics.h"').text)
    sources = ("main.c", "frames.c", "arm_kinematics.c")
    run("gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", *sources, "-lm", folder=tmp_path)
    tool, count, *postures = run(tmp_path / "a.out").splitlines()
    chain = katana.require_arm().chain
    T = forward(chain, (0.0, -1.187, 1.484, 0.14, 0.0))
    possible = [answer for answer in inverse(chain, T) if answer.exact and answer.within_limits]
    assert tool == "tool at {:.4f} {:.4f} {:.4f} m".format(*T[:3, 3])
    assert (count, len(postures)) == (f"{len(possible)} postures", 4)


def test_a_mechanism_without_an_arm_has_frames_only(gantry: Robot) -> None:
    files = kinematics_files(gantry)
    assert set(files) == {"kinematics.h", "links_data.h", "frames.c"}
    assert "There is no robot_fk and no robot_ik." in files["kinematics.h"]
    assert gantry.why
    assert "robot_frames" in files["kinematics.h"]
