"""``katana450 fk`` and ``ik`` as another program uses them: lines in, lines out."""

from __future__ import annotations

import contextlib
import io
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.cli.main import main
from app.robot.model import RobotModel

ROOT = Path(__file__).resolve().parents[2]
GOLDEN = json.loads((ROOT / "tests" / "golden" / "fk_reference.json").read_text(encoding="utf-8"))


def ask(command: str, lines: Sequence[object], *options: str) -> list[dict[str, Any]]:
    """The answers to ``lines``: strings as they are, anything else as JSON."""
    text = "".join((x if isinstance(x, str) else json.dumps(x)) + "\n" for x in lines)
    out, err = io.StringIO(), io.StringIO()
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        patch.setattr(sys, "stdin", io.StringIO(text))
        assert main([command, *options]) == 0
    assert err.getvalue() == ""
    return [json.loads(line) for line in out.getvalue().splitlines()]


def test_fk_agrees_with_the_manufacturer() -> None:
    samples = GOLDEN["samples"]
    answers = ask("fk", [{"q": sample["q"], "tool": "tcp"} for sample in samples])
    assert len(answers) == len(samples) == 24
    for sample, answer in zip(samples, answers, strict=True):
        gap = np.array(answer["T"])[:3, 3] - np.array(sample["T"])[:3, 3]
        assert np.abs(gap).max() * 1e3 < 1e-9


def test_ik_gives_back_the_joints_among_every_branch() -> None:
    samples = GOLDEN["samples"]
    poses = ask("fk", [{"q": sample["q"]} for sample in samples])
    answers = ask("ik", poses)
    for sample, answer in zip(samples, answers, strict=True):
        found = [s for s in answer["solutions"] if np.allclose(s["q"], sample["q"])]
        assert found
        assert all(solution["within_limits"] for solution in found)
        assert {s["branch"] for s in answer["solutions"]} == {
            "front-up",
            "front-down",
            "back-up",
            "back-down",
        }
        assert answer["residual_mm"] < 1e-9
        assert answer["residual_rad"] < 1e-9


def test_ik_states_what_is_lost_of_a_pose_no_5_axis_arm_can_take() -> None:
    T = np.eye(4)
    T[:3, 3] = [0.3, 0.3, 0.0]  # the arm points along the diagonal, the pose along x
    (answer,) = ask("ik", [{"T": T.tolist()}])
    assert answer["residual_mm"] < 1e-9
    assert answer["residual_rad"] == pytest.approx(np.pi / 4, abs=1e-9)
    T[:3, 3] = [1.0, 0.0, 0.0]
    (answer,) = ask("ik", [{"T": T.tolist()}])
    assert answer["residual_mm"] == pytest.approx(1000.0 - 631.8, abs=1e-6)


def test_ik_with_badges_says_what_each_solution_costs() -> None:
    q = [0.3, -0.9, 0.8, 0.4, 1.0]
    (pose,) = ask("fk", [{"q": q}])
    plain, badged = ask("ik", [pose])[0], ask("ik", [pose | {"q": q}], "--badges")[0]
    costs = ("distance_rad", "time_s", "smallest_singular_value", "contact")
    for solution, with_badge in zip(plain["solutions"], badged["solutions"], strict=True):
        assert set(with_badge) == {*solution, *costs}
        assert with_badge["distance_rad"] == pytest.approx(
            np.abs(np.array(with_badge["q"]) - q).max()
        )
        assert with_badge["time_s"] >= 0.0
        assert with_badge["smallest_singular_value"] > 0.0
    assert min(s["distance_rad"] for s in badged["solutions"]) == pytest.approx(0.0, abs=1e-9)
    met = {s["branch"]: s["contact"] for s in badged["solutions"]}
    assert met["front-up"] is None
    (from_zero,) = ask("ik", [pose], "--badges")
    assert from_zero["solutions"][0]["distance_rad"] == pytest.approx(
        np.abs(from_zero["solutions"][0]["q"]).max()
    )
    (refused,) = ask("ik", [pose | {"q": q}])
    assert "'q'" in refused["error"]


def test_the_base_frame_is_the_shoulder_frame_moved(model: RobotModel) -> None:
    q = [0.3, -0.9, 0.8, 0.4, 1.0]
    request = {"q": q, "tool": "grasp"}
    (shoulder,) = ask("fk", [request])
    (base,) = ask("fk", [request], "--frame", "base")
    assert np.allclose(model.T_base_shoulder @ np.array(shoulder["T"]), base["T"], atol=1e-15)
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
        ({"q": ["a", 0, 0, 0, 0]}, "numbers"),
        ({"q": [0, 0, 0, 0, 0], "tool": "hammer"}, "tcp, grasp, flange"),
        ({"q": [0, 0, 0, 0, 0], "tool": {}}, "no tool"),
        ({"q": [0, 0, 0, 0, 0], "tol": "tcp"}, "'tol'"),
        ("[" * 100_000, "not JSON"),
    ],
    "ik": [
        ({"T": [[1, 0], [0, 1]]}, "shape"),
        ({"T": np.diag([1, 1, 2, 1]).tolist()}, "rotation"),
        ({"T": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 2]]}, "last row"),
        ('{"T": [[1,0,0,NaN],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}', "nan"),
        ({"T": None}, "T"),
    ],
}
GOOD = {"fk": {"q": [0, 0, 0, 0, 0]}, "ik": {"T": np.eye(4).tolist()}}


@pytest.mark.parametrize("command", ["fk", "ik"])
def test_a_bad_line_gets_an_error_and_the_rest_go_on(command: str) -> None:
    """Good and bad lines take turns; each bad one is told its number and what is wrong."""
    lines = [line for bad, _ in BAD[command] for line in (GOOD[command], bad)]
    answers = ask(command, [*lines, GOOD[command]])
    assert all("error" not in answer for answer in answers[::2])
    assert answers[0] == answers[-1]
    for number, (said, answer) in enumerate(
        zip((said for _, said in BAD[command]), answers[1::2], strict=True), start=1
    ):
        assert set(answer) == {"error"}
        assert f"line {2 * number}: " in answer["error"]
        assert said in answer["error"]


def test_empty_lines_are_no_requests() -> None:
    assert ask("fk", ["", "   "]) == []


def test_answers_come_line_by_line() -> None:
    """A program that keeps the pipe open gets each answer at once."""
    with subprocess.Popen(
        [sys.executable, "-m", "app", "fk"],
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
