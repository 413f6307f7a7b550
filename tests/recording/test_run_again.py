"""A recorded motion runs again as a program: as recorded, within limits, clear of obstacles."""

from __future__ import annotations

import json
import math
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

import katana450
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.control.state.state import State
from katana450.arm.control.state.stop_cause import pressed
from katana450.arm.runtime.tick import TickRecord
from katana450.cli.main import main
from katana450.errors import InputError
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.run.simulation import Planned, plan_script, run_by_clock
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.steps.trajectory import CubicSpline
from katana450.extensions.recording.episodes.episode import (
    Episode,
    EpisodeGiver,
    EpisodeOutcome,
    message_of,
)
from katana450.extensions.recording.episodes.episode_folder import (
    append_message,
    shown_part,
    with_episode,
    write_episode,
)
from katana450.extensions.recording.files.recording_file import Message, RecordingFile
from katana450.extensions.recording.files.recording_writer import RecordingWriter
from katana450.extensions.recording.forms import json_text
from katana450.extensions.recording.messages import COMMANDS, EPISODES, STATE, nanoseconds
from katana450.extensions.recording.run_again import (
    RecordedPart,
    again_script,
    read_part,
    script_of_part,
)
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.resources import URDF_PATH
from tests.recording.dataset_files import write_copy
from tests.recording.recorded import described, header, run
from tests.recording.sessions import drag, program, record_session

TOLERANCE = 1.5e-4
"""[rad] Distance of a run from the recorded setpoints: that of the spline, and of its ticks."""


@pytest.fixture(scope="module")
def dragged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drag of 2.5 s, and a motion to the ready posture after a rest."""
    commands: dict[int, cmd.Command] = {380: cmd.Joints(described().session.ready)}
    return record_session(tmp_path_factory.mktemp("again") / "drag.mcap", 600, drag(250, commands))


def read(path: Path, start: float = 0.0, end: float = math.inf) -> tuple[RecordedPart, str]:
    with RecordingFile.open(path) as file:
        part = read_part(file, start, end)
        return part, script_of_part(file, described(), start, end)


def distance(part: RecordedPart, run_: FloatArray) -> float:
    """Return the largest distance [rad] of a recorded setpoint from the path of a run (M, 5)."""
    steps = np.diff(run_, axis=0)
    squared = np.maximum((steps * steps).sum(axis=1), np.finfo(float).tiny)
    largest = 0.0
    for setpoint in part.setpoint:
        fraction = np.clip(((setpoint - run_[:-1]) * steps).sum(axis=1) / squared, 0.0, 1.0)
        nearest = run_[:-1] + fraction[:, None] * steps
        largest = max(largest, float(np.abs(nearest - setpoint).max(axis=1).min()))
    return largest


def planned(text: str, begin: State | None = None) -> Planned:
    return plan_script(parse(text), URDF_PATH, begin=None if begin is None else lambda _: begin)


def test_drag_runs_again_within_a_tenth_of_a_milliradian(dragged: Path) -> None:
    part, text = read(dragged)
    plan = planned(text)
    run = run_by_clock(plan)
    assert 1e-7 < distance(part, run.q) < TOLERANCE
    # Limits, and the way to the start, make it slower, but not by much.
    assert part.duration < run.t[-1] < 2.5 * part.duration
    limits = plan.robot.require_arm().limits
    assert (np.abs(np.diff(run.q, axis=0)) / 0.01 <= 1.001 * limits.speed).all()
    assert (np.abs(np.diff(run.q, 2, axis=0)) / 1e-4 <= 1.001 * limits.acceleration).all()


def test_rests_are_kept(dragged: Path) -> None:
    part, text = read(dragged)
    waits = [float(word) for word in re.findall(r"wait: ([\d.]+)", text)]
    rests = np.diff(part.t)[part.rests]
    assert len(waits) == 1
    assert waits[0] == pytest.approx(rests.max(), abs=0.02)
    assert waits[0] > 0.2


def test_part_begins_at_the_recorded_posture(dragged: Path) -> None:
    part, _ = read(dragged, 1.0, 1.8)
    whole, _ = read(dragged)
    number = int(np.searchsorted(whole.t, 1.0, side="right")) - 1
    np.testing.assert_array_equal(part.setpoint[0], whole.setpoint[number])
    assert part.t[0] == pytest.approx(1.0)
    assert part.t[-1] == pytest.approx(1.8, abs=0.02)


@pytest.mark.parametrize("disturbance", [pytest.param("pause", marks=pytest.mark.long), "stop"])
def test_pause_or_stop_in_the_middle_is_left_out(tmp_path: Path, disturbance: str) -> None:
    """The arm brakes where it was disturbed, and continues at once."""
    begin: cmd.Command = cmd.Pause()
    end: cmd.Command = cmd.Resume()
    if disturbance == "stop":
        begin, end = cmd.Stop(pressed("Ada", "key", "press", 1e9)), cmd.ClearStop()
    commands = {120: begin, 420: end, 430: cmd.Position(np.array((0.33, 0.05, 0.08)))}
    path = record_session(tmp_path / "disturbed.mcap", 700, drag(120, commands))
    part, text = read(path)
    run = run_by_clock(planned(text))
    assert distance(part, run.q) < TOLERANCE
    assert sum(float(word) for word in re.findall(r"wait: ([\d.]+)", text)) < 0.3
    # The time of the pause is not in the recorded time either.
    assert part.t[-1] - part.duration > 1.5
    assert run.t[-1] < 2.5 * part.duration


@pytest.mark.long
def test_grasp_and_carried_object_are_repeated(tmp_path: Path) -> None:
    steps = "  - grasp: cup\n  - line: {by: {z: 60}}\n  - nudge: {axis: 1, by: 10}\n"
    states, script = list[State](), program(f"frame: base\nsteps:\n{steps}")

    def commands(tick: int, state: State) -> Iterator[cmd.Command]:
        states.append(state)
        return script(tick, state)

    path = record_session(tmp_path / "grasp.mcap", 900, commands)
    part, text = read(path)
    assert "gripper: {to: closed, holding: cup}" in text
    simulation = run_by_clock(planned(text))
    last = simulation.states[-1]
    assert last.held is not None
    assert last.held.name == "cup"
    environment = described().session.environment
    places = [
        environment.pose(state.held, state.x_setpoint)[:3, 3]
        for state in (states[-1], last)
        if state.held is not None
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

    others = tuple(prop for prop in state.objects if prop.name != name)
    return replace(state, objects=others, poured=None)


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
        r"at ([\d.]+) s of the trajectory, with the tool at .* and stone would", str(caught.value)
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
        for number, record in enumerate(records):
            if number == 150:
                writer.lost(record.t, 20, "the disk was full")
            elif not 130 <= number < 150:
                writer.put(record)
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


@pytest.mark.parametrize(
    ("start", "end", "why"),
    [(100.0, 110.0, "has nothing of it"), (3.1, 3.2, "Nothing moves"), (2.0, 1.0, "nothing of it")],
)
def test_parts_without_motion_are_refused(
    dragged: Path, start: float, end: float, why: str
) -> None:
    with RecordingFile.open(dragged) as file, pytest.raises(InputError, match=why):
        read_part(file, start, end)


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
    text = again_script(part, described().session.require_arm().gripper)
    assert re.findall(r"- {?(\w+):", text) == [
        "joints", "gripper", "trajectory", "wait", "wait", "trajectory",
    ]  # fmt: skip
    program_ = planned(text).program
    assert not any("approach" in task.name for task in program_.tasks)


def test_part_with_too_much_motion_is_refused_and_a_long_one_is_coarser() -> None:
    t = np.arange(0.0, 60.0, 0.01)
    gripper = described().session.require_arm().gripper
    slow = 0.05 * np.sin(4.4 * t)
    with pytest.raises(InputError, match="60 s with too much motion for one script"):
        again_script(moved(slow + 0.02 * np.sin(31.0 * t)), gripper)
    part = moved(slow + 0.02 * np.sin(18.0 * t))
    text = again_script(part, gripper).split("through:")[1]
    rows = np.array(re.findall(r"\[([\d.]+), (\S+),", text), dtype=float)
    spline = CubicSpline(rows[:, 0], np.radians(rows[:, 1:]))
    off = np.abs(spline.values_at(part.t)[:, 0] - part.setpoint[:, 0]).max()
    assert 1e-4 < off < 3.1e-4


def test_trimmed_episode_runs_again_in_its_range(
    dragged: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "episode-0001.mcap"
    with RecordingFile.open(dragged) as file:
        begin, end = file.start, file.end
    by = EpisodeGiver("Ada", "operator")
    episode = Episode(1, "lift", begin, end, EpisodeOutcome.SUCCESS, "", by)
    write_episode([dragged], path, episode)
    middle = 0.4 * (end - begin)
    with_episode(path, structs.replace(episode, end=begin + middle), "trimmed")
    recording = katana450.open(path)
    assert recording.script() == recording.script(0.0, middle)
    script = tmp_path / "again.yaml"
    capsys.readouterr()
    assert main(["record", "again", str(path), "--out", str(script)]) == 0
    assert script.read_text(encoding="utf-8") == recording.script()
    # A recording that contains an episode is not the file of that episode.
    with_episode(path, structs.replace(episode, start=begin + 0.1, end=end - 0.1), "trimmed")
    with RecordingFile.open(path) as file:
        assert shown_part(file, None, None) == pytest.approx((0.1, end - begin - 0.1))
    longer = tmp_path / "longer.mcap"
    shutil.copy(dragged, longer)
    text = json_text(message_of(structs.replace(episode, start=begin + 0.1), end, "ended"))
    append_message(longer, Message(EPISODES, 0, nanoseconds(end), text))
    with RecordingFile.open(longer) as file:
        assert shown_part(file, None, None) == (0.0, math.inf)
