"""Recordings of an arm outside the five-axis family: verified, exported, and run again."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

import katana450
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.state import State
from katana450.assembly.robot_session import DescribedRobot, find_robot
from katana450.cli.main import main
from katana450.extensions.programs.run.simulation import plan_script, run_by_clock
from katana450.extensions.programs.script.script import parse
from katana450.maths.geometry import so3
from katana450.maths.kinematics.forward import forward
from katana450.settings import Settings
from tests.general_arms.links_of_arms import ur5e
from tests.recording.lerobot_check import check_dataset, rows_of
from tests.recording.sessions import record_session

TOLERANCE = 1.5e-4
"""[rad] Distance of a run from the recorded setpoints, as in ``test_run_again``."""


@pytest.fixture(scope="module")
def urdf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("ur5e") / "ur5e.urdf"
    path.write_text(ur5e(), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def described(urdf: Path) -> DescribedRobot:
    return find_robot(Settings(), urdf, None)


@pytest.fixture(scope="module")
def path(urdf: Path, described: DescribedRobot) -> Path:
    """Two typed places of the tool, one after the other, and a stop."""
    session = described.session
    p = forward(session.require_arm().chain, session.ready)[:3, 3]
    drags = {5: p + np.array((0.0, 0.05, -0.05)), 120: p - np.array((0.0, 0.05, 0.0))}

    def commands(tick: int, _state: State) -> Iterator[cmd.Command]:
        if tick in drags:
            yield cmd.Position(drags[tick])

    recorded = urdf.with_name("run.mcap")
    return record_session(recorded, 260, commands, robot=described, urdf=urdf)


def test_states_have_all_axes_and_the_tool(path: Path, described: DescribedRobot) -> None:
    run = katana450.open(path)
    assert run.q.shape[1] == 6
    arm = described.robot.require_arm()
    T = arm.T_base_shoulder @ forward(arm.chain, run.q[-1])
    np.testing.assert_allclose(run.position[-1], T[:3, 3], atol=2e-5)
    x, y, z, w = run.orientation[-1]
    np.testing.assert_allclose(so3.from_quaternion((w, x, y, z)), T[:3, :3], atol=1e-12)
    assert float(np.ptp(run.position[:, 1])) > 0.09


def test_motion_runs_again(
    path: Path, urdf: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["record", "verify", str(path), "--urdf", str(urdf)]) == 0
    assert "identical to the bit" in capsys.readouterr().out
    script = tmp_path / "again.yaml"
    command = ["record", "again", str(path), "--urdf", str(urdf), "--out", str(script)]
    assert main(command) == 0
    text = script.read_text(encoding="utf-8")
    run = run_by_clock(plan_script(parse(text), urdf))
    passed = np.abs(run.q[:, None] - katana450.open(path).setpoint).max(axis=2).min(axis=0)
    assert passed.max() < 20.0 * TOLERANCE
    # Its script is refused for an arm of five axes.
    script.write_text(text.replace("tool: tool0\n", ""), encoding="utf-8")
    assert main(["run", str(script), "--headless"]) == 1
    assert "5 joints, but the command has 6" in capsys.readouterr().err


def test_tables_bags_and_datasets_have_six_axes(path: Path, tmp_path: Path) -> None:
    export = ["record", "export", str(path), "--format"]
    for kind in ("csv", "rosbag2", "lerobot"):
        more = ["--task", "reach"] if kind == "lerobot" else []
        assert main([*export, kind, "--out", str(tmp_path / kind), *more]) == 0
    with (tmp_path / "csv").open() as opened:
        names = next(csv.reader(opened))
    assert names[:7] == ["t", *(f"theta{axis}" for axis in range(1, 7))]
    store = get_typestore(Stores.ROS2_HUMBLE)
    with AnyReader([tmp_path / "rosbag2"], default_typestore=store) as reader:
        (wanted,) = (link for link in reader.connections if link.topic == "/joint_setpoints")
        *_, (connection, _, data) = reader.messages(connections=[wanted])
        last: Any = reader.deserialize(data, connection.msgtype)
    run = katana450.open(path)
    np.testing.assert_array_equal(last.position[:6], run.setpoint[-1])
    assert last.name[:2] == ["shoulder_pan_joint", "shoulder_lift_joint"]
    check_dataset(tmp_path / "lerobot")
    assert np.array(rows_of(tmp_path / "lerobot")["action"]).shape[1] == 7
