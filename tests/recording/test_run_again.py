"""A recorded motion runs again as a program: as recorded, within limits, clear of obstacles."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.scene_objects import SceneObject, Shape
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.arm.control.stop_cause import pressed
from katana450.arm.runtime.tick import TickRecord
from katana450.cli.main import main
from katana450.errors import InputError
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.planning.trajectory_path import CubicSpline
from katana450.extensions.programs.run.simulation import Planned, plan_script, run_by_clock
from katana450.extensions.programs.script.script import parse
from katana450.extensions.recording.files.recording_file import Message, RecordingFile
from katana450.extensions.recording.files.recording_writer import RecordingWriter
from katana450.extensions.recording.files.simulation import (
    recorded_states,
    session_for,
    verify_recording,
)
from katana450.extensions.recording.messages import COMMANDS, STATE
from katana450.extensions.recording.run_again.again_command import part_and_script, path_difference
from katana450.extensions.recording.run_again.again_script import (
    RecordedPart,
    again_script,
    read_part,
)
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.resources import URDF_PATH
from tests.recording.dataset_files import write_copy
from tests.recording.recorded import described, header, run
from tests.recording.sessions import drag, program, record_session

GANTRY = Path(__file__).parents[1] / "exchange" / "gantry.urdf"
TOLERANCE = 1.5e-4
"""[rad] Distance of a run from the recorded setpoints: that of the spline, and of its ticks."""


@pytest.fixture(scope="module")
def dragged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drag of 2.5 s, and a motion to the ready posture after a rest."""
    at: dict[int, cmd.Command] = {380: cmd.Joints(described().session.ready)}
    return record_session(tmp_path_factory.mktemp("again") / "drag.mcap", 600, drag(250, at))


def read(path: Path, start: float = 0.0, end: float = math.inf) -> tuple[RecordedPart, str]:
    with RecordingFile.open(path) as file:
        return part_and_script(file, described(), start, end)


def planned(text: str, begin: State | None = None) -> Planned:
    return plan_script(parse(text), URDF_PATH, begin=None if begin is None else lambda _: begin)


def test_drag_runs_again_within_a_tenth_of_a_milliradian(dragged: Path) -> None:
    part, text = read(dragged)
    plan = planned(text)
    trace = run_by_clock(plan).trace
    found = path_difference(part.setpoint, trace.t, trace.q)
    assert 1e-7 < found.joints < TOLERANCE
    # Limits and starts from rest make it slower, but not by much.
    assert part.duration < found.duration < 2.0 * part.duration
    limits = plan.robot.require_arm().limits
    assert (np.abs(np.diff(trace.q, axis=0)) / 0.01 <= 1.001 * limits.speed).all()
    assert (np.abs(np.diff(trace.q, 2, axis=0)) / 1e-4 <= 1.001 * limits.acceleration).all()


@pytest.mark.parametrize(("axis", "angle", "speed"), [(0, 0.6, 1.0), (2, 0.05, 1.0), (0, 0.5, 0.3)])
def test_straight_motion_takes_its_recorded_time(
    tmp_path: Path, axis: int, angle: float, speed: float
) -> None:
    goal = np.array(described().session.ready)
    goal[axis] += angle

    def commands(tick: int, _: State) -> Iterator[cmd.Command]:
        if tick == 5:
            yield cmd.Speed(speed)
        elif tick == 10:
            yield cmd.Joints(goal)

    path = record_session(tmp_path / "straight.mcap", 600, commands)
    part, text = read(path)
    trace = run_by_clock(planned(text)).trace
    found = path_difference(part.setpoint, trace.t, trace.q)
    assert found.joints < 1e-7
    assert 0.9 * part.duration < found.duration <= 1.1 * part.duration


def test_rests_are_kept(dragged: Path) -> None:
    part, text = read(dragged)
    waits = [float(each) for each in re.findall(r"wait: ([\d.]+)", text)]
    rests = np.diff(part.t)[part.rests]
    assert len(waits) == 1
    assert waits[0] == pytest.approx(rests.max(), abs=0.02)
    assert waits[0] > 0.2


def test_command_prints_the_difference(
    dragged: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "again.yaml"
    options = ["--from", "0.5", "--to", "2", "--out", str(out)]
    assert main(["record", "again", str(dragged), "--headless", *options]) == 0
    printed = capsys.readouterr().out
    assert "1.50 s of motion from 0.50 s to 2.00 s." in printed
    match = re.search(r"recorded setpoints: (\S+) rad. It took (\S+) s, recorded 1.50 s.", printed)
    assert match is not None, printed
    assert 0.0 < float(match[1]) < TOLERANCE
    assert "Limits of the joints and the tool make it slower" in printed
    assert parse(out.read_text(encoding="utf-8")).name == "Again drag.mcap"


def test_part_begins_at_the_recorded_posture(dragged: Path) -> None:
    part, _ = read(dragged, 1.0, 1.8)
    whole, _ = read(dragged)
    number = int(np.searchsorted(whole.t, 1.0, side="right")) - 1
    np.testing.assert_array_equal(part.setpoint[0], whole.setpoint[number])
    assert part.t[0] == pytest.approx(1.0)
    assert part.t[-1] == pytest.approx(1.8, abs=0.02)


@pytest.mark.parametrize(
    ("disturbance", "curved"), [pytest.param("pause", 2, marks=pytest.mark.long), ("stop", 1)]
)
def test_pause_or_stop_in_the_middle_is_left_out(
    tmp_path: Path, disturbance: str, curved: int
) -> None:
    """The arm brakes where it was disturbed, and continues at once."""
    begin: cmd.Command = cmd.Pause()
    end: cmd.Command = cmd.Resume()
    if disturbance == "stop":
        begin, end = cmd.Stop(pressed("Ada", "key", "press", 1e9)), cmd.ClearStop()
    at = {120: begin, 420: end, 430: cmd.Position(np.array((0.33, 0.05, 0.08)))}
    path = record_session(tmp_path / "disturbed.mcap", 700, drag(120, at))
    part, text = read(path)
    assert part.waited > 1.5
    trace = run_by_clock(planned(text)).trace
    found = path_difference(part.setpoint, trace.t, trace.q)
    assert found.joints < TOLERANCE
    assert sum(float(each) for each in re.findall(r"wait: ([\d.]+)", text)) < 0.3
    # After a stop the second part is straight in the joints. After a pause the drag continues until
    # it gets another target, which is a curve.
    assert (text.count("trajectory:"), text.count("- joints:")) == (curved, 3 - curved)
    # The time of the pause is not in the recorded time either.
    assert part.duration + part.waited == pytest.approx(part.t[-1], abs=0.1)
    assert found.duration < 2.0 * part.duration


def test_grasp_and_carried_object_are_repeated(tmp_path: Path) -> None:
    steps = "  - grasp: cup\n  - line: {by: {z: 60}}\n  - nudge: {axis: 1, by: 10}\n"
    path = record_session(tmp_path / "grasp.mcap", 1500, program(f"frame: base\nsteps:\n{steps}"))
    part, text = read(path)
    assert "gripper: {holding: cup, to: closed}" in text
    simulation = run_by_clock(planned(text))
    last = simulation.states[-1]
    assert last.held is not None
    assert last.held.name == "cup"
    with RecordingFile.open(path) as file:
        *_, recorded = recorded_states(file, described().session)
    environment = described().session.environment
    places = [
        environment.pose(each.held, each.x_setpoint)[:3, 3]
        for each in (recorded, last)
        if each.held is not None
    ]
    np.testing.assert_allclose(places[0], places[1], atol=2e-4)
    # Without the cup the fingers would close on nothing.
    start = simulation.states[0]
    with pytest.raises(ScriptError, match="hold nothing instead of cup"):
        planned(text, _without(start, "cup"))
    with pytest.raises(InputError, match="The hand holds cup at the start"):
        read(path, float(part.t[-1]) - 0.5)


def _without(state: State, name: str) -> State:
    from dataclasses import replace  # noqa: PLC0415

    kept = tuple(each for each in state.objects if each.name != name)
    return replace(state, objects=kept, poured=None)


def test_present_obstacle_is_refused_with_moment_and_pair(dragged: Path) -> None:
    part, text = read(dragged, 0.0, 3.0)
    middle = int(np.searchsorted(part.t, 2.0))
    box = _box_at(described().session, part.setpoint[middle])
    session = described().session
    start = session.begin(session.ready, 0.0, 0.0)
    start = session.step(start, (cmd.PlaceObject(box),), 0.01)
    with pytest.raises(ScriptError) as caught:
        planned(text, start)
    match = re.search(
        r"At ([\d.]+) s of the trajectory, with the tool at .* and stone would", str(caught.value)
    )
    assert match is not None, str(caught.value)
    # The moment of the recording at which the arm first comes too near.
    assert 0.5 < float(match[1]) < 2.1


def _box_at(session: Session, q: np.ndarray) -> SceneObject:
    arm = described().robot.require_arm()
    T = arm.T_base_shoulder @ forward(session.require_arm().chain, q)
    place = np.eye(4)
    place[:3, 3] = T[:3, 3] - (0.0, 0.0, 0.03)
    return SceneObject("stone", Shape.BOX, (0.06, 0.06, 0.06), place)


def test_gap_is_refused_with_its_time(tmp_path: Path) -> None:
    path = tmp_path / "gap.mcap"
    commands, count = drag(200), iter(range(260))
    with path.open("wb") as file:
        writer = RecordingWriter(file, header())
        records: list[TickRecord] = []
        run(260, 1, records.append, lambda _r, s, _f: commands(next(count), s), odd=False)
        for number, each in enumerate(records):
            if number == 150:
                writer.lost(each.t, 20, "the disk was full")
            elif not 130 <= number < 150:
                writer.put(each)
        writer.close()
    with pytest.raises(
        InputError, match=r"gap at 1\.\d+ s: 20 ticks are missing \(the disk was full\)"
    ):
        read(path)
    part, _ = read(path, 0.0, 1.2)
    assert part.duration > 1.0


@pytest.mark.parametrize(
    ("topic", "form"),
    [(COMMANDS, {"missing": 5}), (STATE, {}), (STATE, {"t": None}), (STATE, {"t": 1e9})],
)
def test_damaged_message_is_refused_in_words(
    dragged: Path,
    tmp_path: Path,
    topic: str,
    form: dict[str, object],
    capsys: pytest.CaptureFixture[str],
) -> None:
    numbers = iter(range(10_000))

    def change(message: Message) -> Message:
        if message.topic != topic or next(numbers) != 20:
            return message
        return message._replace(data=json.dumps(form).encode())

    path = write_copy(dragged, tmp_path / "changed.mcap", change=change)
    assert main(["record", "again", str(path), "--out", str(tmp_path / "again.yaml")]) == 1
    assert "is damaged" in capsys.readouterr().err
    assert not (tmp_path / "again.yaml").exists()


def test_other_robot_is_refused(dragged: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["record", "again", str(dragged), "--headless", "--urdf", str(GANTRY)]) == 1
    assert "not of" in capsys.readouterr().err
    with RecordingFile.open(dragged) as file, pytest.raises(InputError, match="not of"):
        session_for(file, GANTRY)


@pytest.mark.parametrize(
    ("start", "end", "why"),
    [(100.0, 110.0, "has nothing of it"), (3.1, 3.2, "Nothing moves"), (2.0, 1.0, "nothing of it")],
)
def test_parts_without_motion_are_refused(
    dragged: Path, start: float, end: float, why: str
) -> None:
    with RecordingFile.open(dragged) as file, pytest.raises(InputError, match=why):
        read_part(file, start, end)


@pytest.mark.long
def test_recording_of_a_run_is_verified_and_runs_again(dragged: Path, tmp_path: Path) -> None:
    """Trajectories are plans that recordings can hold."""
    _, text = read(dragged, 0.0, 1.5)
    path = record_session(tmp_path / "second.mcap", 500, program(text))
    with RecordingFile.open(path) as file:
        result = verify_recording(file, described().session)
        assert json.loads(file.metadata["settings"])["bare"] is False
    assert result.identical, str(result)
    part, again = read(path)
    trace = run_by_clock(planned(again)).trace
    assert path_difference(part.setpoint, trace.t, trace.q).joints < TOLERANCE


def moved(*pieces: FloatArray) -> RecordedPart:
    """Return a part whose axis 1 has the values of ``pieces`` [rad], 100 a second."""
    angle = np.concatenate(pieces)
    setpoint = np.tile(described().session.ready, (len(angle), 1))
    setpoint[:, 0] = angle
    count = len(angle)
    still = np.zeros(count, dtype=bool)
    t = 0.01 * np.arange(float(count))
    return RecordedPart(t, setpoint, np.zeros(count), still, ("",) * count, ("tcp",) * count, "x")


def test_motions_below_the_rounding_are_left_out() -> None:
    up, rest = np.linspace(0.0, 0.1, 50), np.full(30, 0.1)
    tiny = 0.1 + np.linspace(1e-9, 4e-6, 20)
    part = moved(up, rest, tiny, np.full(30, tiny[-1]), tiny[-1] - up)
    text = again_script(part, described().session.require_arm())
    assert re.findall(r"- (\w+):", text) == [
        "joints", "gripper", "joints", "wait", "wait", "joints",
    ]  # fmt: skip
    program_ = planned(text).program
    assert not any("approach" in task.name for task in program_.tasks)


def test_part_with_too_much_motion_is_refused_and_a_long_one_is_coarser() -> None:
    t = np.arange(0.0, 60.0, 0.01)
    arm = described().session.require_arm()
    slow = 0.05 * np.sin(4.4 * t)
    with pytest.raises(InputError, match="60 s with too much motion for one script"):
        again_script(moved(slow + 0.02 * np.sin(31.0 * t)), arm)
    part = moved(slow + 0.02 * np.sin(18.0 * t))
    text = again_script(part, arm).split("through:")[1]
    rows = np.array(re.findall(r"\[([\d.]+), (\S+),", text), dtype=float)
    spline = CubicSpline(rows[:, 0], np.radians(rows[:, 1:]))
    off = np.abs(spline.values_at(part.t)[:, 0] - part.setpoint[:, 0]).max()
    assert 1e-4 < off < 3.1e-4


def test_difference_is_that_of_the_paths() -> None:
    s = np.linspace(0.0, 1.0, 400)
    recorded = np.stack((s, np.sin(3.0 * s), s**2), axis=1)
    slow = np.sort(np.concatenate((s, s**2, np.full(50, 0.5))))
    run_ = np.stack((slow, np.sin(3.0 * slow), slow**2), axis=1)
    approach = np.linspace(recorded[0] - 1.0, recorded[0], 30)
    t = np.linspace(0.0, 0.01 * (len(approach) + len(run_) - 1), len(approach) + len(run_))
    same = path_difference(recorded, t, np.concatenate((approach, run_)))
    assert same.joints < 2e-5
    assert same.duration == pytest.approx(0.01 * (len(run_) - 1), abs=0.03)
    other = run_ + 1e-3 * np.sin(9.0 * slow)[:, None] * (0.0, 1.0, 0.0)
    off = path_difference(recorded, t, np.concatenate((approach, other))).joints
    assert 3e-4 < off <= 1e-3
    # A run that leaves the second half out.
    half = path_difference(recorded, t, np.concatenate((approach, run_[: len(run_) // 2])))
    assert half.joints > 0.1
