"""The marks of a timeline, from the events of a recording."""

from __future__ import annotations

from typing import Any

from katana450.extensions.recording.files.recording_file import Message
from katana450.extensions.recording.forms import json_text
from katana450.extensions.recording.messages import EVENTS
from katana450.extensions.recording.playback.marks import Mark, add_marks


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
