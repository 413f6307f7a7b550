"""``katana450 fk`` and ``ik`` for arms of other kinds: lines in, lines out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.cli.lines import ask

Urdf = Callable[[str], Path]


Q = [0.3, -0.8, 1.1, 0.4, 0.7, -0.5]


def test_posture_comes_back(urdf: Urdf) -> None:
    options = ("--urdf", str(urdf("ur5")), "--frame", "base")
    (pose,) = ask("fk", [{"q": Q}], *options)
    (answer,) = ask("ik", [{"T": pose["T"], "q": Q}], *options)
    near = [
        solution for solution in answer["solutions"] if np.allclose(solution["q"], Q, atol=1e-9)
    ]
    assert len(near) == 1
    assert near[0]["within_limits"]
    assert near[0]["singular"] == []
    assert answer["residual_mm"] < 1e-9
    assert answer["residual_rad"] < 1e-9
    assert len(answer["solutions"]) == len({solution["branch"] for solution in answer["solutions"]})


def test_tool_and_orientation_are_chosen_in_the_line(urdf: Urdf) -> None:
    options = ("--urdf", str(urdf("seven")))
    tcp, flange = ask("fk", [{"q": [0.1] * 7}, {"q": [0.1] * 7, "tool": "flange"}], *options)
    gap = np.array(tcp["T"])[:3, 3] - np.array(flange["T"])[:3, 3]
    assert np.linalg.norm(gap) == pytest.approx(np.hypot(0.02, 0.1))
    line = {"p": [0.4, 0.1, 0.3], "rpy": [0.1, 0.2, 0.3]}
    (answer,) = ask("ik", [line], *options, "--tool", "flange")
    assert answer["residual_mm"] < 1e-9
    solution = answer["solutions"][0]
    (pose,) = ask("fk", [{"q": solution["q"], "tool": "flange"}], *options)
    np.testing.assert_allclose(np.array(pose["T"])[:3, 3], line["p"], atol=1e-9)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ({"q": [0.0] * 5}, r"shape (5,); it must be (6,)"),
        ({"q": [0.0] * 6, "tool": "nose"}, "There is no tool 'nose'; this arm has ee_link"),
        ({"q": [0.0] * 6, "tool": ["l6"]}, "no tool with that name"),
    ],
)
def test_wrong_line_of_fk_is_refused(urdf: Urdf, line: object, message: str) -> None:
    (answer,) = ask("fk", [line], "--urdf", str(urdf("ur5")), status=1)
    assert answer["error"].startswith("line 1: ")
    assert message in answer["error"]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ({"p": [0.0, 0.0, 0.0], "pitch": 0.0, "roll": 0.0}, "no key 'pitch'"),
        ({"p": [0.0, 0.0, 0.0]}, "one orientation"),
        ({"T": np.eye(4).tolist(), "q": [0.0]}, "shape (1,)"),
    ],
)
def test_wrong_line_of_ik_is_refused(urdf: Urdf, line: object, message: str) -> None:
    (answer,) = ask("ik", [line], "--urdf", str(urdf("ur5")), status=1)
    assert message in answer["error"]
