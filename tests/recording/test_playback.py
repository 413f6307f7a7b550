"""Play back: the recorded states at any moment, marks, and spans."""

from __future__ import annotations

import asyncio
import copy
import os
import random
import re
import signal
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.records import Chunk
from starlette.exceptions import HTTPException
from starlette.requests import Request

from benchmarks.scrub import write_run
from katana450.arm.control.commands.commands import ClearStop, Command, Follow, Joints, Stop
from katana450.arm.control.lease import Role
from katana450.arm.control.session.plans import plan_to
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.control.state.state import State
from katana450.arm.control.state.stop_cause import pressed
from katana450.arm.runtime.tick import TickRecord
from katana450.assembly.robot_session import DescribedRobot
from katana450.errors import InputError
from katana450.extensions.recording.files import recording_file
from katana450.extensions.recording.files.recording_file import (
    Message,
    RecordingFile,
    checked_size,
    utc_offset_ns,
)
from katana450.extensions.recording.files.recording_writer import RecordingWriter
from katana450.extensions.recording.files.spans import (
    Span,
    at_place,
    length_of,
    spans_of,
)
from katana450.extensions.recording.folders import recordings_in
from katana450.extensions.recording.forms import json_text
from katana450.extensions.recording.live.ring import Ring
from katana450.extensions.recording.messages import EVENTS
from katana450.extensions.recording.playback import run as run_module
from katana450.extensions.recording.playback import store
from katana450.extensions.recording.playback.marks import Mark, add_marks
from katana450.extensions.recording.playback.routes import PlaybackRoutes
from katana450.extensions.recording.playback.rows import still_flying
from katana450.extensions.recording.playback.run import PlaybackRun
from katana450.extensions.recording.playback.store import RecordingStore, opened
from katana450.maths.geometry import se3, so3
from katana450.maths.water.flow import VesselMove, Water, WaterFlow
from katana450.maths.water.units import MILLILITRE
from katana450.server.service.identity import Identity
from katana450.server.web.http_api import RouteContext
from tests.recording.recorded import ADA, described, header, record, run


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[TickRecord]]:
    path = tmp_path_factory.mktemp("run") / "run.mcap"
    return path, record(path, 350)


def test_moments_are_the_recorded_states(recorded: tuple[Path, list[TickRecord]]) -> None:
    path, records = recorded
    run = read(path)
    shift = run.spans[0].start - records[0].t
    assert run.spans[-1].end == pytest.approx(records[-1].t + shift, abs=1e-6)
    for tick in random.Random(1).sample(records, 40):
        moment = run.at(tick.t + shift + 1e-6)
        assert moment is not None
        assert moment.row.joints == tick.state.q.tolist()
        assert moment.row.gripper == tick.state.gripper
        poses = {prop.name: prop.T for prop in moment.objects}
        for wanted in tick.state.objects:
            if not wanted.carried and wanted.name in poses:
                np.testing.assert_allclose(poses[wanted.name], wanted.T, atol=2e-6)
        assert {"cup", "basin"} <= poses.keys()
        if tick.state.poured is not None and moment.water is not None:
            inside = tick.state.poured.water.cup.volume
            assert moment.water.cup.volume == pytest.approx(inside, abs=1e3)
    # Before the start, the first state is shown.
    first = run.at(0.0)
    assert first is not None
    assert first.row.joints == records[0].state.q.tolist()


def test_file_that_grows_is_read_as_far_as_it_is_written(
    recorded: tuple[Path, list[TickRecord]], tmp_path: Path
) -> None:
    content = recorded[0].read_bytes()
    path = tmp_path / "growing.mcap"
    ends = []
    run = PlaybackRun(lambda: [path])
    begins = [chunk.offset for chunk in RecordingFile(recorded[0]).chunks]
    for size in (begins[1], begins[1] + 9, begins[-1] - 1, len(content)):
        path.write_bytes(content[:size])
        run.update()
        ends.append(run.spans[-1].end)
        assert run.at(ends[-1]) is not None
    assert ends == sorted(ends)
    assert ends[-1] > ends[0]


def read(path: Path) -> PlaybackRun:
    """Return the run in the file ``path``, decoded in this process."""
    run = PlaybackRun(lambda: [path])
    run.update()
    return run


def test_broken_files_are_refused(recorded: tuple[Path, list[TickRecord]], tmp_path: Path) -> None:
    content = bytearray(recorded[0].read_bytes())
    path = tmp_path / "broken.mcap"
    for broken in (b"", b"no recording at all", bytes(content[:40])):
        path.write_bytes(broken)
        try:
            assert not read(path).spans
        except InputError:
            continue
    with pytest.raises(InputError, match="The file is"):
        opened(path)
    rng = random.Random(2)
    for _ in range(20):
        damaged = bytearray(content)
        for _ in range(20):
            damaged[rng.randrange(len(damaged))] = rng.randrange(256)
        path.write_bytes(damaged)
        try:
            run = read(path)
            for t in [time for span in run.spans for time in span]:
                run.at(t)
            run.marks()
        except InputError:
            continue


def test_files_that_would_fill_the_memory_are_refused(
    recorded: tuple[Path, list[TickRecord]], monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(ValueError, match="the size of a chunk is wrong"):
        checked_size(Chunk("", bytes(100), 0, 0, 0, 10))
    with monkeypatch.context() as patched:
        patched.setattr(recording_file, "MAX_RECORDS", 3)
        with pytest.raises(InputError, match="more than 3 records"):
            read(recorded[0])
    run = read(recorded[0])
    monkeypatch.setattr(run_module, "MAX_BLOCK_BYTES", 20_000)
    with pytest.raises(InputError, match="more than 20000 bytes"):
        run.at(run.spans[0].start)


def test_file_that_its_process_cannot_decode_is_refused(
    recorded: tuple[Path, list[TickRecord]], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = opened(recorded[0])
    begin = run.spans[0].start
    before = run.at(begin)
    assert run._process is not None
    assert before is not None
    # As at the limit of its memory.
    run._process.kill()
    with pytest.raises(InputError, match="could not be decoded"):
        run.at(begin)
    after = run.at(begin)
    assert after is not None
    assert after.row == before.row
    if sys.platform != "win32":
        os.kill(run._process.pid, signal.SIGSTOP)
    monkeypatch.setattr(store, "TIMEOUT", 0.2)
    with pytest.raises(InputError, match=r"could not be decoded within 0\.2 s"):
        run.at(begin)


@pytest.mark.parametrize(
    ("text", "seconds"), [("-1500000000", -1.5), ("--5", 0.0), ("\u00b2", 0.0), ("x", 0.0)]
)
def test_wrong_offset_counts_as_none(text: str, seconds: float) -> None:
    assert utc_offset_ns({"utc_offset_ns": text}) == 1e9 * seconds


class StopAndPlan:
    """The commands of a motion, a stop of Ada, and a plan."""

    def __init__(self) -> None:
        self._tick = 0

    def __call__(
        self, _rng: np.random.Generator, state: State, session: DescribedRobot
    ) -> Iterator[Command]:
        self._tick += 1
        if self._tick == 5:
            yield Joints(session.session.ready + 0.1)
        elif self._tick == 30:
            yield Stop(pressed("Ada", ADA.key, "press", 1e9))
        elif self._tick > 150 and state.stopped is not None:
            yield ClearStop()
        elif self._tick > 170 and state.following is None and state.motion.at_rest:
            world = session.session.world_at(state)
            goal = session.session.ready - 0.05
            yield Follow(plan_to(session.session.require_arm(), world, state, goal))


def test_marks_tell_stops_drivers_and_plans(tmp_path: Path) -> None:
    ring = Ring(tmp_path / "ring", header())
    durations: list[float] = []

    def put(record: TickRecord) -> None:
        # The process that records has a copy of the plan with each message.
        ring.put(copy.deepcopy(record))
        if (following := record.state.following) is not None:
            durations.append(following.plan.duration_at(record.state.speed))

    run(260, 1, put, StopAndPlan(), odd=False)
    ring.close()
    played = PlaybackRun(lambda: recordings_in(tmp_path / "ring"))
    played.update()
    marks = played.marks()
    kinds = [mark.kind for mark in marks]
    assert kinds.count("stop") == 1
    assert kinds.index("driver") < kinds.index("stop") < kinds.index("clear_stop")
    assert kinds.index("clear_stop") < kinds.index("step")
    assert kinds.count("step") == 1
    words = {mark.kind: mark.text for mark in marks}
    assert words["stop"] == "Ada pressed STOP."
    # The seconds of a motion are those that it takes at its speed.
    seconds = float(re.findall(r"Planned motion of ([\d.]+) s", words["step"])[0])
    assert seconds == pytest.approx(durations[0], abs=0.06)
    assert words["driver"] in ("Ada drives", "the server drives")
    (stop,) = (mark for mark in marks if mark.kind == "stop")
    moment = played.at(stop.t + 1e-6)
    assert moment is not None
    assert moment.row.status == "stopped"


def event(t: int, **form: Any) -> Message:
    return Message(EVENTS, t, t * 10**9, json_text({"t": float(t), **form}))


def test_name_that_comes_after_the_press_is_that_of_the_stop() -> None:
    stop, named = "Somebody pressed STOP.", "Window 2 pressed STOP."
    marks: list[Mark] = []
    # The name can be in a later part of the file, which is read when it is complete.
    add_marks(marks, [event(1, kind="stop", why=stop), event(2, kind="driver", name="Anna")])
    assert [mark.text for mark in marks] == [stop, "Anna drives"]
    add_marks(marks, [event(3, kind="stop", why=named, named=True)])
    assert marks == [Mark(1.0, "stop", named), Mark(2.0, "driver", "Anna drives")]
    # A recording that begins in between does not show the press.
    later: list[Mark] = []
    add_marks(later, [event(3, kind="stop", why=named, named=True)])
    assert later == []


def test_continuation_is_marked_with_the_time_that_it_goes_back() -> None:
    marks: list[Mark] = []
    moments = ((8, "ring"), (9, ""), (10, "opened.mcap"), (133, "ring"), (11484, "ring"))
    for t, recording in moments:
        add_marks(marks, [event(t, kind="restore", since=5.5, recording=recording)])
    assert [mark.text.removeprefix("Continues from ") for mark in marks] == [
        *("2.5 s earlier", "3.5 s earlier", "5.5 s of a file"),
        *("2 min 8 s earlier", "3 h 11 min earlier"),
    ]


def test_program_is_marked_at_its_begin_and_its_end() -> None:
    marks: list[Mark] = []
    run = {"kind": "program", "name": "Pour", "since": 5.0}
    add_marks(
        marks,
        [
            event(5, **run, began=True),
            # The program drives by its own name, which the mark before says.
            event(6, kind="driver", name="Pour", channel="program"),
            # The next file says that it runs.
            event(19, **run, began=True),
            event(38, **run, began=False),
        ],
    )
    assert [(mark.t, mark.text) for mark in marks] == [
        (5.0, "Script Pour begins"), (38.0, "Script Pour ends after 33 s")
    ]  # fmt: skip


def test_water_is_that_of_the_moment_with_its_stream(tmp_path: Path) -> None:
    """The cup is tilted by 1.6 rad in 1.2 s, over the basin and beyond, beside a glass."""
    session = described().session
    pouring = session.pouring
    assert pouring is not None
    glass = SceneObject("glass", Shape.VESSEL, (0.03, 0.08), np.eye(4))
    state = session.begin(session.ready, 0.0, 1000.0)
    state = replace(state, objects=(*state.objects, glass))
    cup = next(prop for prop in state.objects if prop.name == "cup")
    volumes = {"cup": 120 * MILLILITRE, "glass": 30 * MILLILITRE}
    filled = pouring.settled(Water(()), state.objects, state.x, volumes)
    assert filled is not None
    flow, water, states = WaterFlow(pouring.water_environment(state.objects)), filled.water, []
    path = tmp_path / "pour.mcap"
    with path.open("wb") as file:
        writer = RecordingWriter(file, header())
        for number in range(150):
            t = 1000.0 + 0.01 * number
            R = so3.exp((0.0, min(1.6, 0.0133 * number), 0.0))
            T = se3.from_rotation_translation(R, cup.T[:3, 3] + (0.0, 0.0, 0.2))
            water = flow.step(water, {"cup": VesselMove(T, (0.0, 0.0, 0.0))}, 0.01)
            objects = tuple(
                replace(prop, T=T) if prop.name == "cup" else prop for prop in state.objects
            )
            poured = replace(filled, water=water)
            states.append(replace(state, t=t, objects=objects, poured=poured))
            writer.put(TickRecord(t - 0.01, t, (), False, states[-1]))
            if number % 20 == 19:
                writer.flush()
        writer.close()
    run = read(path)
    shift = run.spans[0].start - 1000.0
    assert max(len(state.poured.water.parcels) for state in states if state.poured) > 10
    for wanted in states[::7]:
        moment = run.at(wanted.t + shift + 1e-6)
        assert moment is not None
        assert moment.water is not None
        assert wanted.poured is not None
        shown, true = still_flying(moment.water, flow.water_environment), wanted.poured.water
        assert shown.cup.volume == pytest.approx(true.cup.volume, abs=1e4)
        assert shown.basin == pytest.approx(true.basin, abs=1e4)
        np.testing.assert_allclose(shown.cup.T, true.cup.T, atol=2e-6)
        assert [(cup.name, cup.volume) for cup in shown.others] == [("glass", volumes["glass"])]
        assert len(shown.parcels) == pytest.approx(len(true.parcels), abs=1)
        for a, b in zip(shown.parcels[::-1], true.parcels[::-1], strict=False):
            np.testing.assert_allclose(a.at(a.age), b.at(b.age), atol=1e-4)


def test_axis_leaves_out_the_rests() -> None:
    spans = spans_of([(10.0, 11.0), (11.5, 13.0), (100.0, 104.0)])
    assert spans == (Span(10.0, 13.0), Span(100.0, 104.0))
    assert length_of(spans) == 7.0
    for place, t in ((0.0, 10.0), (2.5, 12.5), (3.5, 100.5), (7.0, 104.0)):
        assert at_place(spans, place) == t
    assert (at_place(spans, -1.0), at_place(spans, 99.0)) == (10.0, 104.0)
    assert at_place((), 1.0) == 0.0


@pytest.mark.parametrize("role", [Role.VIEWER, Role.OPERATOR])
def test_viewers_open_no_files(tmp_path: Path, role: Role) -> None:
    who = Identity("session", "Vera", role)
    context = RouteContext(None, None, lambda _: who, None, None)  # type: ignore[arg-type]
    (_, *_, timeline) = PlaybackRoutes(context, RecordingStore(tmp_path)).routes()
    request = Request({"type": "http", "path_params": {"name": "0" * 16}, "headers": []})
    with pytest.raises(HTTPException) as caught:
        asyncio.run(timeline.endpoint(request))  # type: ignore[attr-defined]
    assert caught.value.status_code == (403 if role is Role.VIEWER else 404)


@pytest.mark.long
def test_any_moment_of_an_hour_has_its_state(tmp_path: Path) -> None:
    # `make bench-scrub` measures how long this takes.
    path = tmp_path / "hour.mcap"
    write_run(path, 3600.0)
    run = opened(path)
    start, end = run.spans[0].start, run.spans[-1].end
    assert end - start > 3500.0
    first, rng = run.at(start), random.Random(3)
    assert first is not None
    for _ in range(100):
        after = rng.uniform(0.0, end - start)
        state = run.at(start + after)
        assert state is not None
        # It is the last state before. The arm of this recording pauses for up to 1.4 s.
        assert -1e-3 < after - (state.row.t - first.row.t) < 1.5


def test_file_that_the_recorder_has_just_created_is_no_fault(tmp_path: Path) -> None:
    path = tmp_path / "1.mcap"
    path.touch()
    run = PlaybackRun(lambda: [path])
    run.update()
    assert run.spans == ()
    with pytest.raises(InputError, match="is empty"), RecordingFile.open(path):
        pass
    path.write_bytes(b"abc")
    with pytest.raises(InputError, match="too soon"):
        run.update()
