"""LeRobot's own commands, with our plug-ins and with an emulated SO-101."""

from __future__ import annotations

import math
import shutil
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.lerobot_environment import environment_of, prepare_lerobot
from katana450.cli.main import main as katana450
from katana450.client import connect
from katana450.extensions.motor_bus.calibration import read_calibration
from katana450.extensions.motor_bus.packets import TURN
from katana450.extensions.real_arm.emulator.server import ServoServer
from katana450.extensions.real_arm.servo.emulated_servos import STOPS
from katana450.maths.geometry.arrays import FloatArray
from tests.browser.server import RECORDING_APP, ROOT, AppServer
from tests.cli.terminal import Terminal
from tests.real_arm.emulated_servo_arm import served
from tests.recording.lerobot_check import rows_of

pytestmark = pytest.mark.long

HOME = ROOT / ".venv-bench" / "lerobot"
LATE, TRIES = "There is no status packet", 6
"""Error of LeRobot on a machine so busy that it runs 50 ms late, and number of tries."""

RECORD = {"repo_id": "local/test", "num_episodes": 2, "episode_time_s": 3, "reset_time_s": 0.5}
RECORD |= {"single_task": "reach", "push_to_hub": "false"}


@pytest.fixture(scope="module")
def start(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Return the words before the name of a command of LeRobot."""
    python = prepare_lerobot(HOME)
    if isinstance(python, str):
        pytest.skip(f"LeRobot cannot be installed: {python}")
    variables = {**environment_of(ROOT, HOME), "HF_HOME": str(tmp_path_factory.mktemp("lerobot"))}
    settings = [*map("=".join, variables.items()), str(python)]
    return ["env", "-i", *settings, "-m", "benchmarks.lerobot_command"]


def run(command: list[str], act: Callable[[Terminal], None], parts: dict[str, Any]) -> None:
    """Run ``command`` with its options by their parts; call ``act`` again and again meanwhile."""
    options = [f"--{part}.{key}={parts[part][key]}" for part in parts for key in parts[part]]
    for _ in range(TRIES):
        if "record" in command:
            shutil.rmtree(parts["dataset"]["root"], ignore_errors=True)
        shown = Terminal(*command, *options)
        try:
            while shown.process.poll() is None:
                act(shown)
                # A full terminal would hold the command up.
                shown.read()
                time.sleep(0.02)
            shown.read()
        finally:
            shown.close()
        if shown.process.returncode == 0 or LATE not in shown.text:
            break
    assert shown.process.returncode == 0, shown.text[-3000:]


def columns(root: Path) -> list[FloatArray]:
    """Return states and actions (N, n) of a dataset."""
    return [np.array(rows_of(root)[name]) for name in ("observation.state", "action")]


def test_recorded_dataset_agrees_with_our_export(start: list[str], tmp_path: Path) -> None:
    recorded, exported, episodes = (tmp_path / name for name in ("recorded", "exported", "own"))
    folders = ("--record", str(tmp_path / "ring"), "--episodes", str(episodes))
    command = (*RECORDING_APP, "--silence", "2.0", *folders)
    with AppServer(command) as server, connect(server.url, "Ada") as client:

        def swing(_: Terminal) -> None:
            for end, finger in ((0.4, 0.2), (0.0, 0.0)):
                client.gripper(finger)
                client.joints(np.array((end, -1.2 - end, 1.5 + end, 0.1, end)))

        client.episodes.start("reach")
        ours = {"type": "katana450", "url": server.url}
        dataset = {**RECORD, "root": recorded}
        parts = {"robot": {**ours, "drive": "false"}, "teleop": ours, "dataset": dataset}
        run([*start, "record", "--play_sounds=false"], swing, parts)
        client.episodes.stop("success")
    words = ("record", "export", str(episodes), "--format", "lerobot", "--fps", "100")
    assert katana450([*words, "--out", str(exported)]) == 0
    # LeRobot notes when a frame was due, and a busy machine is late. Our states and setpoints are
    # those of all times: each of its frames is one of them.
    for own, frames in zip(columns(exported), columns(recorded), strict=True):
        k, fine = np.arange(len(own)), np.arange(0, len(own) - 1, 0.1)
        path = np.stack([np.interp(fine, k, column) for column in own.T], axis=-1)
        errors = [float(np.abs(path - frame).max(axis=1).min()) for frame in frames]
        assert np.percentile(errors, 95) < 3e-3


def hold(arm: ServoServer, ticks: Sequence[int], seconds: float) -> None:
    """Move the joints by hand."""
    with arm.lock:
        for motor, goal in zip(arm.arm.motors, ticks, strict=True):
            motor[motor.make.torque_enable], motor[motor.make.goal_position] = 1, goal
    time.sleep(seconds)


def calibrate(start: list[str], part: str, device: dict[str, Any], arm: ServoServer) -> None:
    """Calibrate an arm by `lerobot-calibrate`, as a person does."""
    middle, ends = [sum(stops) // 2 for stops in STOPS], [[0] * 6, [TURN - 1] * 6] * 2

    def person(shown: Terminal) -> None:
        for prompt, places in (("to the middle", [middle]), ("Press ENTER to stop", ends)):
            if prompt in shown.read():
                shown.text = ""
                for place in places:
                    hold(arm, place, 1.5)
                    shown.read()
                for motor in arm.arm.motors:
                    motor[motor.make.torque_enable] = 0
                shown.type("\n")

    run([*start, "calibrate"], person, {part: device})
    calibration = read_calibration(device["calibration_dir"] / f"{device['id']}.json")
    for known, (low, high) in zip(calibration.values(), STOPS, strict=True):
        assert abs(known.range_max - known.range_min - (high - low)) <= 2


def test_so101_is_calibrated_and_recorded(start: list[str], tmp_path: Path) -> None:
    with served() as follower, served() as leader:
        folder: dict[str, Any] = {"calibration_dir": tmp_path}
        robot = folder | {"type": "so101_follower", "port": follower.terminal, "id": "follower"}
        teleop = folder | {"type": "so101_leader", "port": leader.terminal, "id": "leader"}
        calibrate(start, "robot", robot, follower)
        calibrate(start, "teleop", teleop, leader)

        def swing(_: Terminal) -> None:
            hold(leader, [2047 + round(300.0 * math.sin(2.0 * time.monotonic()))] * 6, 0.02)

        dataset = {**RECORD, "root": tmp_path / "recorded"}
        parts = {"robot": robot, "teleop": teleop, "dataset": dataset}
        run([*start, "record", "--play_sounds=false"], swing, parts)
        state, action = columns(tmp_path / "recorded")
        assert np.ptp(action, axis=0).min() > 20.0
        # The follower was limp at first, and has to rise.
        late = [np.median(np.abs(state[k:] - action[: len(action) - k])) for k in range(9)]
        assert min(late) < 2.0, "degrees, and percent of the jaw"
