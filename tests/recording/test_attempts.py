"""The tree of attempts follows from the events of a recording."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest
from msgspec import structs

from katana450.arm.control.lease import CommandChannel
from katana450.errors import InputError
from katana450.extensions.recording.files.attempts import (
    Attempt,
    TreeEvent,
    attempt_at,
    parted,
    tree_of,
)
from katana450.extensions.recording.files.spans import Span
from katana450.extensions.recording.files.table import TICK
from katana450.extensions.recording.playback.run import PlaybackRun
from katana450.extensions.recording.playback.store import RecordingStore, opened
from tests.recording.episode_bench import Bench
from tests.recording.recorded import fresh, rewound


def test_tree_has_each_continuation_with_its_parent_and_its_drivers() -> None:
    ada, pour, policy = ("Ada", "person"), ("Pour", "program"), ("ACT", "policy")
    events = [
        TreeEvent(10.0, "driver", name="Ada", channel=CommandChannel.SCENE),
        TreeEvent(15.0, "driver", name="Pour", channel=CommandChannel.PROGRAM),
        TreeEvent(20.0, "restore", since=14.0, recording="ring"),
        TreeEvent(20.0, "driver", name="Ada"),
        TreeEvent(30.0, "restore", since=16.0),
        TreeEvent(32.0, "driver", name="ACT", channel=CommandChannel.WEBSOCKET),
        TreeEvent(40.0, "restore", since=25.0, recording="ring"),
        TreeEvent(50.0, "restore", since=1.0, recording="ring"),
        TreeEvent(60.0, "restore", since=55.0, recording="opened"),
        TreeEvent(65.0, "attempt", since=39.0, name="Grasp", outcome="failure"),
        TreeEvent(66.0, "attempt", since=39.5, name="Again", outcome="success", hidden=True),
        TreeEvent(67.0, "attempt", since=5.0, name="No longer recorded"),
    ]
    attempts = tree_of(events, 10.0, 70.0)
    assert [structs.replace(attempt, path=()) for attempt in attempts] == [
        Attempt(1, None, 10.0, 20.0 - TICK, drivers=(ada, pour)),
        Attempt(2, 1, 20.0, 30.0 - TICK, 14.0, drivers=(ada,)),
        Attempt(3, 1, 30.0, 40.0 - TICK, 16.0, (), (ada, policy), "Again", "success", hidden=True),
        Attempt(4, 2, 40.0, 50.0 - TICK, 25.0, drivers=(policy,)),
        # From a moment that is no longer recorded, and from a file.
        Attempt(5, None, 50.0, 60.0 - TICK, drivers=(policy,)),
        Attempt(6, None, 60.0, 70.0, drivers=(policy,)),
    ]
    assert [attempt_at(attempts, t).number for t in (0.0, 25.0, 30.0, 99.0)] == [1, 2, 3, 6]
    paths = [attempt.path for attempt in attempts]
    fourth = (Span(10.0, 14.0 + TICK), Span(20.0, 25.0 + TICK), Span(40.0, 50.0 - TICK))
    assert paths[3] == fourth
    assert paths[4] == (Span(50.0, 60.0 - TICK),)
    # Two attempts are compared from where they part.
    assert parted(paths[1], paths[3]) == ((Span(25.0 + TICK, 30.0 - TICK),), (fourth[2],))
    assert parted(paths[1], paths[1]) == ((), ())
    apart = Span(14.0 + TICK, 16.0 + TICK), Span(30.0, 40.0 - TICK)
    assert parted(paths[1], paths[2]) == ((paths[1][1],), apart)


@pytest.mark.parametrize("open_run", [opened, lambda path: PlaybackRun(lambda: [path])])
def test_attempts_of_a_recording_differ_after_they_part(
    tmp_path: Path, open_run: Callable[[Path], PlaybackRun]
) -> None:
    path = tmp_path / "run.mcap"
    times = [state.t for state in rewound(path)]
    run, store = open_run(path), RecordingStore(None)
    run.update()
    attempts, shift = run.attempts(), run.spans[0].start - times[1]
    assert [attempt.parent for attempt in attempts] == [None, 1, 1, 3, None]
    starts = [times[tick] + shift for tick in (70, 100, 130, 150)]
    assert [attempt.start for attempt in attempts[1:]] == pytest.approx(starts, abs=0.011)
    assert {attempt.drivers for attempt in attempts} == {(("Ada", "person"),)}
    name = store.add(path, run)  # type: ignore[arg-type]  # a run in this process has its methods
    moments = attempts[1].end, attempts[2].end
    difference = asyncio.run(store.difference(name, moments, fresh().session))
    assert difference.starts[1] == attempts[2].start
    title, *values = difference.rows[0]
    seconds = [float(value.removesuffix(" s")) for value in values]
    assert seconds == pytest.approx([0.4, 0.3], abs=0.1)
    titles = [title, *(row[0] for row in difference.rows)]
    assert {"Duration", "Margin to limits", "Max tool speed", "Ends apart: tool"} <= set(titles)
    same = asyncio.run(store.difference(name, (moments[0], moments[0]), fresh().session))
    assert (same.starts, same.rows[-1][2]) == ((None, None), "0.0 mm")


def test_attempt_of_the_last_minutes_is_named_judged_and_hidden(bench: Bench) -> None:
    offset = 1e-9 * int(bench.header.metadata["utc_offset_ns"])
    with pytest.raises(InputError, match="has not moved"):
        bench.ask(do="describe_attempt", t=bench.t + offset, name="Early")
    bench.move(50)
    run = PlaybackRun(lambda: sorted(bench.ring_folder.iterdir()))
    bench.ask(do="describe_attempt", t=bench.t - 0.1 + offset, name=" Drag ", outcome="success")
    bench.ask(do="describe_attempt", t=bench.t - 0.1 + offset, name="Drag", hidden=True)
    run.update()
    [attempt] = run.attempts()
    assert structs.astuple(attempt)[7:] == ("Drag", "unjudged", True)
    assert attempt.end == pytest.approx(bench.t + offset, abs=0.02)
