"""``katana450 fk`` and ``ik`` as another program uses them: lines in, lines out."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.robot.arm_reader import MountedArm
from tests.cli.lines import ask

ROOT = Path(__file__).resolve().parents[2]
GOLDEN = json.loads((ROOT / "tests" / "golden" / "fk_reference.json").read_text(encoding="utf-8"))


def test_ik_gives_back_the_joints_among_every_branch() -> None:
    samples = GOLDEN["samples"]
    poses = ask("fk", [{"q": sample["q"]} for sample in samples])
    answers = ask("ik", poses)
    for sample, answer in zip(samples, answers, strict=True):
        same = [s for s in answer["solutions"] if np.allclose(s["q"], sample["q"])]
        assert same
        assert all(solution["within_limits"] for solution in same)
        assert {s["branch"] for s in answer["solutions"]} == {
            "front-up",
            "front-down",
            "back-up",
            "back-down",
        }
        assert answer["residual_mm"] < 1e-9
        assert answer["residual_rad"] < 1e-9


def test_ik_states_the_error_of_a_pose_that_five_axes_cannot_take() -> None:
    T = np.eye(4)
    T[:3, 3] = [0.3, 0.3, 0.0]  # the arm points along the diagonal, the pose along x
    (answer,) = ask("ik", [{"T": T.tolist()}])
    assert answer["residual_mm"] < 1e-9
    assert answer["residual_rad"] == pytest.approx(np.pi / 4, abs=1e-9)
    T[:3, 3] = [1.0, 0.0, 0.0]
    (answer,) = ask("ik", [{"T": T.tolist()}])
    assert answer["residual_mm"] == pytest.approx(1000.0 - 631.8, abs=1e-6)


def test_posture_in_a_line_of_ik_chooses_what_the_pose_leaves_free() -> None:
    (pose,) = ask("fk", [{"q": [0.3, -math.pi / 2.0, 0.0, 0.0, 0.0]}])
    (answer,) = ask("ik", [pose | {"q": [0.3, -1.5, 0.1, 0.0, 0.0]}])
    assert any(abs(solution["q"][0] - 0.3) < 1e-9 for solution in answer["solutions"])
    assert all(solution["singular"] for solution in answer["solutions"])


def test_ik_refuses_a_skewed_rotation_with_the_figure() -> None:
    T = np.eye(4)
    T[0, 1] = 9.99e-4
    (answer,) = ask("ik", [{"T": T.tolist()}])
    assert answer["rotation_misfit"] == pytest.approx(9.99e-4)
    T[0, 1] = 1.002e-3
    (answer,) = ask("ik", [{"T": T.tolist()}], status=1)
    assert "rotation of T is not a rotation" in answer["error"]
    assert "off orthonormal by 0.001 (allowed: 1e-03)" in answer["error"]


def test_the_base_frame_is_the_shoulder_frame_moved(arm: MountedArm) -> None:
    q = [0.3, -0.9, 0.8, 0.4, 1.0]
    request = {"q": q, "tool": "grasp"}
    (shoulder,) = ask("fk", [request])
    (base,) = ask("fk", [request], "--frame", "base")
    assert np.allclose(arm.T_base_shoulder @ np.array(shoulder["T"]), base["T"], atol=1e-15)
    (answer,) = ask("ik", [base | {"tool": "grasp"}], "--frame", "base")
    assert any(np.allclose(s["q"], q) for s in answer["solutions"])


BAD = {
    "fk": [
        ("nonsense", "not JSON"),
        ("[1, 2]", "JSON object"),
        ("{}", "'q' is missing"),
        ({"q": [0, 0, 0, 0]}, "shape"),
        ('{"q": [0, 0, 0, 0, NaN]}', "axis 5"),
        ('{"q": [0, 0, 0, 0, 1e999]}', "axis 5"),
        ({"q": ["a", 0, 0, 0, 0]}, "Expected `float`, got `str` - at `$[0]`"),
        ('{"q": null}', "q is not of plain finite numbers: Expected `array`"),
        ('{"q": [0, true, 0, 0, 0]}', "got `bool` - at `$[1]`"),
        ('{"q": [0, 0, null, 0, 0]}', "got `null` - at `$[2]`"),
        ({"q": [0, 0, 0, 0, 0], "tool": None}, "'tool' is null"),
        ({"q": [0, 0, 0, 0, 0], "tool": True}, "'tool' is true"),
        ("null", "This is null; a request is a JSON object"),
        ("true", "This is true; a request is a JSON object"),
        ('\ufeff{"q": [0, 0, 0, 0, 0]}', "byte order mark (BOM). Save the file as UTF-8 without"),
        ('{"q": [0, 0, 0, 0, 0]', "not JSON: Expecting ',' delimiter at column 22"),
        ('{"q": [' + "1" * 5000 + ", 0, 0, 0, 0]}", "too many digits"),
        ('{"q": [' + "1" * 400 + ", 0, 0, 0, 0]}", "out of range - at `$[0]`"),
        ({"q": [0, 0, 0, 0, 0], "tool": "hammer"}, "tcp, grasp, flange"),
        ({"q": [0, 0, 0, 0, 0], "tool": {}}, "'tool' is an object"),
        ({"q": [0, 0, 0, 0, 0], "tol": "tcp"}, "'tol'"),
        ("[" * 100_000, "not JSON"),
    ],
    "ik": [
        ({"T": [[1, 0], [0, 1]]}, "shape"),
        ({"T": np.diag([1, 1, 2, 1]).tolist()}, "rotation"),
        ({"T": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 2]]}, "last row"),
        ('{"T": [[1,0,0,NaN],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}', "nan"),
        ({"T": None}, "T is not of plain finite numbers"),
        ('{"T": [[true,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}', "at `$[0][0]`"),
        ('{"T": [[1,0,0,0],[0,1,0,0],[0,0,1,0],null]}', "at `$[3]`"),
        ('{"T": [[1,0,0,0],[0,1,0,0],[0,0,1],[0,0,0,1]]}', "not a regular array"),
    ],
}
GOOD = {"fk": {"q": [0, 0, 0, 0, 0]}, "ik": {"T": np.eye(4).tolist()}}


@pytest.mark.parametrize("command", ["fk", "ik"])
def test_a_wrong_line_gets_an_error_and_the_rest_is_answered(command: str) -> None:
    """Mix good and wrong lines; each wrong one is answered with its number and the reason."""
    lines = [line for bad, _ in BAD[command] for line in (GOOD[command], bad)]
    answers = ask(command, [*lines, GOOD[command]])
    assert all("error" not in answer for answer in answers[::2])
    assert answers[0] == answers[-1]
    for number, (message, answer) in enumerate(
        zip((message for _, message in BAD[command]), answers[1::2], strict=True), start=1
    ):
        assert set(answer) == {"error"}
        assert f"line {2 * number}: " in answer["error"]
        assert message in answer["error"]


def test_the_exit_status_is_1_when_every_line_failed() -> None:
    bad, good = {"q": None}, GOOD["fk"]
    ask("fk", [bad, "", bad], status=1)
    ask("fk", [bad, good, bad], status=0)


def test_bytes_that_are_not_utf_8_affect_only_their_line() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "katana450", "fk"],
        input=b'\xff\xfe\n{"q": [0, 0, 0, 0, 0]}\n\xef\xbb\xbf{"q": [0, 0, 0, 0, 0]}\n',
        capture_output=True,
        cwd=ROOT,
        check=True,
    )
    first, second, third = map(json.loads, done.stdout.splitlines())
    assert first["error"].startswith("line 1: This is not JSON")
    assert "T" in second
    assert "line 3: This is not JSON: it begins with a byte order mark" in third["error"]


def test_empty_lines_are_no_requests() -> None:
    assert ask("fk", ["", "   "]) == []


def test_answers_come_line_by_line() -> None:
    """Check that a program that keeps the pipe open gets each answer at once."""
    with subprocess.Popen(
        [sys.executable, "-m", "katana450", "fk"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        for _ in range(3):
            process.stdin.write('{"q": [0, 0, 0, 0, 0]}\n')
            process.stdin.flush()
            assert json.loads(process.stdout.readline())["T"][0][3] == pytest.approx(0.6318)
        process.stdin.close()
    assert process.returncode == 0
