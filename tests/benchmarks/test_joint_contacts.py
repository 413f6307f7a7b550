"""The benchmark of contacts of robots that are driven joint by joint runs on a small robot."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import joint_contacts
from tests.robot.hands import rail


def test_both_sessions_of_a_robot_are_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(joint_contacts, "TARGETS", 2)
    monkeypatch.setattr(joint_contacts, "TICKS", 10)
    path = tmp_path / "rail.urdf"
    path.write_text(rail())
    joint_contacts.measure(path)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("rail: 2 joints, 4 bodies, 5 pairs")
    assert [line.split("p50")[0].strip() for line in lines[1:]] == [
        "without contacts",
        "with contacts",
    ]
